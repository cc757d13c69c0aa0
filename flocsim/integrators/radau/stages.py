"""The stages of a Radau IIA step: collocation of place, velocity and tangential displacement.

Unknown are the stages' velocities; places and displacements follow from them. Newton's method with
the derivatives of the step's start, carried along with the contacts (contact_frames.py), solves one
real and one complex system of 3n equations.
"""

import math

from flocsim.compiler.linker import apart
from flocsim.integrators.events.resolution import at_least_rounding
from flocsim.integrators.radau.collocation import guess_stages
from flocsim.integrators.radau.contact_frames import follow_contacts
from flocsim.integrators.radau.systems import solve_both, write_changes, write_loads
from flocsim.integrators.radau.tableau import MATRIX, NODES, SECOND_STAGE, THIRD_STAGE
from flocsim.integrators.rhs.error import rounding_error, step_tolerance
from flocsim.integrators.rhs.forces import adopt_stage, locate_for_forces, sum_forces
from flocsim.integrators.rhs.friction import (
    GRAZING_STIFFNESS_RATIO,
    grazing_force,
    rolled,
    slip_in,
    slip_rate_of_gap_change,
)
from flocsim.integrators.rhs.surface_gap import locate_sharing, smoothing_length
from flocsim.integrators.rhs.views import lever, normal_component, velocity_lifetime_of
from flocsim.state.contacts import CLOSED, GRAZING
from flocsim.state.work import CHANGE, FIRST_STAGE, NOW

MOST_ITERATIONS = 10
"""Newton steps before a step is given up and made smaller."""

FIRST_PACE = 0.5
"""What to expect of the second iteration when only one has been made."""

NEWTON_SHARE, FREE_NEWTON_SHARE = 1e-3, 1e-2
"""Newton's method goes on until what is left is below this share of what a step may be wrong by;
and where nothing is near, which allows a hundred times less anyway."""

DOUBTED_PACE = 3.0
"""The second iteration is expected to shrink the first one's change by so many times less than it
did when it was last made, its pace going with the square of the step, …"""

OVERLAP_SHARE = 2e-3
"""Overlaps are found to this share of themselves: what presses is decided by them, however far
below the tolerance they are."""

SMOOTHING_SHARE = 2e-3
"""Gaps through which surface forces act are found to this share of the length over which these
change hands between pairs of features (surface_gap.py): what is left of a gap shakes bodies that
lie flat in a well, however far below the tolerance it is."""

GRAZING_SHARE, LEAST_EFFECT = 0.02, 0.1
"""Forces of pairs that graze are found to this share of themselves, or until what they move is this
share of what places are found to."""

TINY = 1e-300
"""Keeps a quotient finite."""

LEAST_PACE = 1e-3
"""… and to this share at least: what it is not needed for changes places by no more than the
tolerance, so that a pace which is far worse than expected errs by little."""


def place_stages(work, step):
    for body in range(work.place.shape[1]):
        for axis in range(3):
            for stage in range(3):
                first, second, third = MATRIX[stage]
                mean = first * work.velocity[FIRST_STAGE, body, axis]
                mean += second * work.velocity[SECOND_STAGE, body, axis]
                mean += third * work.velocity[THIRD_STAGE, body, axis]
                work.place[FIRST_STAGE + stage, body, axis] = (
                    work.place[NOW, body, axis] + step * mean
                )


def slip_stages(scene, work, step, first, matrix):
    """Tangential displacements of the closed pairs in the stages from ``first`` on, which are
    located."""
    slip = work.slip
    for row in range(work.tally.candidates):
        if work.candidates[row].contact_mode == CLOSED:
            for stage in range(first, 3):
                besides = slip_rate_of_gap_change(scene, work, FIRST_STAGE + stage, row)
                work.slip_rate[FIRST_STAGE + stage, row] = besides
            for stage in range(first, 3):
                one, two, three = matrix[stage]
                mean = one * work.slip_rate[FIRST_STAGE, row]
                mean += two * work.slip_rate[SECOND_STAGE, row]
                mean += three * work.slip_rate[THIRD_STAGE, row]
                state = FIRST_STAGE + stage
                stuck = slip[NOW, row] + rolled(scene, work, state, row) + step * mean
                slip[state, row] = slip_in(scene, work, state, row, stuck)


def locate_state(scene, work, state):
    """Geometry of NOW, or of a stage, of the pairs through which forces act there."""
    if state == NOW or scene.listed_reach <= 0.0:
        locate_for_forces(scene, work, state)
    else:
        locate_sharing(scene, work, state)


@apart
def evaluate_states(scene, work, time, step, first, last):
    """Forces in the states from ``first`` to before ``last``; NOW or the stages."""
    for state in range(first, last):
        locate_state(scene, work, state)
    if first == FIRST_STAGE:
        slip_stages(scene, work, step, 0, MATRIX)
    for state in range(first, last):
        node = 0.0 if state == NOW else NODES[state - FIRST_STAGE]
        sum_forces(scene, work, time + node * step, state)


def change_of_forces(scene, work, step, stage, goal):
    """What the changes of a stage's velocities alter in the overlaps of pairs that touch, and in
    the forces of those that graze, over what may be wrong of them, in terms of the goal for places
    [m]."""
    largest, least, state = 0.0, at_least_rounding(work, NOW, 0.0), FIRST_STAGE + stage
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        geometry = work.geometry[state, row]
        if candidate.contact_mode == CLOSED:
            change = step * abs(normal_component(work, row, work.velocity, CHANGE))
            overlap = abs(geometry.gap)
            allowed = max(OVERLAP_SHARE * overlap, 0.1 * least)
            largest = max(largest, goal * change / allowed)
        elif candidate.contact_mode == GRAZING:
            resistance, memory = (
                work.contacts[row].grazing_resistance,
                velocity_lifetime_of(work, row),
            )
            change = abs(resistance * normal_component(work, row, work.velocity, CHANGE))
            force = abs(grazing_force(work, state, row))
            # A force that moves nothing by more than a share of the goal does not count.
            lever = GRAZING_STIFFNESS_RATIO / max(abs(resistance), TINY) * (step + memory)
            allowed = max(GRAZING_SHARE * force, LEAST_EFFECT * goal / max(lever, TINY))
            largest = max(largest, goal * change / allowed)
        elif candidate.surface_active == 1 and geometry.force_share > 0.0:
            change = step * abs(normal_component(work, row, work.velocity, CHANGE))
            length = smoothing_length(scene, geometry.gap)
            allowed = max(SMOOTHING_SHARE * length, 0.1 * least)
            largest = max(largest, goal * change / allowed)
    return largest


def correct_stages(scene, work, step, goal):
    """Add the solutions to the stages' velocities; the largest change it makes in place [m]."""
    largest = 0.0
    for stage in range(3):
        write_changes(scene, work, stage)
        for body in range(work.place.shape[1]):
            memory = step + work.errors[body].velocity_lifetime
            for axis in range(3):
                change = work.velocity[CHANGE, body, axis]
                if not abs(change) < math.inf:
                    return math.inf
                work.velocity[FIRST_STAGE + stage, body, axis] += change
                largest = max(largest, lever(scene, body, axis) * memory * abs(change))
        largest = max(largest, change_of_forces(scene, work, step, stage, goal))
    return largest


def newton_step(scene, work, time, step, goal):
    """One iteration; the largest change it makes in place [m]."""
    place_stages(work, step)
    evaluate_states(scene, work, time, step, FIRST_STAGE, FIRST_STAGE + 3)
    follow_contacts(scene, work)
    write_loads(scene, work, step)
    solve_both(work)
    work.tally.solves += 1
    return correct_stages(scene, work, step, goal)


def finish_stages(scene, work, step):
    """Places and tangential displacements that go with the last correction; the end is NEW."""
    place_stages(work, step)
    locate_state(scene, work, THIRD_STAGE)
    slip_stages(scene, work, step, 2, MATRIX)
    adopt_stage(work, THIRD_STAGE)


def expected_pace(clock, step):
    """What to expect of the second iteration before it is made."""
    if clock.second_iteration_rate == 0.0:
        return FIRST_PACE
    longer = max(step / clock.second_iteration_step, 1.0)
    return min(
        max(DOUBTED_PACE * clock.second_iteration_rate * longer * longer, LEAST_PACE), FIRST_PACE
    )


@apart
def solve_stages(scene, work, clock, step):
    """Find the stages' velocities; False where Newton's method does not converge."""
    guess_stages(scene, work, clock, step)
    expected = expected_pace(clock, step)
    allowed = step_tolerance(work, clock)
    share = NEWTON_SHARE if allowed == clock.tolerance else FREE_NEWTON_SHARE
    # Turning makes every other iteration worse, so that the pace is taken over two of them.
    before, earlier = math.inf, math.inf
    for _ in range(MOST_ITERATIONS):
        change = newton_step(scene, work, clock.time, step, share * allowed)
        goal = max(share * allowed, rounding_error(scene, work, THIRD_STAGE, step))
        pace = (change / earlier) ** 0.5 if earlier < math.inf else change / before
        first = before == math.inf
        if first:
            pace = expected
        if pace < 1.0 and change * pace <= goal * (1.0 - pace):
            finish_stages(scene, work, step)
            clock.convergence_rate = 0.0 if first else pace
            if not first:
                clock.second_iteration_rate, clock.second_iteration_step = pace, step
            return True
        if not change < math.inf or (earlier < math.inf and pace > 1.0):
            break
        before, earlier = change, before
    clock.second_iteration_rate = 0.0
    return False
