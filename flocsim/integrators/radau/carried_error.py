"""The error of a run as a vector: carried on by every step as a small change of its start would be.

    M δv̇ = −D δv − K δx,   δẋ = δv,

with the forces' own derivatives (D, K: DAMPING and STIFFNESS). Over a step its solution exp(z) is
taken as

    R(z) = (1 + (1 − 3γ) z + (½ − 3γ + 3γ²) z²)/(1 − γz)³,

of second order and, for γ from .18 to 2.18, L-stable (Hairer & Wanner II, 1996, section IV.6): for
γ = h/µ, µ the real eigenvalue of Radau's matrix, the step has the factors of 1 − γz already.
K has the springs k_t of the contacts that stick; but ξ counts from where a contact has touched or
stuck, and knows nothing of the error e that the places had there already. So these springs pull by
k_t e less: FORCING, constant over a step, for which (R − 1)/z stands.

Contacts thus take up what they resist, a doublet that tips over lets an error grow, and errors of
opposite signs cancel. Behind each step its own estimated error is added; what switches do is added
by rhs/stated_error.py.

And what the overlap of a pressed contact may be wrong by at the end of a long step. A contact whose
vibrations a step does not resolve only holds what presses on it: its overlap is an algebraic
variable, k_n times it the multiplier of a constraint. For those Radau IIA has a lower order (Hairer
& Wanner II, 1996, section VII.4), so that a step whose motion is right to the tolerance may hold by
a force that is wrong by several times itself where little presses, which decides when the contact
opens. The stages show it: their overlaps lie on no line.
"""

from flocsim.integrators.events.resolution import at_least_rounding
from flocsim.integrators.radau.systems import solve_for_free
from flocsim.integrators.radau.tableau import EIGENVALUES, NODES, REAL, SECOND_STAGE, THIRD_STAGE
from flocsim.integrators.rhs.blocks import subtract_product
from flocsim.integrators.rhs.stated_error import bound_propagated, unresolved_fraction
from flocsim.integrators.rhs.views import inertia
from flocsim.state.contacts import CLOSED
from flocsim.state.work import CHANGE, FIRST_STAGE, FORCING, NOW, PROPAGATED, STEP_ERROR, STIFFNESS


def divide(scene, work, full, weight):
    """Divide CHANGE and ``weight`` times γh FORCING/M by 1 − γz, with the factors of a step of
    ``full`` [s]."""
    part = full / EIGENVALUES[REAL].real
    for body in range(work.place.shape[1]):
        for axis in range(3):
            load = inertia(scene, body, axis) / part * work.velocity[CHANGE, body, axis]
            load += weight * work.velocity[FORCING, body, axis]
            work.loads[REAL, 3 * body + axis] = load
    subtract_product(work, STIFFNESS, 1.0)
    solve_for_free(scene, work)
    for body in range(work.place.shape[1]):
        for axis in range(3):
            speed = work.loads[REAL, 3 * body + axis].real
            work.velocity[CHANGE, body, axis] = speed
            work.place[CHANGE, body, axis] += part * speed


def mix(work, of_change, of_carried):
    """Make CHANGE a sum of itself and what is carried."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            change = of_change * work.place[CHANGE, body, axis]
            work.place[CHANGE, body, axis] = (
                change + of_carried * work.place[PROPAGATED, body, axis]
            )
            change = of_change * work.velocity[CHANGE, body, axis]
            work.velocity[CHANGE, body, axis] = (
                change + of_carried * work.velocity[PROPAGATED, body, axis]
            )


def add_step(work):
    """Take what has been carried, and the error that the step itself is likely to have made."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            own = work.place[STEP_ERROR, body, axis]
            work.place[PROPAGATED, body, axis] = work.place[CHANGE, body, axis] + own
            own = work.velocity[STEP_ERROR, body, axis]
            work.velocity[PROPAGATED, body, axis] = work.velocity[CHANGE, body, axis] + own


def carry_error(scene, work, clock, step):
    """Carry the error over an accepted step; the largest one of a body's outline [m]."""
    bound_propagated(scene, work)
    full = clock.stages_step
    gamma = full / (EIGENVALUES[REAL].real * step)
    first = (1.0 - 3.0 * gamma) / gamma
    second = (0.5 - 3.0 * gamma + 3.0 * gamma * gamma) / (gamma * gamma)
    # R as a polynomial in u = 1/(1 − γz), z being (1 − 1/u)/γ; what a constant force leads to is
    # (R − 1)/z = γ (u + (1 − second) u² + (1 + first + second) u³).
    mix(work, 0.0, 1.0)
    divide(scene, work, full, 1.0)
    mix(work, 1.0 + first + second, -first - 2.0 * second)
    divide(scene, work, full, 1.0 - second)
    mix(work, 1.0, second)
    divide(scene, work, full, 1.0)
    add_step(work)
    return bound_propagated(scene, work)


SHARE_OF_SCATTER = 2.0
"""The end's overlap is wrong by about half of how far it lies off the line of the other two, and
where a contact lets go slowly by a few times as much (tests/verification/test_slow_release.py)."""


MOST_SCATTER = 0.4
"""A step in which a contact is relieved is too long where its overlap scatters by more than this
share of itself: it may hold where it would have let go."""

ABOVE = 30.0
"""Overlaps below so many times what places can be told apart by scatter by chance."""


def scatter_of(scene, work, clock, step, row):
    """How far the overlap of a contact at the end of a step lies off the line of those at the other
    stages, as far as the step does not resolve its vibrations [m]."""
    if work.tally.series_terms > 0:
        return 0.0
    g, span = work.geometry, NODES[1] - NODES[0]
    slope = (g[SECOND_STAGE, row].gap - g[FIRST_STAGE, row].gap) / span
    scatter = g[THIRD_STAGE, row].gap - g[SECOND_STAGE, row].gap - slope * (1.0 - NODES[1])
    return abs(scatter) * unresolved_fraction(scene, work, clock, step, row)


def overlap_error(scene, work, clock, row):
    """By how much the overlap of a contact is likely to be wrong [m]."""
    return SHARE_OF_SCATTER * scatter_of(scene, work, clock, clock.stages_step, row)


def doubt_of_release(scene, work, clock, step):
    """By how much it is in doubt whether contacts that may be relieved in a step still press, over
    what is allowed; it goes with the square of the step."""
    largest, g = 0.0, work.geometry
    least = ABOVE * at_least_rounding(work, NOW, 0.0)
    for row in range(work.tally.candidates):
        if work.candidates[row].contact_mode == CLOSED:
            before, after = -g[NOW, row].gap, -g[THIRD_STAGE, row].gap
            scatter = scatter_of(scene, work, clock, step, row)
            if after - SHARE_OF_SCATTER * scatter < before and before > 0.0:
                largest = max(largest, scatter / (MOST_SCATTER * max(before, -after, least)))
    return largest
