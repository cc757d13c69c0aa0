"""Motion as a power series of the fraction θ of a step, under linear forces plus a cubic remainder.

    M ẍ = F − K (x − x₀) − D (ẋ − ẋ₀) + R(θ),   R = r₁ θ + r₂ θ² + r₃ θ³,   x = x₀ + Σ c_k θ^k,

    c_{k+2} = h²/((k + 1)(k + 2)) M⁻¹ (r_k − K c_k − (k + 1)/h D c_{k+1}),

with r₀ = F and the derivatives D, K of the step's start (DAMPING, STIFFNESS). Terms decrease once k
exceeds h times the fastest rate. No system is solved. The same recurrence gives the effect of a
small change of the motion, or of R.
"""

import math

from flocsim.compiler.linker import loops_apart
from flocsim.constants import TINY
from flocsim.integrators.rhs.blocks import lower_block, upper_block
from flocsim.integrators.rhs.views import inertia, lever
from flocsim.state.work import DAMPING, LEVER, MOTION, MOVED, NOW, STIFFNESS, TERMS

TERM_TOLERANCE = 1e-3
"""A series ends after two consecutive terms below this fraction of the step's tolerance."""

MIN_TERMS = 6
"""Fewest terms of a series: those that contain R."""

MAX_STIFFNESS = 150.0
"""h² K/M + h D/M of a coordinate above which the series does not end within TERMS terms. It is
about 12²: at |λ| h = 12 rounding has grown to 1e-16 e¹². More terms for longer steps saved no
steps."""


RADAU_TERM = 5.0
"""Steps may become too long for a series only if the largest of its terms from the fourth on would
be at most this multiple of the tolerance: Radau IIA, whose estimate of a term is about a tenth of
it, then has half the tolerance as its error."""

LONGEST_SERIES_GROWTH = 2.0
"""In that case the limit of the series is raised by this factor at once."""


def store_block(work, block, body, other, step):
    """Store the derivatives of a body's force by another body's motion, those by velocities over
    the step."""
    for i in range(3):
        for j in range(3):
            stiffness = work.jacobian[STIFFNESS, block, i, j]
            work.linear[STIFFNESS, body, other, j, i] = stiffness
            work.linear[DAMPING, body, other, j, i] = work.jacobian[DAMPING, block, i, j] / step


def write_term(work, which, k):
    """Write term k + 2 of a series by the recurrence; return the largest displacement in it [m]."""
    series, linear, weights, largest = work.series, work.linear, work.weights, 0.0
    after, factor = k + 1.0, 1.0 / ((k + 1.0) * (k + 2.0))
    for body in range(work.place.shape[1]):
        # Four numbers at once, as processors can; the fourth is always 0. Drag is summed apart from
        # stiffness: in one sum each product would wait for the one before.
        x = y = angle = unused = 0.0
        if k < 4:
            # r_k for k ≤ 3. The series of the motion starts here from k = 1: its term 2 holds the
            # forces at the start.
            x = work.remainder[which, k, body, 0]
            y = work.remainder[which, k, body, 1]
            angle = work.remainder[which, k, body, 2]
            unused = work.remainder[which, k, body, 3]
        drag_x = drag_y = drag_angle = drag_unused = 0.0
        for other in range(work.place.shape[1]):
            for j in range(3):
                # Subtract K c_k and (k + 1)/h D c_{k+1} of all bodies.
                position = series[which, k, other, j]
                speed = after * series[which, k + 1, other, j]
                x -= linear[STIFFNESS, body, other, j, 0] * position
                y -= linear[STIFFNESS, body, other, j, 1] * position
                angle -= linear[STIFFNESS, body, other, j, 2] * position
                unused -= linear[STIFFNESS, body, other, j, 3] * position
                drag_x += linear[DAMPING, body, other, j, 0] * speed
                drag_y += linear[DAMPING, body, other, j, 1] * speed
                drag_angle += linear[DAMPING, body, other, j, 2] * speed
                drag_unused += linear[DAMPING, body, other, j, 3] * speed
        x = (x - drag_x) * (factor * weights[MOVED, body, 0])
        y = (y - drag_y) * (factor * weights[MOVED, body, 1])
        angle = (angle - drag_angle) * (factor * weights[MOVED, body, 2])
        unused = (unused - drag_unused) * (factor * weights[MOVED, body, 3])
        series[which, k + 2, body, 0] = x
        series[which, k + 2, body, 1] = y
        series[which, k + 2, body, 2] = angle
        series[which, k + 2, body, 3] = unused
        turning = weights[LEVER, body, 2] * abs(angle)
        largest = max(largest, abs(x), abs(y), turning)
    return largest


def longest_persistence(work):
    """Return the longest time for which a velocity error persists in any body [s]."""
    longest = 0.0
    for body in range(work.place.shape[1]):
        longest = max(longest, work.errors[body].velocity_lifetime)
    return longest


def write_first_terms(scene, work, step):
    """Write terms 0 to 2 of the motion: zero, velocity and acceleration; and all that further ones
    follow from: h²/M, the levers and the derivatives."""
    series, weights = work.series, work.weights
    for body in range(work.place.shape[1]):
        for axis in range(3):
            mobility = scene.bodies[body].free * step * step / inertia(scene, body, axis)
            weights[MOVED, body, axis] = mobility
            weights[LEVER, body, axis] = lever(scene, body, axis)
            # The series holds displacements from the start of the step.
            series[MOTION, 0, body, axis] = 0.0
            series[MOTION, 1, body, axis] = step * work.velocity[NOW, body, axis]
            series[MOTION, 2, body, axis] = 0.5 * mobility * work.force[NOW, body, axis]
        store_block(work, body, body, body, step)
    for pair in range(work.tally.pairs):
        later, earlier = work.pairs[pair].later, work.pairs[pair].earlier
        store_block(work, lower_block(work, pair), later, earlier, step)
        store_block(work, upper_block(work, pair), earlier, later, step)


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
    return (goal / max(term, TINY)) ** (1.0 / k)


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
                    size = abs(work.linear[STIFFNESS, body, other, j, axis])
                    total += size / weights[LEVER, other, j]
            total *= weights[MOVED, body, axis] * weights[LEVER, body, axis]
            largest = max(largest, total)
    return math.sqrt(largest)


@loops_apart
def write_terms(work, which, first, step, goal):
    """Write the terms of a series from ``first`` + 2 on, until they matter less than ``goal`` [m].

    Return their number, TERMS if the series does not end; the larger of the last two and of the two
    before; and the largest from the fourth on [m].
    """
    one, two, three, size = math.inf, math.inf, math.inf, math.inf
    small_terms, largest, persistence = 0, 0.0, longest_persistence(work) / step
    for k in range(first, TERMS - 2):
        three, two, one = two, one, size
        # A term displaces a body now, and later by its velocity (k + 2)/h for as long as that
        # persists.
        size = write_term(work, which, k) * (1.0 + persistence * (k + 2.0))
        largest = max(largest, size) if k > 1 else 0.0
        small_terms = small_terms + 1 if size <= goal else 0
        # Two terms in a row: even and odd ones are its cosine and sine, one of which may vanish.
        if small_terms >= 2 and k + 3 >= MIN_TERMS:
            return k + 3, max(size, one), max(two, three), largest
        if not size < math.inf:
            break
    return TERMS, math.inf, math.inf, math.inf


def expand(work, clock, step, allowed):
    """Write the series of the motion, whose first terms are known; return its number of terms, or 0
    if it does not end.

    ``allowed`` [m] is the step's tolerance.
    """
    goal = TERM_TOLERANCE * allowed
    terms, late, early, largest = write_terms(work, MOTION, 1, step, goal)
    clock.longest_series = math.inf
    if terms == TERMS:
        return 0
    growth = longest_step_ratio(terms - 1, late, early, goal)
    # The error of Radau IIA scales as h⁴. Where it would be small at the longest series, longer
    # steps may be Radau's.
    if largest * growth**4 <= RADAU_TERM * allowed:
        growth *= LONGEST_SERIES_GROWTH
    clock.longest_series = step * growth
    return terms


def evaluate_body(work, which, start, terms, step, fraction, state, body):
    """Write the motion of a body at a fraction of the step to a state: that of the state ``start``
    plus the series."""
    series = work.series
    for axis in range(3):
        # Horner's scheme, from term 2 on.
        place = speed = 0.0
        for k in range(terms - 1, 1, -1):
            term = series[which, k, body, axis]
            place, speed = fraction * place + term, fraction * speed + k * term
        # In differences, a coordinate at rest stays exactly where it is.
        place = fraction * (series[which, 1, body, axis] + fraction * place)
        work.place[state, body, axis] = work.place[start, body, axis] + place
        speed *= fraction / step
        work.velocity[state, body, axis] = work.velocity[start, body, axis] + speed


def evaluate_all(work, which, start, terms, step, fraction, state):
    """Write the motion of all bodies at a fraction of the step to a state; see evaluate_body."""
    for body in range(work.place.shape[1]):
        evaluate_body(work, which, start, terms, step, fraction, state, body)
