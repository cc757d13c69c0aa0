"""A step of exponential collocation: forces are what they are at Lobatto's points.

The motion is the power series of series.py. Its R, by which forces differ from those linearised at
the start, is the cubic that is 0 there and right at the three points behind; it is found by
iteration, as R changes little with what it does to the motion. Of order 6 where R is smooth, and
exact for linear forces, however often they swing in the step (Hochbruck & Ostermann, Acta Numerica
19 (2010), section 2.3).
"""

import math

from flocsim.compiler.linker import apart
from flocsim.integrators.exponential.series import (
    STIFFEST,
    amend,
    begin_change,
    expand,
    write_at,
    write_change,
)
from flocsim.integrators.radau.stages import (
    change_of_forces,
    expected_pace,
    locate_state,
    slip_stages,
)
from flocsim.integrators.radau.tableau import EIGENVALUES, ESTIMATE, REAL
from flocsim.integrators.radau.tableau import NODES as RADAU
from flocsim.integrators.rhs.blocks import lower_block, upper_block
from flocsim.integrators.rhs.error import (
    largest_error,
    rounding_error,
    step_tolerance,
)
from flocsim.integrators.rhs.forces import adopt_stage, save_start, sum_forces
from flocsim.integrators.rhs.views import inertia, lever
from flocsim.state.work import (
    CHANGE,
    CHANGED,
    DAMPING,
    FIRST_STAGE,
    FORCING,
    MOTION,
    NOW,
    PROPAGATED,
    START,
    STEP_ERROR,
    STIFFNESS,
)

ROOT = 5.0**0.5

NODES = ((5.0 - ROOT) / 10.0, (5.0 + ROOT) / 10.0, 1.0)
"""Lobatto's points behind 0."""

MATRIX = (
    ((25.0 - ROOT) / 120.0, (25.0 - 13.0 * ROOT) / 120.0, (-1.0 + ROOT) / 120.0),
    ((25.0 + 13.0 * ROOT) / 120.0, (25.0 + ROOT) / 120.0, (-1.0 - ROOT) / 120.0),
    (5.0 / 12.0, 5.0 / 12.0, 1.0 / 12.0),
)
"""Weights of the rates at the three points in the increments up to them, by the cubic through these
and the one at 0 (Lobatto IIIA)."""

MOST_ITERATIONS = 6
"""Iterations before the step is left to Radau IIA."""

ITERATION_SHARE = 1e-2
"""Iterations go on until what is left is below this share of what a step may be wrong by."""

LEAVES, LEAP = 0.5, 2.0
"""Steps become too long for a series only where Radau IIA is likely to be wrong by no more than
so many times what it may be, contacts taking most of that up; and by so many times at once."""

A_SWING = 1.0
"""In a step so long, in terms of the fastest rate, nothing swings, so that it has one way; …"""

LEAST_ALONG = 0.1
"""… it does not go the way of R where less than this share of what bodies do there is left."""

TINY = 1e-300
"""Stands for no inertia."""


def guess_remainder(work, clock, step, known):
    """R as that of the last step goes on, if ``known``; else none."""
    staged, remainder = clock.stages_step, work.remainder
    scale = begin = 0.0
    if known and staged > 0.0:
        scale, begin = step / staged, (clock.time - clock.stages_time) / staged
    for body in range(work.place.shape[1]):
        for axis in range(3):
            third = remainder[MOTION, 3, body, axis]
            second = remainder[MOTION, 2, body, axis] + 3.0 * begin * third
            remainder[MOTION, 1, body, axis] *= scale
            remainder[MOTION, 2, body, axis] = second * scale * scale
            remainder[MOTION, 3, body, axis] = third * scale * scale * scale


def subtract_linear(work, stage, block, body, other):
    """Subtract what a block makes of another body's motion to a point from the force on a body
    there, in CHANGE."""
    jacobian = work.jacobian
    for i in range(3):
        total = work.velocity[CHANGE, body, i]
        for j in range(3):
            moved = work.place[stage, other, j] - work.place[NOW, other, j]
            faster = work.velocity[stage, other, j] - work.velocity[NOW, other, j]
            total += jacobian[STIFFNESS, block, i, j] * moved
            total += jacobian[DAMPING, block, i, j] * faster
        work.velocity[CHANGE, body, i] = total


def write_remainder(work, stage):
    """R at a point, in the columns of velocities of CHANGE."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            force = work.force[stage, body, axis] - work.force[NOW, body, axis]
            work.velocity[CHANGE, body, axis] = force
        subtract_linear(work, stage, body, body, body)
    for pair in range(work.tally.pairs):
        later, earlier = work.pairs[pair].later, work.pairs[pair].earlier
        subtract_linear(work, stage, lower_block(work, pair), later, earlier)
        subtract_linear(work, stage, upper_block(work, pair), earlier, later)


def effect_of(scene, work, step, stage, goal):
    """What the changes of R at the points, in their rates, change at one of them in places, now and
    later, and in overlaps, over what may be wrong of those, in terms of the goal [m]."""
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
    return max(largest, change_of_forces(scene, work, step, stage, goal))


def amend_remainder(work, body, axis, one, two, three):
    """Add to R the cubic that is 0 at 0 and has three values behind it, and keep that."""
    by_one, by_two = one / NODES[0], two / NODES[1]
    first = (by_two - by_one) / (NODES[1] - NODES[0])
    second = (three - by_two) / (1.0 - NODES[1])
    third = (second - first) / (1.0 - NODES[0])
    square = first - third * (NODES[0] + NODES[1])
    linear = by_one - NODES[0] * (square + NODES[0] * third)
    remainder = work.remainder
    remainder[CHANGED, 1, body, axis] = linear
    remainder[CHANGED, 2, body, axis] = square
    remainder[CHANGED, 3, body, axis] = third
    remainder[MOTION, 1, body, axis] += linear
    remainder[MOTION, 2, body, axis] += square
    remainder[MOTION, 3, body, axis] += third


def remainder_at(work, share, body, axis):
    r, which = work.remainder, MOTION
    cubic = r[which, 2, body, axis] + share * r[which, 3, body, axis]
    return share * (r[which, 1, body, axis] + share * cubic)


@apart
def evaluate_points(scene, work, time, step):
    """Forces at the three points."""
    for stage in range(3):
        locate_state(scene, work, FIRST_STAGE + stage)
    slip_stages(scene, work, step, 0, MATRIX)
    for stage in range(3):
        sum_forces(scene, work, time + NODES[stage] * step, FIRST_STAGE + stage)


def iterate(scene, work, time, terms, step, goal):
    """Amend R by the motion that it leads to; what changes by that (see effect_of)."""
    for stage in range(3):
        write_all_at(work, terms, step, NODES[stage], FIRST_STAGE + stage)
    evaluate_points(scene, work, time, step)
    largest = 0.0
    for stage in range(3):
        write_remainder(work, FIRST_STAGE + stage)
        for body in range(work.place.shape[1]):
            for axis in range(3):
                change = work.velocity[CHANGE, body, axis]
                change -= remainder_at(work, NODES[stage], body, axis)
                # The force at the point is not needed any more.
                work.force[FIRST_STAGE + stage, body, axis] = change
    for stage in range(3):
        largest = max(largest, effect_of(scene, work, step, stage, goal))
    for body in range(work.place.shape[1]):
        for axis in range(3):
            amend_remainder(
                work, body, axis, work.force[FIRST_STAGE, body, axis],
                work.force[FIRST_STAGE + 1, body, axis],
                work.force[FIRST_STAGE + 2, body, axis],
            )  # fmt: skip
    return largest


def write_all_at(work, terms, step, share, state):
    write_at(work, NOW, terms, step, share, state, 0, work.place.shape[1])


def finish(scene, work, terms, step):
    """The end of the step, and the tangential displacements there, are NEW; it began at START."""
    save_start(work)
    last = FIRST_STAGE + 2
    write_all_at(work, terms, step, 1.0, last)
    locate_state(scene, work, last)
    slip_stages(scene, work, step, 2, MATRIX)
    adopt_stage(work, last)


@apart
def solve_series(scene, work, clock, step, known):
    """Find the motion of a step as a series; how many terms it has, 0 where the step is too long
    for one, or R does not settle. ``known``: whether that of the last step is there."""
    allowed = step_tolerance(work, clock)
    for body in range(work.place.shape[1]):
        for axis in range(3):
            mass = max(inertia(scene, body, axis), TINY)
            spring = abs(work.jacobian[STIFFNESS, body, axis, axis])
            damping = abs(work.jacobian[DAMPING, body, axis, axis])
            if step * (step * spring + damping) > STIFFEST * mass:
                return 0
    guess_remainder(work, clock, step, known)
    expected, before = expected_pace(clock, step), math.inf
    terms = expand(scene, work, clock, step, allowed)
    if terms > 0:
        clock.stages_step = 0.0
    for _ in range(MOST_ITERATIONS):
        if terms == 0:
            return 0
        change = iterate(scene, work, clock.time, terms, step, ITERATION_SHARE * allowed)
        goal = max(ITERATION_SHARE * allowed, rounding_error(scene, work, FIRST_STAGE + 2, step))
        pace = expected if before == math.inf else change / before
        if not (change < math.inf and pace < 1.0):
            break
        terms = amend(work, terms, step, allowed)
        if terms > 0 and change * pace <= goal * (1.0 - pace):
            finish(scene, work, terms, step)
            clock.stages_step, clock.stages_time = step, clock.time
            clock.series_step = step
            clock.convergence_rate = 0.0 if before == math.inf else pace
            if before < math.inf:
                clock.second_iteration_rate, clock.second_iteration_step = pace, step
            return terms
        before = change
    clock.second_iteration_rate = 0.0
    return 0


def error_of_radau(scene, work, terms, step):
    """What a step of Radau IIA would be wrong by in this motion [m], by its estimate
    (radau/estimate.py) but for what contacts take up of that."""
    series = work.series
    for body in range(work.place.shape[1]):
        for axis in range(3):
            work.place[STEP_ERROR, body, axis] = 0.0
            work.velocity[STEP_ERROR, body, axis] = 0.0
    before, damped = 0.0, step / EIGENVALUES[REAL].real
    one, two = RADAU[0] ** 3, RADAU[1] ** 3
    for k in range(4, terms):
        one, two = one * RADAU[0], two * RADAU[1]
        here = (ESTIMATE[0] * one + ESTIMATE[1] * two + ESTIMATE[2]) / step
        for body in range(work.place.shape[1]):
            for axis in range(3):
                term = damped * series[MOTION, k, body, axis]
                work.place[STEP_ERROR, body, axis] += here * term
                work.velocity[STEP_ERROR, body, axis] += before * k / step * term
        before = here
    return largest_error(scene, work)


def estimate(work, step):
    """What leaving out the second point would change, in STEP_ERROR."""
    remainder = work.remainder
    for body in range(work.place.shape[1]):
        for axis in range(3):
            cubic = remainder[MOTION, 3, body, axis]
            remainder[CHANGED, 0, body, axis] = 0.0
            remainder[CHANGED, 1, body, axis] = NODES[0] * cubic
            remainder[CHANGED, 2, body, axis] = -(1.0 + NODES[0]) * cubic
            remainder[CHANGED, 3, body, axis] = cubic
    begin_change(work)
    write_change(work, 1, step, 1.0, STEP_ERROR)


def add_last_term(work, step):
    """Add the last term of the motion to its error: all that is left out comes to less."""
    last = work.tally.series_terms - 1
    for body in range(work.place.shape[1]):
        for axis in range(3):
            term = work.series[MOTION, last, body, axis]
            work.place[STEP_ERROR, body, axis] += term
            work.velocity[STEP_ERROR, body, axis] += last / step * term


@apart
def judge_series(scene, work, clock, step):
    """Estimate the error of a step, in STEP_ERROR."""
    longer = clock.longest_series / step
    if longer < math.inf:
        error = error_of_radau(scene, work, work.tally.series_terms, step)
        if error * longer**4 <= LEAVES * step_tolerance(work, clock):
            clock.longest_series *= LEAP
    estimate(work, step)
    add_last_term(work, step)


def nothing_swings(clock):
    """Whether the step is so short that nothing swings in it."""
    return clock.series_norm <= A_SWING


def errors_over_ways(work, share):
    """How large the carried error is, at the start of a step and as CHANGE has it at its end, over
    the way from there to here, both along what R is in the end: 0 where the step does not go that
    way."""
    before = after = along = every = 0.0
    for body in range(work.place.shape[1]):
        for axis in range(3):
            force = remainder_at(work, 1.0, body, axis)
            way = force * (work.place[NOW, body, axis] - work.place[START, body, axis])
            along, every = along + way, every + abs(way)
            before += force * work.place[PROPAGATED, body, axis]
            after += force * work.place[CHANGE, body, axis]
    if abs(along) <= LEAST_ALONG * every:
        return 0.0, 0.0
    return before * share / along, after * share / along


def begin_carrying(work, step, before, after):
    """Write the first terms of the carried error, and what pushes it on besides: FORCING, and as
    much as R changes with the way."""
    series, remainder = work.series, work.remainder
    more = after - before
    for body in range(work.place.shape[1]):
        for axis in range(3):
            series[CHANGED, 0, body, axis] = work.place[PROPAGATED, body, axis]
            series[CHANGED, 1, body, axis] = step * work.velocity[PROPAGATED, body, axis]
            one = remainder[MOTION, 1, body, axis]
            two = 2.0 * remainder[MOTION, 2, body, axis]
            three = 3.0 * remainder[MOTION, 3, body, axis]
            forcing = work.velocity[FORCING, body, axis]
            remainder[CHANGED, 0, body, axis] = forcing + before * one
            remainder[CHANGED, 1, body, axis] = before * two + more * one
            remainder[CHANGED, 2, body, axis] = before * three + more * two
            remainder[CHANGED, 3, body, axis] = more * three


@apart
def carry_known(work, clock, step, share):
    """Carry the error over a share of a step that is a series, into CHANGE: as what changes its
    start changes its end, under what forces it besides.

    As bodies come close their attraction gets steeper within a step, and an error of when they do
    grows as their speed does: with R, as far as the error lies on their way.
    """
    begin_carrying(work, step, 0.0, 0.0)
    write_change(work, 0, step, share, CHANGE)
    if nothing_swings(clock):
        for _ in range(2):
            before, after = errors_over_ways(work, share)
            if before == 0.0 and after == 0.0:
                return
            begin_carrying(work, step, before, before + (after - before) / share)
            write_change(work, 0, step, share, CHANGE)
