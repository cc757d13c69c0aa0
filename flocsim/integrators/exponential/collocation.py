"""A step of exponential collocation: linear forces exactly, the rest collocated at Lobatto's
points.

The motion is the power series of series.py. Its remainder

    R = F − F₀ + K (x − x₀) + D (v − v₀),

the difference between the forces and their linearisation at the start, is taken as a cubic: zero at
the start, and exact at the three Lobatto points after it. It is found by fixed-point iteration,
which converges fast, because R hardly changes the motion. The method is of order 6 where R is
smooth, and exact for linear forces, however often they oscillate within the step. An impact takes a
step and a half, where Radau IIA takes six.

Source: Hochbruck & Ostermann, Acta Numerica 19 (2010), section 2.3.
"""

import math

from flocsim.compiler.linker import apart
from flocsim.constants import TINY
from flocsim.integrators.exponential.series import (
    MAX_STIFFNESS,
    TERM_TOLERANCE,
    evaluate_all,
    expand,
    phase_bound,
    write_first_terms,
    write_terms,
)
from flocsim.integrators.radau.stages import (
    change_of_contacts,
    expected_rate,
    locate_state,
    update_stage_slips,
)
from flocsim.integrators.rhs.contact_stiffness import RESOLVED_PHASE
from flocsim.integrators.rhs.error import (
    ITERATION_TOLERANCE,
    MAX_ITERATIONS,
    rounding_error,
    step_tolerance,
)
from flocsim.integrators.rhs.forces import adopt_stage, copy_motion, sum_forces
from flocsim.integrators.rhs.views import inertia, lever
from flocsim.state.work import (
    CHANGE,
    CHANGED,
    DAMPING,
    FIRST_STAGE,
    FORCING,
    LEVER,
    MOST_IN_SERIES,
    MOTION,
    MOVED,
    NOW,
    PROPAGATED,
    START,
    STEP_ERROR,
    STIFFNESS,
)

# √5, from which the Lobatto coefficients follow.
ROOT = 5.0**0.5

NODES = ((5.0 - ROOT) / 10.0, (5.0 + ROOT) / 10.0, 1.0)
"""Lobatto points after 0, as fractions of the step."""

MATRIX = (
    ((25.0 - ROOT) / 120.0, (25.0 - 13.0 * ROOT) / 120.0, (-1.0 + ROOT) / 120.0),
    ((25.0 + 13.0 * ROOT) / 120.0, (25.0 + ROOT) / 120.0, (-1.0 - ROOT) / 120.0),
    (5.0 / 12.0, 5.0 / 12.0, 1.0 / 12.0),
)
"""Lobatto IIIA: weights of the rates at the three points in the increments up to them. The rate at
0 is left out: the quantities that are integrated by these weights are zero there."""

MIN_ALIGNMENT = 0.1
"""Least |R · Δx| over the sum of the absolute products. Below it the step does not move along R."""


def extrapolate_remainder(work, clock, step, known):
    """Guess R by extrapolation of the last step's, if ``known``; otherwise start from zero."""
    staged, remainder = clock.stages_step, work.remainder
    scale = begin = 0.0
    if known and staged > 0.0:
        scale, begin = step / staged, (clock.time - clock.stages_time) / staged
    # Shift the second and third coefficients to the new start, take over the first, and scale all
    # to the size of the new step.
    for body in range(work.place.shape[1]):
        for axis in range(3):
            third = remainder[MOTION, 3, body, axis]
            second = remainder[MOTION, 2, body, axis] + 3.0 * begin * third
            remainder[MOTION, 1, body, axis] *= scale
            remainder[MOTION, 2, body, axis] = second * scale * scale
            remainder[MOTION, 3, body, axis] = third * scale * scale * scale


def write_changes(work, stage, step, fraction):
    """Replace the forces at a point, which are no longer needed, by the changes of R there: R by
    these forces, less R as it is."""
    linear = work.linear
    for body in range(work.place.shape[1]):
        for i in range(3):
            change = work.force[stage, body, i] - work.force[NOW, body, i]
            for other in range(work.place.shape[1]):
                for j in range(3):
                    # Minus the linear part with its sign: K and D are minus the derivatives.
                    moved = work.place[stage, other, j] - work.place[NOW, other, j]
                    faster = work.velocity[stage, other, j] - work.velocity[NOW, other, j]
                    change += linear[STIFFNESS, body, other, j, i] * moved
                    change += linear[DAMPING, body, other, j, i] * step * faster
            work.force[stage, body, i] = change - remainder_at(work, fraction, body, i)


def effect_of_change(scene, work, step, stage, goal):
    """Return the largest effect of the changes of R at one of the points, scaled to the goal [m].

    The forces at the points hold these changes. They displace bodies, now and later, and change
    overlaps.
    """
    largest = 0.0
    one, two, three = MATRIX[stage]
    for body in range(work.place.shape[1]):
        memory = step + work.errors[body].velocity_lifetime
        for axis in range(3):
            mean = one * work.force[FIRST_STAGE, body, axis]
            mean += two * work.force[FIRST_STAGE + 1, body, axis]
            mean += three * work.force[FIRST_STAGE + 2, body, axis]
            speed = scene.bodies[body].free * step / inertia(scene, body, axis) * mean
            if not abs(speed) < math.inf:
                return math.inf
            work.velocity[CHANGE, body, axis] = speed
            largest = max(largest, lever(scene, body, axis) * memory * abs(speed))
    return max(largest, change_of_contacts(scene, work, step, stage, goal))


def add_cubic_to_remainder(work, body, axis, one, two, three):
    """Add to R the cubic that is 0 at 0 and has three given values at the points."""
    # Divided differences of value/θ, which is a parabola; then its coefficients.
    by_one, by_two = one / NODES[0], two / NODES[1]
    first = (by_two - by_one) / (NODES[1] - NODES[0])
    second = (three - by_two) / (1.0 - NODES[1])
    third = (second - first) / (1.0 - NODES[0])
    square = first - third * (NODES[0] + NODES[1])
    linear = by_one - NODES[0] * (square + NODES[0] * third)
    remainder = work.remainder
    remainder[MOTION, 1, body, axis] += linear
    remainder[MOTION, 2, body, axis] += square
    remainder[MOTION, 3, body, axis] += third


def remainder_at(work, fraction, body, axis):
    # Horner's scheme.
    r, which = work.remainder, MOTION
    cubic = r[which, 2, body, axis] + fraction * r[which, 3, body, axis]
    return fraction * (r[which, 1, body, axis] + fraction * cubic)


@apart
def evaluate_points(scene, work, time, step):
    """Compute the forces at the three points."""
    for stage in range(3):
        locate_state(scene, work, FIRST_STAGE + stage)
    update_stage_slips(scene, work, step, 0, MATRIX)
    for stage in range(3):
        sum_forces(scene, work, time + NODES[stage] * step, FIRST_STAGE + stage)


def iterate_once(scene, work, time, terms, step, goal):
    """Correct R by the motion that it causes; return the effect of the correction [m]."""
    # Motion and forces at the three points.
    for stage in range(3):
        evaluate_all(work, MOTION, NOW, terms, step, NODES[stage], FIRST_STAGE + stage)
    evaluate_points(scene, work, time, step)
    largest = 0.0
    for stage in range(3):
        write_changes(work, FIRST_STAGE + stage, step, NODES[stage])
    # Measure the change, then add it to R.
    for stage in range(3):
        largest = max(largest, effect_of_change(scene, work, step, stage, goal))
    for body in range(work.place.shape[1]):
        for axis in range(3):
            add_cubic_to_remainder(
                work, body, axis, work.force[FIRST_STAGE, body, axis],
                work.force[FIRST_STAGE + 1, body, axis],
                work.force[FIRST_STAGE + 2, body, axis],
            )  # fmt: skip
    return largest


def finish_step(scene, work, terms, step):
    """Write the end of the step to NEW, with tangential displacements; store its start in START."""
    copy_motion(work, NOW, START)
    last = FIRST_STAGE + 2
    evaluate_all(work, MOTION, NOW, terms, step, 1.0, last)
    locate_state(scene, work, last)
    update_stage_slips(scene, work, step, 2, MATRIX)
    adopt_stage(work, last)


def may_be_series(scene, work):
    """Return True if steps of these bodies can be series: few bodies, and inertia."""
    return work.poses.shape[0] <= MOST_IN_SERIES and inertia(scene, 0, 0) != 0.0


@apart
def solve_series(scene, work, clock, step, known):
    """Solve a step as a series; return its number of terms, or 0 if the step is too long for that.

    ``known`` says that R of the last step can be extrapolated. 0 also where R does not converge.
    """
    allowed = step_tolerance(work, clock)
    # Give up at once where the series cannot end.
    for body in range(work.place.shape[1]):
        for axis in range(3):
            mass = max(inertia(scene, body, axis), TINY)
            spring = abs(work.jacobian[STIFFNESS, body, axis, axis])
            damping = abs(work.jacobian[DAMPING, body, axis, axis])
            if step * (step * spring + damping) > MAX_STIFFNESS * mass:
                return 0
    # First guess: the motion by the extrapolated R.
    extrapolate_remainder(work, clock, step, known)
    predicted, before = expected_rate(clock, step), math.inf
    write_first_terms(scene, work, step)
    clock.series_norm = phase_bound(work)
    terms = expand(work, clock, step, allowed)
    if terms > 0:
        # From here on the stages of Radau are overwritten.
        clock.stages_step = 0.0
    # If these do not converge, the step is left to Radau IIA.
    for _ in range(MAX_ITERATIONS):
        if terms == 0:
            return 0
        # As in Newton's method of Radau: the remaining error is about change · rate/(1 − rate).
        change = iterate_once(scene, work, clock.time, terms, step, ITERATION_TOLERANCE * allowed)
        goal = max(
            ITERATION_TOLERANCE * allowed, rounding_error(scene, work, FIRST_STAGE + 2, step)
        )
        rate = predicted if before == math.inf else change / before
        if not (change < math.inf and rate < 1.0):
            break
        terms = expand(work, clock, step, allowed)
        if terms > 0 and change * rate <= goal * (1.0 - rate):
            finish_step(scene, work, terms, step)
            clock.stages_step, clock.stages_time = step, clock.time
            work.tally.series_step = step
            clock.convergence_rate = 0.0 if before == math.inf else rate
            if before < math.inf:
                clock.second_iteration_rate, clock.second_iteration_step = rate, step
            return terms
        before = change
    clock.second_iteration_rate = 0.0
    return 0


def write_estimate(work, step, goal):
    """Write the effect of leaving out the second Lobatto point to STEP_ERROR: the embedded
    estimate, to ``goal`` [m]."""
    remainder = work.remainder
    for body in range(work.place.shape[1]):
        for axis in range(3):
            # Cubic minus parabola without that point: r₃ θ (θ − c₁)(θ − 1).
            cubic = remainder[MOTION, 3, body, axis]
            remainder[CHANGED, 1, body, axis] = NODES[0] * cubic
            remainder[CHANGED, 2, body, axis] = -(1.0 + NODES[0]) * cubic
            remainder[CHANGED, 3, body, axis] = cubic
            # It begins with term 3.
            for k in range(3):
                work.series[CHANGED, k, body, axis] = 0.0
            work.place[STEP_ERROR, body, axis] = work.velocity[STEP_ERROR, body, axis] = 0.0
    terms, _, _, _ = write_terms(work, CHANGED, 1, step, goal)
    evaluate_all(work, CHANGED, STEP_ERROR, terms, step, 1.0, STEP_ERROR)


def add_last_term(work, step):
    """Add the last term of the motion to its error, as a bound of the truncated terms."""
    last = work.tally.series_terms - 1
    for body in range(work.place.shape[1]):
        for axis in range(3):
            term = work.series[MOTION, last, body, axis]
            work.place[STEP_ERROR, body, axis] += term
            work.velocity[STEP_ERROR, body, axis] += last / step * term


@apart
def estimate_series_error(work, clock, step):
    """Estimate the error of the step, to STEP_ERROR."""
    write_estimate(work, step, TERM_TOLERANCE * step_tolerance(work, clock))
    add_last_term(work, step)


def nothing_swings(clock):
    """Return True if the step is so short that nothing oscillates in it."""
    return clock.series_norm <= RESOLVED_PHASE


def error_ratios_along_path(work, fraction):
    """Return the propagated error over the path, both projected on R, at start and end of the step.

    (0, 0) where the step does not move along R.
    """
    start = end = along = every = 0.0
    for body in range(work.place.shape[1]):
        for axis in range(3):
            # Projections of path and errors on the remainder at the end of the step.
            force = remainder_at(work, 1.0, body, axis)
            path = force * (work.place[NOW, body, axis] - work.place[START, body, axis])
            along, every = along + path, every + abs(path)
            start += force * work.place[PROPAGATED, body, axis]
            end += force * work.place[CHANGE, body, axis]
    if abs(along) <= MIN_ALIGNMENT * every:
        return 0.0, 0.0
    return start * fraction / along, end * fraction / along


def remainder_displaces(work, goal):
    """Return True if R displaces any outline by more than ``goal`` [m] in the step."""
    remainder, weights = work.remainder, work.weights
    for body in range(work.place.shape[1]):
        for axis in range(3):
            size = abs(remainder[MOTION, 1, body, axis]) + abs(remainder[MOTION, 2, body, axis])
            size += abs(remainder[MOTION, 3, body, axis])
            if size * weights[MOVED, body, axis] * weights[LEVER, body, axis] > goal:
                return True
    return False


def write_error_terms(work, step, start, end):
    """Write the first terms of the propagated error, and its source terms.

    The source is FORCING, plus the change of R: an error along the path shifts the fraction θ at
    which a body meets a force by δθ = start + (end − start) θ, and R by R'(θ) δθ.
    """
    series, remainder = work.series, work.remainder
    growth = end - start
    for body in range(work.place.shape[1]):
        for axis in range(3):
            series[CHANGED, 0, body, axis] = work.place[PROPAGATED, body, axis]
            series[CHANGED, 1, body, axis] = step * work.velocity[PROPAGATED, body, axis]
            one = remainder[MOTION, 1, body, axis]
            two = 2.0 * remainder[MOTION, 2, body, axis]
            three = 3.0 * remainder[MOTION, 3, body, axis]
            # Product of R'(θ) and δθ, by powers of θ.
            forcing = work.velocity[FORCING, body, axis]
            remainder[CHANGED, 0, body, axis] = forcing + start * one
            remainder[CHANGED, 1, body, axis] = start * two + growth * one
            remainder[CHANGED, 2, body, axis] = start * three + growth * two
            remainder[CHANGED, 3, body, axis] = growth * three


@apart
def propagate_with_series(work, clock, step, fraction):
    """Propagate the error over a fraction of a step that is a series, to CHANGE.

    The linearised motion propagates an error like any small change of the start. As bodies
    approach, their attraction steepens within a step, and an error of the arrival time grows like
    the speed. So R is included as far as the error lies along the path.
    """
    start, end, goal = 0.0, 0.0, TERM_TOLERANCE * step_tolerance(work, clock)
    # δθ at the end depends on the result: two more iterations.
    for _ in range(3):
        write_error_terms(work, step, start, start + (end - start) / fraction)
        terms, _, _, _ = write_terms(work, CHANGED, 0, step, goal)
        evaluate_all(work, CHANGED, PROPAGATED, terms, step, fraction, CHANGE)
        # What displaces nothing does not change an error either, as in free motion.
        if not nothing_swings(clock) or not remainder_displaces(work, goal):
            return
        start, end = error_ratios_along_path(work, fraction)
        if start == 0.0 and end == 0.0:
            return
