"""How many iterations the stages take, and what a step that is taken anew knows already."""

import numpy as np
import pytest

import flocsim.arrays as at
from flocsim import Body, Sphere, System
from flocsim.forces import Contact, Gravity, StokesDrag
from flocsim.integrators import Implicit, Overdamped
from flocsim.integrators.implicit import is_tried_again
from flocsim.integrators.radau.stages import DOUBTED_PACE, FIRST_PACE, LEAST_PACE, expected_pace


def seen(pace, step):
    """A clock that has seen a second iteration of this pace in such a step."""
    clock = np.zeros(at.CLOCK_SIZE)
    clock[at.SEEN_PACE], clock[at.SEEN_STEP] = pace, step
    return clock


def test_without_experience_a_second_iteration_is_needed():
    assert expected_pace(np.zeros(at.CLOCK_SIZE), 1e-6) == FIRST_PACE


def test_a_longer_step_is_expected_to_converge_as_its_square():
    clock = seen(1e-3, 1e-6)
    assert expected_pace(clock, 1e-6) == pytest.approx(DOUBTED_PACE * 1e-3)
    assert expected_pace(clock, 3e-6) == pytest.approx(9.0 * DOUBTED_PACE * 1e-3)
    assert expected_pace(clock, 1e-7) == pytest.approx(DOUBTED_PACE * 1e-3)


@pytest.mark.parametrize(("pace", "expected"), [(1e-12, LEAST_PACE), (0.3, FIRST_PACE)])
def test_what_is_expected_has_bounds(pace, expected):
    assert expected_pace(seen(pace, 1e-6), 1e-6) == expected


def test_a_step_that_is_taken_anew_starts_from_what_is_known():
    """A sphere falls on another one: a step that ends at their touch begins where the one before
    did."""
    bodies = [
        Body(Sphere(1e-5), density=2650.0, fixed=True),
        Body(Sphere(1e-5), (0.0, 2.02e-5), density=2650.0),
    ]
    system = System(bodies, [Gravity(), StokesDrag(), Contact()], Overdamped())
    run = system.begin(2e-3, max_steps=1000, jit=False)
    run.to_end()
    trials = run.steps + run.rejected + run.counts[at.LOCATED]
    starts = run.work.tally[at.EVALUATIONS] - 3 * run.work.tally[at.SOLVES]
    assert run.counts[at.LOCATED] > 0
    assert starts == trials - run.counts[at.LOCATED]


@pytest.mark.parametrize(
    ("staged", "began", "reach", "known"),
    [(1e-6, 0.5, -1.0, True), (0.0, 0.5, -1.0, False), (1e-6, 0.4, -1.0, False),
     (1e-6, 0.5, 1e-7, False)],
)  # fmt: skip
def test_surface_forces_and_rejected_steps_start_afresh(staged, began, reach, known):
    scene = System([Body(Sphere(1e-5), density=2650.0)], [Gravity()], Implicit()).scene(jit=False)
    clock = np.zeros(at.CLOCK_SIZE)
    clock[at.TIME], clock[at.STAGED_STEP], clock[at.STAGED_AT] = 0.5, staged, began
    assert bool(is_tried_again(scene._replace(listed_reach=reach), clock)) == known
