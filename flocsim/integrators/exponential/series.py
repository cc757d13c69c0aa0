"""Motion as a power series of the fraction θ of a step, under linear forces plus a cubic remainder.

    M ẍ = F − K (x − x₀) − D (ẋ − ẋ₀) + R(θ),   R = r₁ θ + r₂ θ² + r₃ θ³,   x = x₀ + Σ c_k θ^k,

    c_{k+2} = h²/((k + 1)(k + 2)) M⁻¹ (r_k − K c_k − (k + 1)/h D c_{k+1}),

with r₀ = F and the derivatives D, K of the step's start (DAMPING, STIFFNESS). Terms decrease once k
exceeds h times the fastest rate. No system is solved. The same recurrence gives the effect of a
small change of the motion, or of R.
"""

import math

from flocsim.integrators.rhs.blocks import lower_block, upper_block
from flocsim.integrators.rhs.views import inertia, lever
from flocsim.state.work import CHANGED, DAMPING, LEVER, MOTION, MOVED, NOW, STIFFNESS, TERMS

TERM_TOLERANCE = 1e-3
"""The series of a motion ends after two consecutive terms below this fraction of the step's
tolerance."""

ERROR_TERM_TOLERANCE = 0.01
"""The series of an error, which is needed to a few digits only, ends after two consecutive terms
below this fraction of its largest term."""

MIN_TERMS = 6
"""Fewest terms of a series: those that contain R."""

TINY = 1e-200
"""Keeps a quotient finite."""

MAX_STIFFNESS = 150.0
"""h² K/M + h D/M of a coordinate above which the series does not end within TERMS terms. It is
about 12²: at |λ| h = 12 rounding has grown to 1e-16 e¹². More terms for longer steps saved no
steps."""


def scale_block(work, block, body, other, step):
    """Write the derivatives of a body's acceleration by another body's motion, scaled by the
    step."""
    for i in range(3):
        # c_{k+2} then follows from c_k and c_{k+1} by products alone.
        mobility = work.weights[MOVED, body, i]
        for j in range(3):
            stiffness = work.jacobian[STIFFNESS, block, i, j]
            damping = work.jacobian[DAMPING, block, i, j] / step
            work.linear[STIFFNESS, body, other, i, j] = mobility * stiffness
            work.linear[DAMPING, body, other, i, j] = mobility * damping


def scale_derivatives(scene, work, step):
    """Write h²/M, the levers, and all derivatives scaled by the step."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            mobility = scene.bodies[body].free * step * step / inertia(scene, body, axis)
            work.weights[MOVED, body, axis] = mobility
            work.weights[LEVER, body, axis] = lever(scene, body, axis)
        scale_block(work, body, body, body, step)
    for pair in range(work.tally.pairs):
        later, earlier = work.pairs[pair].later, work.pairs[pair].earlier
        scale_block(work, lower_block(work, pair), later, earlier, step)
        scale_block(work, upper_block(work, pair), earlier, later, step)


def write_term(work, which, k):
    """Write term k + 2 of a series by the recurrence; return the largest displacement in it [m]."""
    series, linear, weights, largest = work.series, work.linear, work.weights, 0.0
    after, factor = k + 1.0, 1.0 / ((k + 1.0) * (k + 2.0))
    for body in range(work.place.shape[1]):
        first = second = third = 0.0
        if k < 4:
            # r_k for k ≤ 3. The series of the motion starts here from k = 1: its term 2 holds the
            # forces at the start.
            first = work.remainder[which, k, body, 0] * weights[MOVED, body, 0]
            second = work.remainder[which, k, body, 1] * weights[MOVED, body, 1]
            third = work.remainder[which, k, body, 2] * weights[MOVED, body, 2]
        for other in range(work.place.shape[1]):
            for j in range(3):
                # Subtract K c_k and (k + 1)/h D c_{k+1} of all bodies.
                position = series[which, k, other, j]
                speed = after * series[which, k + 1, other, j]
                first -= linear[STIFFNESS, body, other, 0, j] * position
                first -= linear[DAMPING, body, other, 0, j] * speed
                second -= linear[STIFFNESS, body, other, 1, j] * position
                second -= linear[DAMPING, body, other, 1, j] * speed
                third -= linear[STIFFNESS, body, other, 2, j] * position
                third -= linear[DAMPING, body, other, 2, j] * speed
        first, second, third = factor * first, factor * second, factor * third
        series[which, k + 2, body, 0] = first
        series[which, k + 2, body, 1] = second
        series[which, k + 2, body, 2] = third
        turning = weights[LEVER, body, 2] * abs(third)
        largest = max(largest, abs(first), abs(second), turning)
    return largest


def longest_persistence(work):
    """Return the longest time for which a velocity error persists in any body [s]."""
    longest = 0.0
    for body in range(work.place.shape[1]):
        longest = max(longest, work.errors[body].velocity_lifetime)
    return longest


def write_first_terms(scene, work, step):
    """Write terms 0 to 2 of the motion: zero, velocity and acceleration."""
    scale_derivatives(scene, work, step)
    series = work.series
    for body in range(work.place.shape[1]):
        for axis in range(3):
            # The series holds displacements from the start of the step.
            series[MOTION, 0, body, axis] = 0.0
            speed = work.velocity[NOW, body, axis]
            series[MOTION, 1, body, axis] = step * speed
            force = 0.5 * work.force[NOW, body, axis]
            series[MOTION, 2, body, axis] = work.weights[MOVED, body, axis] * force


def longest_step_ratio(last, late, early, goal):
    """Return the factor by which the step may grow until its series needs all TERMS terms.

    Each term is h²λ²/(k (k − 1)) times the one two before. ``late`` is the larger of the last two
    terms and ``early`` that of the two before; ``last`` is the index of the last term.
    """
    if not (late > 0.0 and 0.0 < early < math.inf):
        return math.inf
    # Extrapolate to the last term there is room for; it scales as h^k.
    squared, term, k = late / early * last * (last - 1.0), late, last
    while k < TERMS - 2:
        term *= squared / ((k + 1.0) * (k + 2.0))
        k += 2
    return (goal / max(term, TINY * goal)) ** (1.0 / k)


def phase_bound(work):
    """Return a bound of the phase of the fastest vibration over a step, h ω [rad].

    By the largest row sum of h² M⁻¹ K, with rotations measured by the motion of outlines.
    """
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
    """Write the series of the motion; return its number of terms, or 0 if it does not end.

    Terms matter above TERM_TOLERANCE of ``goal`` [m].
    """
    write_first_terms(scene, work, step)
    goal, small_terms, persistence = TERM_TOLERANCE * goal, 0, longest_persistence(work) / step
    one, two, three, size = math.inf, math.inf, math.inf, math.inf
    for k in range(1, TERMS - 2):
        three, two, one = two, one, size
        # A term displaces a body now, and later by its velocity (k + 2)/h for as long as that
        # persists.
        size = write_term(work, MOTION, k) * (1.0 + persistence * (k + 2.0))
        small_terms = small_terms + 1 if size <= goal else 0
        # Two terms in a row: even and odd ones are its cosine and sine, one of which may vanish.
        if small_terms >= 2 and k + 3 >= MIN_TERMS:
            growth = longest_step_ratio(k + 2, max(size, one), max(two, three), goal)
            clock.longest_series, clock.series_norm = step * growth, phase_bound(work)
            return k + 3
        if not size < math.inf:
            break
    clock.longest_series = math.inf
    return 0


def clear_change(work):
    """Write the first terms of a change of the motion that starts from zero."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            for k in range(3):
                work.series[CHANGED, k, body, axis] = 0.0


def add_change(work, terms, step, goal):
    """Add the series that the change of R causes to the motion; return the number of terms, or 0.

    ``terms`` is the number before; 0 says that the series of the change does not end.
    """
    series, goal, small_terms = work.series, TERM_TOLERANCE * goal, 0
    persistence = longest_persistence(work) / step
    clear_change(work)
    for k in range(1, TERMS - 2):
        size = write_term(work, CHANGED, k) * (1.0 + persistence * (k + 2.0))
        small_terms = small_terms + 1 if size <= goal else 0
        for body in range(work.place.shape[1]):
            for axis in range(3):
                before = series[MOTION, k + 2, body, axis] if k + 2 < terms else 0.0
                change = series[CHANGED, k + 2, body, axis]
                series[MOTION, k + 2, body, axis] = before + change
        if small_terms >= 2 and k + 3 >= MIN_TERMS:
            return max(terms, k + 3)
        if not size < math.inf:
            break
    return 0


def evaluate_change(work, first, step, fraction, kind):
    """Write a change of positions and velocities at a fraction of the step into the state ``kind``.

    Terms before ``first`` + 2 have been written; the others follow here, as many as are needed.
    """
    series = work.series
    # Terms 0 and 1: initial change of position and velocity.
    for body in range(work.place.shape[1]):
        for axis in range(3):
            work.place[kind, body, axis] = series[CHANGED, 0, body, axis]
            work.place[kind, body, axis] += fraction * series[CHANGED, 1, body, axis]
            work.velocity[kind, body, axis] = series[CHANGED, 1, body, axis] / step
    largest, small_terms, power = 0.0, 0, fraction**first
    for k in range(first, TERMS - 2):
        # In velocities, which outlast places.
        size = (k + 2.0) * write_term(work, CHANGED, k)
        rate, power = (k + 2.0) * power * fraction / step, power * fraction
        for body in range(work.place.shape[1]):
            for axis in range(3):
                term = series[CHANGED, k + 2, body, axis]
                work.place[kind, body, axis] += power * fraction * term
                work.velocity[kind, body, axis] += rate * term
        largest = max(largest, size)
        small_terms = small_terms + 1 if size <= ERROR_TERM_TOLERANCE * largest else 0
        if (small_terms >= 2 and k + 3 >= MIN_TERMS) or not size < math.inf:
            break


def rescale(work, terms, fraction):
    """Rescale the series, and everything it follows from, to a step shortened to a fraction."""
    power = 1.0
    # Coefficients of θ^k scale as the k-th power.
    for k in range(1, terms):
        power *= fraction
        for body in range(work.place.shape[1]):
            for axis in range(3):
                work.series[MOTION, k, body, axis] *= power
    for body in range(work.place.shape[1]):
        for axis in range(3):
            power = 1.0
            for k in range(1, 4):
                power *= fraction
                work.remainder[MOTION, k, body, axis] *= power
            # h² M⁻¹ K scales as h², and h M⁻¹ D as h.
            work.weights[MOVED, body, axis] *= fraction * fraction
            for other in range(work.place.shape[1]):
                for j in range(3):
                    work.linear[STIFFNESS, body, other, axis, j] *= fraction * fraction
                    work.linear[DAMPING, body, other, axis, j] *= fraction


def evaluate_at(work, start, terms, step, fraction, state, first, end):
    """Write the motion of bodies ``first`` up to but excluding ``end`` at a fraction of the step.

    The series is added to the motion in state ``start`` and written to ``state``.
    """
    series = work.series
    for body in range(first, end):
        for axis in range(3):
            work.place[state, body, axis] = work.velocity[state, body, axis] = 0.0
    power = fraction
    # Sum the terms in order of k, for positions and velocities.
    for k in range(2, terms):
        rate = k * power / step
        power *= fraction
        for body in range(first, end):
            for axis in range(3):
                term = series[MOTION, k, body, axis]
                work.place[state, body, axis] += power * term
                work.velocity[state, body, axis] += rate * term
    for body in range(first, end):
        for axis in range(3):
            # In differences, a coordinate at rest stays exactly where it is.
            work.place[state, body, axis] += fraction * series[MOTION, 1, body, axis]
            work.place[state, body, axis] += work.place[start, body, axis]
            work.velocity[state, body, axis] += work.velocity[start, body, axis]
