"""The bodies of a swarm's replicates: sizes, flocs, box, walls, and what they follow from."""

import math

import numpy as np
import pytest
from scipy.stats import kstest, norm

from flocsim.ensembles.kind import Overseer
from flocsim.ensembles.runner import run
from flocsim.ensembles.swarms.study import SPHERE, SwarmStudy, lognormal
from flocsim.errors import ConfigError, UsageError
from tests.helpers.small_study import write_star_library
from tests.helpers.swarm_study import SWARM, swarm_config

MEASURED = SWARM.replace('radius = "5 um"\nspread = 0.2\n', "").replace(
    "vertices = [1]", 'source = "library"\nfile = "stars.h5"\nvertices = [4]'
)


def study(folder, overrides=None, text=SWARM):
    return SwarmStudy(swarm_config(folder, overrides, text))


def test_a_replicate_follows_from_seed_and_number_alone(tmp_path):
    first, again = (study(tmp_path).swarm(1)[0] for _ in range(2))
    other = study(tmp_path, {"seed": 5}).swarm(1)[0]
    places = [swarm.system.motion()[0] for swarm in (first, again, other)]
    assert places[0].tobytes() == places[1].tobytes() != places[2].tobytes()
    assert study(tmp_path).swarm(0)[0].bodies[0].shape.radius != first.bodies[0].shape.radius


def test_bodies_cover_the_share_that_is_asked_for_and_settle(tmp_path):
    swarm, drawn = study(tmp_path, {"scene": {"aspect": 2.0}}).swarm(0)
    width, height = drawn.box
    area = sum(math.pi * body.shape.radius**2 for body in swarm.bodies)
    assert area / (width * height) == pytest.approx(0.2, rel=1e-12)
    assert height == pytest.approx(2.0 * width) and swarm.box == (width, height)
    assert set(drawn.flocs.tolist()) == {SPHERE}
    a, b = sorted(swarm.bodies, key=lambda body: body.shape.radius)[:: len(swarm.bodies) - 1]
    # Stokes: the speed goes by r².
    ratio = (b.shape.radius / a.shape.radius) ** 2
    assert b.velocity[1] / a.velocity[1] == pytest.approx(ratio, rel=1e-6)
    assert a.velocity[1] < 0.0


def test_sizes_are_lognormal_between_their_limits(tmp_path):
    numbers = np.random.default_rng(1).random(4000)
    scene = swarm_config(tmp_path, {"scene": {"spread": 0.5}}).scene
    found = np.log(lognormal(scene, numbers) / 5e-6) / 0.5
    assert kstest(found, norm.cdf).pvalue > 0.01
    limits = {"min_radius": "4 um", "max_radius": "6 um", "spread": 0.5}
    cut = lognormal(swarm_config(tmp_path, {"scene": limits}).scene, numbers)
    assert cut.min() >= 4e-6 and cut.max() <= 6e-6
    assert kstest(np.log(cut), lambda x: inside(x)).pvalue > 0.01


def inside(x):
    """The distribution of ln r_eq between 4 and 6 um."""
    low, high = (norm.cdf(math.log(end / 5e-6) / 0.5) for end in (4e-6, 6e-6))
    return (norm.cdf((x - math.log(5e-6)) / 0.5) - low) / (high - low)


def test_measured_flocs_keep_their_sizes(tmp_path):
    write_star_library(tmp_path / "stars.h5", ratios=(3.0, 5.0, 8.0))
    made = study(tmp_path, text=MEASURED)
    swarm, drawn = made.swarm(0)
    radii = [body.shape.equivalent_radius for body in swarm.bodies]
    sizes = [made.flocs[each].size for each in drawn.flocs]
    np.testing.assert_allclose(radii, sizes, rtol=1e-12)
    assert len(set(drawn.flocs.tolist())) == 3
    few = study(tmp_path, {"scene": {"max_radius": "6 um"}}, MEASURED)
    assert max(few.drawn(0).flocs) < 2
    with pytest.raises(ConfigError, match="no floc of the library lies"):
        study(tmp_path, {"scene": {"min_radius": "1 mm"}}, MEASURED)


def test_larger_flocs_are_drawn_more_often_by_volume(tmp_path):
    write_star_library(tmp_path / "stars.h5", ratios=(3.0, 6.0))
    made = study(tmp_path, {"scene": {"weight": "volume", "number": 4000}}, MEASURED)
    share = np.mean(made.drawn(0).flocs == 1)
    assert share == pytest.approx(8.0 / 9.0, abs=0.02)


def test_a_floor_lies_below_the_box(tmp_path):
    scene = {"periodic": "x", "floor": True}
    swarm, drawn = study(tmp_path, {"scene": scene}).swarm(0)
    assert swarm.bodies[-1].fixed and len(swarm.bodies) == len(drawn.flocs) + 1
    assert swarm.box == (drawn.box[0], math.inf)
    assert all(body.position[1] > body.shape.bounding_radius for body in swarm.bodies[:-1])


def test_times_end_with_the_duration(tmp_path):
    assert study(tmp_path).stops == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert study(tmp_path, {"scene": {"every": "0.2 s"}}).stops == pytest.approx([0.0, 0.2, 0.3])


def test_what_finds_no_place_is_said(tmp_path):
    crowded = study(tmp_path, {"scene": {"area_fraction": 0.8, "number": 60}})
    with pytest.raises(UsageError, match="ask for a smaller fraction"):
        crowded.swarm(0)


def test_a_replicate_whose_bodies_find_no_place_is_a_failed_one(tmp_path):
    """In a box given by its sides, where one replicate has drawn too much for it."""
    sides = {"box": ["85 um", "85 um"], "spread": 0.6, "number": 12}
    found = study(tmp_path, {"scene": sides, "replicates": 30}, without("area_fraction"))
    drawn = [found.drawn(replicate).shapes for replicate in range(30)]
    least = np.array([6.0 * max(shape.radius for shape in shapes) for shapes in drawn])
    faults = np.flatnonzero(least > 85e-6)
    assert len(faults) and faults[0] > 0, "else this shows nothing"
    saved = []
    overseer = Overseer(keep=lambda *part: saved.append(part))
    row, note = found.run_task(found.conditions[0], int(faults[0]), overseer)
    assert row["finished"] == 0 and "box" in note["why"]
    assert [name for name, *_ in saved] == ["bodies"]


def test_the_first_replicate_is_drawn_once_before_it_is_run(tmp_path, monkeypatch):
    """Resizing thousands of flocs takes longer than the start of the run."""
    drawn, draw = [], SwarmStudy.drawn
    monkeypatch.setattr(SwarmStudy, "drawn", lambda self, k: drawn.append(k) or draw(self, k))
    config = swarm_config(
        tmp_path, {"replicates": 1, "scene": {"duration": "0.1 ms", "every": "0.1 ms"}}
    )
    run(config)
    assert drawn == [0]


def without(key):
    """The text of the small study without a key."""
    return "\n".join(line for line in SWARM.splitlines() if not line.startswith(key))


def test_bodies_begin_at_the_flow_of_their_places(tmp_path):
    shear = {"scene": {"periodic": "x"}, "fluid": {"gradient": [0.0, 3.0, 0.0, 0.0]}}
    sheared, _ = study(tmp_path, shear).swarm(0)
    still, _ = study(tmp_path, {"scene": {"periodic": "x"}}).swarm(0)
    for one, other in zip(sheared.bodies, still.bodies, strict=True):
        assert one.velocity[0] == pytest.approx(3.0 * one.position[1], rel=1e-9)
        assert one.velocity[1] == pytest.approx(other.velocity[1], rel=1e-9)


@pytest.mark.parametrize(
    ("periodic", "gradient", "axis"),
    [("xy", [0.0, 1.0, 0.0, 0.0], "y"), ("xy", [0.0, 0.0, 1.0, 0.0], "x"),
     ("x", [1.0, 0.0, 0.0, -1.0], "x")],
)  # fmt: skip
def test_flows_that_do_not_repeat_themselves_say_the_way_out(tmp_path, periodic, gradient, axis):
    changes = {"scene": {"periodic": periodic}, "fluid": {"gradient": gradient}}
    with pytest.raises(UsageError, match=f"varies along {axis}.*shear flow u_x = g y"):
        study(tmp_path, changes).swarm(0)
