"""Motion as a power series of the share θ of a step, under forces that are linear but for a cubic.

    M ẍ = F − K (x − x₀) − D (ẋ − ẋ₀) + R(θ),   R = r₁ θ + r₂ θ² + r₃ θ³,   x = x₀ + Σ c_k θ^k,

    c_{k+2} = h²/((k + 1)(k + 2)) M⁻¹ (r_k − K c_k − (k + 1)/h D c_{k+1}),

with the derivatives of the step's start (D, K: DAMPING and STIFFNESS). Its terms fall off once k is
above h times the fastest rate. Small changes of the motion, and of R, follow from the same terms.
"""

import math

from flocsim.integrators.rhs.blocks import lower_block, upper_block
from flocsim.integrators.rhs.views import inertia, lever
from flocsim.state.work import CHANGED, DAMPING, LEVER, MOTION, MOVED, NOW, STIFFNESS, TERMS

SHARE = 1e-3
"""The series of a motion ends where two terms in a row are below this share of what a step may be
wrong by; …"""

ROUGHLY = 0.01
"""… that of an error, which has to be known roughly, where they are below this share of the largest
one."""

LEAST_TERMS = 6
"""A series has so many at least, R being in them."""

TINY = 1e-200
"""Keeps a quotient finite."""

STIFFEST = 150.0
"""h² K/M + h D/M of a coordinate from which on it does not end."""


def scale_block(work, block, body, other, step):
    """Write by how much a step's acceleration of a body changes with another one's place and
    velocity, both in a step."""
    for i in range(3):
        share = work.weights[MOVED, body, i]
        for j in range(3):
            stiffness = work.jacobian[STIFFNESS, block, i, j]
            damping = work.jacobian[DAMPING, block, i, j] / step
            work.linear[STIFFNESS, body, other, i, j] = share * stiffness
            work.linear[DAMPING, body, other, i, j] = share * damping


def scale_derivatives(scene, work, step):
    """The same of all, and how far a force moves a body in the square of the step."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            share = scene.bodies[body].free * step * step / inertia(scene, body, axis)
            work.weights[MOVED, body, axis] = share
            work.weights[LEVER, body, axis] = lever(scene, body, axis)
        scale_block(work, body, body, body, step)
    for pair in range(work.tally.pairs):
        later, earlier = work.pairs[pair].later, work.pairs[pair].earlier
        scale_block(work, lower_block(work, pair), later, earlier, step)
        scale_block(work, upper_block(work, pair), earlier, later, step)


def write_term(work, which, k):
    """Write term k + 2 of a series; how far it displaces a body [m]."""
    series, linear, weights, largest = work.series, work.linear, work.weights, 0.0
    after, factor = k + 1.0, 1.0 / ((k + 1.0) * (k + 2.0))
    for body in range(work.place.shape[1]):
        first = second = third = 0.0
        if k < 4:
            first = work.remainder[which, k, body, 0] * weights[MOVED, body, 0]
            second = work.remainder[which, k, body, 1] * weights[MOVED, body, 1]
            third = work.remainder[which, k, body, 2] * weights[MOVED, body, 2]
        for other in range(work.place.shape[1]):
            for j in range(3):
                place = series[which, k, other, j]
                speed = after * series[which, k + 1, other, j]
                first -= linear[STIFFNESS, body, other, 0, j] * place
                first -= linear[DAMPING, body, other, 0, j] * speed
                second -= linear[STIFFNESS, body, other, 1, j] * place
                second -= linear[DAMPING, body, other, 1, j] * speed
                third -= linear[STIFFNESS, body, other, 2, j] * place
                third -= linear[DAMPING, body, other, 2, j] * speed
        first, second, third = factor * first, factor * second, factor * third
        series[which, k + 2, body, 0] = first
        series[which, k + 2, body, 1] = second
        series[which, k + 2, body, 2] = third
        turning = weights[LEVER, body, 2] * abs(third)
        largest = max(largest, abs(first), abs(second), turning)
    return largest


def longest_memory(work):
    """How long a body remembers a velocity at most [s]."""
    longest = 0.0
    for body in range(work.place.shape[1]):
        longest = max(longest, work.errors[body].velocity_lifetime)
    return longest


def begin(scene, work, step):
    """Write the first terms: no displacement, the velocity, the acceleration."""
    scale_derivatives(scene, work, step)
    series = work.series
    for body in range(work.place.shape[1]):
        for axis in range(3):
            series[MOTION, 0, body, axis] = 0.0
            speed = work.velocity[NOW, body, axis]
            series[MOTION, 1, body, axis] = step * speed
            force = 0.5 * work.force[NOW, body, axis]
            series[MOTION, 2, body, axis] = work.weights[MOVED, body, axis] * force


def reach(last, late, early, goal):
    """By how much a step may be longer so that its series still comes to an end, every term being
    h²λ²/(k (k − 1)) times the one two before; given the larger ones of the last two terms, and of
    those before."""
    if not (late > 0.0 and 0.0 < early < math.inf):
        return math.inf
    squared, term, k = late / early * last * (last - 1.0), late, last
    while k < TERMS - 2:
        term *= squared / ((k + 1.0) * (k + 2.0))
        k += 2
    return (goal / max(term, TINY * goal)) ** (1.0 / k)


def turns_of(work):
    """A bound of how far the fastest vibration turns in a step, h ω: by the rows of K, in metres of
    outlines."""
    largest, weights = 0.0, work.weights
    for body in range(work.place.shape[1]):
        for axis in range(3):
            total = 0.0
            for other in range(work.place.shape[1]):
                for j in range(3):
                    size = abs(work.linear[STIFFNESS, body, other, axis, j])
                    total += size / weights[LEVER, other, j]
            largest = max(largest, total * weights[LEVER, body, axis])
    return math.sqrt(largest)


def expand(scene, work, clock, step, goal):
    """Write the series of the motion; how many terms it has, 0 where it does not come to an end.
    Terms count from SHARE of the goal [m] on."""
    begin(scene, work, step)
    goal, small, later = SHARE * goal, 0, longest_memory(work) / step
    one, two, three, size = math.inf, math.inf, math.inf, math.inf
    for k in range(1, TERMS - 2):
        three, two, one = two, one, size
        size = write_term(work, MOTION, k) * (1.0 + later * (k + 2.0))
        small = small + 1 if size <= goal else 0
        if small >= 2 and k + 3 >= LEAST_TERMS:
            longer = reach(k + 2, max(size, one), max(two, three), goal)
            clock.longest_series, clock.series_norm = step * longer, turns_of(work)
            return k + 3
        if not size < math.inf:
            break
    clock.longest_series = math.inf
    return 0


def begin_change(work):
    """Write the first terms of a change of the motion that begins with none."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            for k in range(3):
                work.series[CHANGED, k, body, axis] = 0.0


def amend(work, terms, step, goal):
    """Add to the motion, which has so many terms, the series that the change of R leads to; how
    many it has then, 0 where that does not come to an end."""
    series, goal, small = work.series, SHARE * goal, 0
    later = longest_memory(work) / step
    begin_change(work)
    for k in range(1, TERMS - 2):
        size = write_term(work, CHANGED, k) * (1.0 + later * (k + 2.0))
        small = small + 1 if size <= goal else 0
        for body in range(work.place.shape[1]):
            for axis in range(3):
                before = series[MOTION, k + 2, body, axis] if k + 2 < terms else 0.0
                change = series[CHANGED, k + 2, body, axis]
                series[MOTION, k + 2, body, axis] = before + change
        if small >= 2 and k + 3 >= LEAST_TERMS:
            return max(terms, k + 3)
        if not size < math.inf:
            break
    return 0


def write_change(work, first, step, share, kind):
    """Write a change of places and velocities at a share of the step into a row of the motion, from
    the term ``first`` on, those before being written."""
    series = work.series
    for body in range(work.place.shape[1]):
        for axis in range(3):
            work.place[kind, body, axis] = series[CHANGED, 0, body, axis]
            work.place[kind, body, axis] += share * series[CHANGED, 1, body, axis]
            work.velocity[kind, body, axis] = series[CHANGED, 1, body, axis] / step
    largest, small, power = 0.0, 0, share**first
    for k in range(first, TERMS - 2):
        # In velocities, which outlast places.
        size = (k + 2.0) * write_term(work, CHANGED, k)
        rate, power = (k + 2.0) * power * share / step, power * share
        for body in range(work.place.shape[1]):
            for axis in range(3):
                term = series[CHANGED, k + 2, body, axis]
                work.place[kind, body, axis] += power * share * term
                work.velocity[kind, body, axis] += rate * term
        largest = max(largest, size)
        small = small + 1 if size <= ROUGHLY * largest else 0
        if (small >= 2 and k + 3 >= LEAST_TERMS) or not size < math.inf:
            break


def shorten(work, terms, share):
    """Make the series, and what it follows from, those of a step that is so much shorter."""
    power = 1.0
    for k in range(1, terms):
        power *= share
        for body in range(work.place.shape[1]):
            for axis in range(3):
                work.series[MOTION, k, body, axis] *= power
    for body in range(work.place.shape[1]):
        for axis in range(3):
            power = 1.0
            for k in range(1, 4):
                power *= share
                work.remainder[MOTION, k, body, axis] *= power
            work.weights[MOVED, body, axis] *= share * share
            for other in range(work.place.shape[1]):
                for j in range(3):
                    work.linear[STIFFNESS, body, other, axis, j] *= share * share
                    work.linear[DAMPING, body, other, axis, j] *= share


def write_at(work, start, terms, step, share, state, first, end):
    """Write the motion of the bodies from the first one to before the end at a share of the step
    from a state into another one."""
    series = work.series
    for body in range(first, end):
        for axis in range(3):
            work.place[state, body, axis] = work.velocity[state, body, axis] = 0.0
    power = share
    for k in range(2, terms):
        rate = k * power / step
        power *= share
        for body in range(first, end):
            for axis in range(3):
                term = series[MOTION, k, body, axis]
                work.place[state, body, axis] += power * term
                work.velocity[state, body, axis] += rate * term
    for body in range(first, end):
        for axis in range(3):
            # In changes, so that what does not move stays just where it is.
            work.place[state, body, axis] += share * series[MOTION, 1, body, axis]
            work.place[state, body, axis] += work.place[start, body, axis]
            work.velocity[state, body, axis] += work.velocity[start, body, axis]
