"""The binary collision scene: starts, limits, records."""

import math

import numpy as np
import pytest

from flocsim import Sphere
from flocsim.ensembles.collision import outcomes
from flocsim.ensembles.collision.draw import columns_of, draws
from flocsim.ensembles.collision.encounter import LIMIT_TURNS, REST_TURNS
from flocsim.ensembles.collision.mechanisms import make_encounter
from flocsim.io.results.schema import OUTCOMES
from flocsim.state.bodies import Y
from tests.helpers.rounding import to_rounding
from tests.helpers.small_study import small_config, small_study


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """The small study."""
    return small_study(tmp_path_factory.mktemp("study"))


def test_bodies_start_at_their_terminal_velocities_without_spin(study):
    encounter = study.encounter(0, 16, draws(1, 0))
    motion = np.hstack(encounter.motion((0.3, 2.0), 0.5))
    for body in range(2):
        radius = encounter.shapes[body].equivalent_radius
        mass = 2.0 * math.pi * radius**2
        fall = mass * 9.81 / (6.0 * math.pi * 8.9e-4 * radius)
        np.testing.assert_allclose(motion[body, 3:], [0.0, -fall, 0.0], rtol=1e-9)
    assert motion[:, 2].tolist() == [0.3, 2.0]


def test_the_bodies_have_the_sizes_of_their_type(study):
    for condition, radii in enumerate([(16.41e-6, 23.02e-6), (4.62e-6, 4.95e-6)]):
        for vertices in (1, 4, 16):
            shapes = study.encounter(condition, vertices, draws(1, 1)).shapes
            found = [shape.equivalent_radius for shape in shapes]
            assert found == pytest.approx(radii, rel=1e-12)
            assert [len(shape.vertices) for shape in shapes] == [vertices, vertices]
            if vertices > 1:
                assert [shape.radius for shape in shapes] == pytest.approx([1e-6] * 2, rel=1e-9)


def test_automatic_times_are_turn_times(study):
    encounter = study.encounter(0, 1, draws(1, 0))
    drift = math.hypot(*encounter.drift)
    turn = (16.41e-6 + 23.02e-6) / drift
    assert encounter.turn_time == pytest.approx(turn)
    assert encounter.given[outcomes.REST_TIME] == pytest.approx(REST_TURNS * turn)
    assert encounter.time_limit() == pytest.approx(LIMIT_TURNS * turn + 2e-6 / drift)


def test_times_and_gaps_that_are_given(tmp_path):
    given = {"rest_time": 0.5, "time_limit": 3.0, "escape_gap": "7 um", "start_gap": "3 um"}
    encounter = small_study(tmp_path, {"scene": given}).encounter(0, 1, draws(1, 0))
    observed = encounter.given.copy()
    assert encounter.time_limit() == 3.0
    assert (observed[outcomes.REST_TIME], observed[outcomes.ESCAPE]) == (0.5, 7e-6)
    places = encounter.motion((0.0, 0.0), 0.0)[0][:, Y]
    assert places[1] - places[0] == pytest.approx(16.41e-6 + 23.02e-6 + 3e-6, rel=1e-9)


def same_row(row, other):
    """Whether two rows agree to the bit."""
    return all(np.array_equal(row[name], other[name], equal_nan=True) for name in row)


def test_a_replicate_repeats_to_the_bit_in_any_order(study):
    first = study.run(0, 16, 0.0, 2)
    study.run(1, 4, 1.0, 1)
    assert same_row(study.run(0, 16, 0.0, 2), first)


def test_work_arrays_are_used_again_for_other_flocs_too(study, tmp_path):
    """Those of one run serve the next; a study that has run nothing else finds the same."""
    study.run(0, 16, 0.0, 0)
    before = [id(work) for work in study.batches.arrays.values()]
    rows = [study.run(0, 16, share, replicate) for share in (0.0, 0.5) for replicate in (1, 2, 3)]
    assert before and [id(work) for work in study.batches.arrays.values()] == before
    fresh = small_study(tmp_path)
    assert same_row(fresh.run(0, 16, 0.5, 3), rows[-1])


def recorded(study):
    """(row, arrays) of one replicate."""
    draw = study.draw(0, 16, 0.0, 0)
    steps = study.config.integrator.max_steps
    run = draw.begin(study.driver(draw.encounter), steps, record=True)
    return draw.row_of_run(run, run.to_end()), run.motion()


def test_recording_changes_nothing(study):
    row, _ = recorded(study)
    whole = study.run(0, 16, 0.0, 0)  # run a second and a third time, too
    again = {name: whole[name] for name in columns_of("checked") | columns_of("third")}
    assert same_row(row | again, whole)


def test_a_record_holds_every_step_with_the_instant_of_the_collision(study):
    row, (times, position, velocity) = recorded(study)
    assert len(times) == row["steps"] + 1
    assert times[0] == 0.0
    assert np.all(np.diff(times) > 0.0)
    assert times[-1] == row["t_end"]
    assert row["t_collision"] in times
    # numpy's hypot here, the compiled one in the row.
    distance = np.hypot(*(position[:, 1, :2] - position[:, 0, :2]).T)
    (at_collision,) = distance[times == row["t_collision"]]
    assert at_collision == to_rounding(row["d_c_collision"])
    assert distance[-1] == to_rounding(row["d_c_last"])
    assert distance[times >= row["t_collision"]].max() == to_rounding(row["d_c_max"])
    assert velocity.shape == position.shape


def test_contacts_that_never_pull_come_to_an_end(tmp_path):
    """Resting contacts hang at the kink of such a law, where steps could end for ever."""
    study = small_study(tmp_path, {"forces": {"contact": {"tension": False}}})
    rows = [study.run(0, 16, 0.0, replicate) for replicate in range(10)]
    assert max(row["steps"] for row in rows) < 20_000
    assert not any(OUTCOMES[row["outcome"]] == "undecided" for row in rows)


SMALL, LARGE = [Sphere(2e-6), Sphere(3e-6)], [Sphere(20e-6), Sphere(30e-6)]
THICK = {"double_layer": {"law": "outline", "potential": "25 mV", "debye_length": "1 um"}}


WATER = {"hydrodynamics": {}}


@pytest.mark.parametrize(
    "forces", [{}, WATER, THICK], ids=["between centres", "in water", "along outlines"]
)
def test_an_encounter_that_follows_another_is_as_one_made_alone(tmp_path, forces):
    """What forces add up to is found out once for all pairs, but where it hangs on their shapes."""
    config = small_config(tmp_path, {"forces": forces})
    first = make_encounter(config, LARGE, 1e-6)
    after = make_encounter(config, SMALL, 1e-7, first=first)
    alone = make_encounter(config, SMALL, 1e-7)
    assert after.settling[1][1] == alone.settling[1][1]
    assert (after.system.pieces is first.system.pieces) == (forces != THICK)
    assert np.array_equal(after.laws, alone.laws)
    for name, values in alone.scene._asdict().items():
        assert np.array_equal(getattr(after.scene, name), values), name
