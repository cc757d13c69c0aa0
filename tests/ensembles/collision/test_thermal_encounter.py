"""Encounters with thermal motion: kicks by (seed, replicate), the same in whatever order."""

import numpy as np
import pytest

from flocsim.forces.body_forces import random_key
from flocsim.run import Run
from flocsim.state.work import NOW, motion_of
from tests.helpers.small_study import small_study

WARM = {
    "scene": {"types": ["III"]},
    "shapes": {"vertices": [1]},
    "forces": {"thermal": {"temperature": 298.15, "kick": "1 ms"}},
    "integrator": {"name": "overdamped"},
}


@pytest.fixture
def study(tmp_path):
    """A study of spheres."""
    return small_study(tmp_path, WARM)


def end_of(study, replicate, share, until=0.0015):
    """Where the bodies of a replicate are after some kicks."""
    draw = study.draw(0, 1, share, replicate)
    run = draw.begin(study.driver(draw.encounter), 10**6, until)
    assert isinstance(run, Run)
    run.to_end()
    return motion_of(run.work, NOW)


def test_a_replicate_has_a_key_of_its_own_at_every_condition(study):
    keys = [study.draw(0, 1, 0.5, replicate).encounter.scene.key for replicate in (0, 1, 2, 0)]
    assert keys == [random_key(study.config.seed, replicate) for replicate in (0, 1, 2, 0)]
    encounter = study.draw(0, 1, 0.5, 2).encounter
    assert encounter.system.scene().key == encounter.scene.key
    assert encounter.settling[0][0] is study.encounter(0, 1, [0.0] * 4).settling[0][0]


def test_the_order_of_replicates_does_not_matter(study):
    first = [end_of(study, replicate, 0.5) for replicate in (0, 1, 2)]
    again = [end_of(study, replicate, 0.5) for replicate in (2, 0, 1)]
    for one, other in zip(first, (again[1], again[2], again[0]), strict=True):
        np.testing.assert_array_equal(one, other)
    assert not np.array_equal(first[0], first[1])


def test_without_thermal_motion_encounters_are_shared(tmp_path):
    cold = small_study(tmp_path, {name: WARM[name] for name in ("scene", "shapes", "integrator")})
    encounter = cold.encounter(0, 1, [0.0] * 4)
    assert encounter.keyed(1, 2) is encounter
