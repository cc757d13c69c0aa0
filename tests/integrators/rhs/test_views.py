"""The line of centres, where it has no direction."""

import math

import pytest

from flocsim import Body, System
from flocsim.compiler import composer
from flocsim.constants import CENTRE_SOFTENING
from flocsim.forces import VanDerWaals
from flocsim.integrators.rhs import views
from flocsim.io.results.schema import OUTCOMES
from flocsim.state.work import NOW
from tests.helpers.fast_scene import FastScene
from tests.helpers.small_study import small_study
from tests.helpers.trial_scenes import hook, star


@pytest.fixture(scope="module")
def fast():
    """A star in the notch of a hook, attracted to its centre."""
    bodies = [Body(shape, surface_density=2.0) for shape in (star(size=2e-6), hook())]
    return FastScene(System(bodies, [VanDerWaals()]))


def softening(scene):
    """ε [m] of the two bodies."""
    return CENTRE_SOFTENING * sum(scene.bodies["equivalent_radius"])


def attraction(fast, x, y):
    """Force (2,) on the second body with its centroid there."""
    fast.work.place[NOW, 1, :2] = x, y
    return fast.loads()[1, :2]


def test_the_pull_between_centres_fades_out_where_they_meet(fast):
    epsilon = softening(fast.scene)
    assert attraction(fast, 0.0, 0.0).tolist() == [0.0, 0.0]
    far = 1000.0 * epsilon
    full = math.hypot(*attraction(fast, far, 0.0))
    # F d_c/d, from nothing to all of it.
    for share in (1e-6, 0.1, 1.0, 10.0):
        reach = share / math.sqrt(1.0 + share * share)
        found = attraction(fast, 0.0, share * epsilon)
        assert found == pytest.approx([0.0, -reach * full], rel=1e-3, abs=1e-9 * full)


@pytest.mark.slow
def test_no_outcome_hangs_on_the_softening(tmp_path, monkeypatch):
    scene = {"types": ["I", "II", "III"], "delta": [0.0, 0.3, 0.7]}
    found = []
    for factor in (1.0, 10.0, 0.1):
        monkeypatch.setattr(views, "CENTRE_SOFTENING", factor * CENTRE_SOFTENING)
        monkeypatch.setattr(composer, "_composed", {})
        study = small_study(tmp_path, {"scene": scene, "replicates": 10})
        found.append([OUTCOMES[study.run(place, n, share, k)["outcome"]] for place in range(3)
                      for n in (4, 16) for share in (0.0, 0.3, 0.7) for k in range(5)])  # fmt: skip
    assert len(found[0]) == 90 and len(set(found[0])) > 2
    assert found[0] == found[1] == found[2]
