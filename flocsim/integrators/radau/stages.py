"""The stages of a Radau IIA step, by a simplified Newton iteration.

    M A⁻¹ (V − v₀)/h = F(X, V),  X = x₀ + h A V

for the velocities V at the three stages; positions X and tangential displacements follow from them.
The iteration uses the derivatives of the step's start, transformed to the stages by the frames of
contact_frames.py, and solves one real and one complex system of 3n equations.

Source: Hairer & Wanner, Solving Ordinary Differential Equations II (1996), section IV.8.
"""

import math

from flocsim.compiler.linker import apart
from flocsim.constants import TINY
from flocsim.geometry.contact.points import normal_component
from flocsim.integrators.radau.collocation import guess_stages
from flocsim.integrators.radau.contact_frames import update_frames
from flocsim.integrators.radau.systems import solve_both, write_residuals, write_stage_changes
from flocsim.integrators.radau.tableau import MATRIX, NODES, SECOND_STAGE, THIRD_STAGE
from flocsim.integrators.rhs.error import (
    ITERATION_TOLERANCE,
    MAX_ITERATIONS,
    NEGLIGIBLE,
    at_least_rounding,
    rounding_error,
    step_tolerance,
)
from flocsim.integrators.rhs.forces import adopt_stage, locate_for_forces, sum_forces
from flocsim.integrators.rhs.friction import (
    GRAZING_STIFFNESS_RATIO,
    grazing_force,
    limited_slip,
    slip_of_motion,
    slip_rate_of_gap_change,
)
from flocsim.integrators.rhs.surface_gap import locate_sharing, smoothing_length
from flocsim.integrators.rhs.views import lever, velocity_lifetime_of
from flocsim.state.contacts import CLOSED, GRAZING
from flocsim.state.work import CHANGE, FIRST_STAGE, NOW

TARGET_RATE = 0.4
"""Convergence rate of Newton's method that the next step aims at. The rate scales about as h²:
faster convergence would waste iterations on short steps, slower convergence would risk a failed
step. It is also assumed for the first iteration where no earlier step has shown a rate, and bounds
the extrapolated one from above."""

NEWTON_TOLERANCE = 1e-3
"""Error that Newton's method may leave, as a fraction of the step's tolerance; ITERATION_TOLERANCE
where no body is near another, since the tolerance is a hundred times smaller there. With .01
in contact, too, runs took 5 % less time, but errors of rolling and departing pairs were two to
three times as large."""

RATE_SAFETY = 3.0
"""Safety factor on the Newton convergence rate extrapolated from the previous step (rate ∝ h²)."""

GAP_TOLERANCE = 2e-3
"""Tolerance of gaps in Newton's method: relative to overlaps, which carry the loads, however far
below the tolerance of positions they are (without this, rounding in them was taken for an error of
the step, and cost 20 times the steps); with a surface force, relative to the smoothing length over
which it passes from one feature pair to the next (rhs/surface_gap.py): larger errors shake bodies
that lie flat in an energy well."""

SMALLEST_RATE = 1e-3
"""Lower bound of the extrapolated convergence rate. Where it decides, an unneeded second iteration
would change positions by less than the tolerance. An optimistic rate does little harm there."""


def update_stage_positions(work, step):
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


def update_stage_slips(scene, work, step, first, matrix):
    """Compute the tangential displacements of closed contacts in the stages from ``first`` on.

    The stages have been located. ``matrix`` holds the weights of the rates at the three stages.
    Most of ξ follows from the positions alone; only the effect of the changing gap is integrated.
    """
    slip = work.slip
    for row in range(work.tally.candidates):
        if work.candidates[row].contact_mode == CLOSED:
            for stage in range(first, 3):
                # Rates of the part of ξ that does not follow from the positions.
                correction = slip_rate_of_gap_change(scene, work, FIRST_STAGE + stage, row)
                work.slip_rate[FIRST_STAGE + stage, row] = correction
            for stage in range(first, 3):
                # Collocate that part, add the part from the positions, and limit ξ where the
                # contact slides.
                one, two, three = matrix[stage]
                mean = one * work.slip_rate[FIRST_STAGE, row]
                mean += two * work.slip_rate[SECOND_STAGE, row]
                mean += three * work.slip_rate[THIRD_STAGE, row]
                state = FIRST_STAGE + stage
                sticking_slip = (
                    slip[NOW, row] + slip_of_motion(scene, work, state, row) + step * mean
                )
                slip[state, row] = limited_slip(scene, work, state, row, sticking_slip)


def locate_state(scene, work, state):
    """Locate the contacts of NOW or of a stage that transmit forces there."""
    if state == NOW or scene.listed_reach <= 0.0:
        locate_for_forces(scene, work, state)
    else:
        locate_sharing(scene, work, state)


@apart
def evaluate_states(scene, work, time, step, first, last):
    """Compute the forces in the states from ``first`` up to but excluding ``last``: NOW or the
    stages."""
    for state in range(first, last):
        locate_state(scene, work, state)
    # The displacements of a stage depend on all three of them.
    if first == FIRST_STAGE:
        update_stage_slips(scene, work, step, 0, MATRIX)
    for state in range(first, last):
        node = 0.0 if state == NOW else NODES[state - FIRST_STAGE]
        sum_forces(scene, work, time + node * step, state)


def change_of_contacts(scene, work, step, stage, goal):
    """Return the largest change of a contact by the last Newton correction, scaled to the goal [m].

    Overlaps, grazing forces and gaps with surface forces have tolerances of their own. Each change
    is multiplied by the goal of the positions over its own tolerance, to be tested with the
    positions.
    """
    largest, least, state = 0.0, at_least_rounding(work, NOW, 0.0), FIRST_STAGE + stage
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        geometry = work.geometry[state, row]
        # Pressed contact: relative tolerance of the overlap, but not below rounding.
        if candidate.contact_mode == CLOSED:
            change = step * abs(normal_component(work, row, work.velocity, CHANGE, NOW))
            overlap = abs(geometry.gap)
            allowed = max(GAP_TOLERANCE * overlap, 0.1 * least)
            largest = max(largest, goal * change / allowed)
        elif candidate.contact_mode == GRAZING:
            # Grazing contact: relative tolerance of its tangential force, which is a dashpot's.
            resistance, memory = (
                work.contacts[row].grazing_resistance,
                velocity_lifetime_of(work, row),
            )
            change = abs(resistance * normal_component(work, row, work.velocity, CHANGE, NOW))
            force = abs(grazing_force(work, state, row))
            # A force that moves nothing by more than a share of the goal does not count.
            lever = GRAZING_STIFFNESS_RATIO / max(abs(resistance), TINY) * (step + memory)
            allowed = max(ITERATION_TOLERANCE * force, NEGLIGIBLE * goal / max(lever, TINY))
            largest = max(largest, goal * change / allowed)
        elif candidate.surface_active == 1 and geometry.force_share > 0.0:
            # Surface force: fraction of its smoothing length.
            change = step * abs(normal_component(work, row, work.velocity, CHANGE, NOW))
            length = smoothing_length(scene, geometry.gap)
            allowed = max(GAP_TOLERANCE * length, 0.1 * least)
            largest = max(largest, goal * change / allowed)
    return largest


def correct_stages(scene, work, step, goal):
    """Add the solutions to the stage velocities; return the largest resulting displacement [m].

    A velocity displaces its body over the step, and over the time for which it persists after.
    """
    largest = 0.0
    for stage in range(3):
        write_stage_changes(scene, work, stage)
        for body in range(work.place.shape[1]):
            memory = step + work.errors[body].velocity_lifetime
            for axis in range(3):
                change = work.velocity[CHANGE, body, axis]
                # Not finite: a system is nearly singular, or a force is not finite.
                if not abs(change) < math.inf:
                    return math.inf
                work.velocity[FIRST_STAGE + stage, body, axis] += change
                largest = max(largest, lever(scene, body, axis) * memory * abs(change))
        largest = max(largest, change_of_contacts(scene, work, step, stage, goal))
    return largest


def newton_iteration(scene, work, time, step, goal):
    """Make one Newton iteration; return the largest displacement of its correction [m]."""
    update_stage_positions(work, step)
    evaluate_states(scene, work, time, step, FIRST_STAGE, FIRST_STAGE + 3)
    # Transform the residuals to the start of the step, where the factors are.
    update_frames(scene, work)
    write_residuals(scene, work, step)
    solve_both(work)
    work.tally.solves += 1
    return correct_stages(scene, work, step, goal)


def finish_stages(scene, work, step):
    """Compute positions and tangential displacements of the last correction; write the end to
    NEW."""
    update_stage_positions(work, step)
    locate_state(scene, work, THIRD_STAGE)
    update_stage_slips(scene, work, step, 2, MATRIX)
    adopt_stage(work, THIRD_STAGE)


def expected_rate(clock, step):
    """Return the convergence rate to be expected before a second iteration shows it (rate ∝ h²)."""
    if clock.second_iteration_rate == 0.0:
        return TARGET_RATE
    growth = max(step / clock.second_iteration_step, 1.0)
    return min(
        max(RATE_SAFETY * clock.second_iteration_rate * growth * growth, SMALLEST_RATE),
        TARGET_RATE,
    )


@apart
def solve_stages(scene, work, clock, step):
    """Solve for the stage velocities; return False where Newton's method does not converge."""
    guess_stages(scene, work, clock, step)
    predicted = expected_rate(clock, step)
    # Positions are solved to a fraction of the tolerance, but not below rounding.
    allowed = step_tolerance(work, clock)
    fraction = NEWTON_TOLERANCE if allowed == clock.tolerance else ITERATION_TOLERANCE
    # Rotation of the contacts makes every other iteration converge worse. So the rate is the
    # geometric mean of two iterations.
    previous, earlier = math.inf, math.inf
    for _ in range(MAX_ITERATIONS):
        change = newton_iteration(scene, work, clock.time, step, fraction * allowed)
        goal = max(fraction * allowed, rounding_error(scene, work, THIRD_STAGE, step))
        rate = (change / earlier) ** 0.5 if earlier < math.inf else change / previous
        first = previous == math.inf
        if first:
            rate = predicted
        # The remaining error is about change · rate/(1 − rate) (Hairer & Wanner, IV.8.10).
        if rate < 1.0 and change * rate <= goal * (1.0 - rate):
            finish_stages(scene, work, step)
            clock.convergence_rate = 0.0 if first else rate
            if not first:
                clock.second_iteration_rate, clock.second_iteration_step = rate, step
            return True
        # Diverged: stop early.
        if not change < math.inf or (earlier < math.inf and rate > 1.0):
            break
        previous, earlier = change, previous
    clock.second_iteration_rate = 0.0
    return False
