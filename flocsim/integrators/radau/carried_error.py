"""Propagation of the error of a run as a vector, and the errors of overlaps in long steps.

A small change (δx, δv) of the state is propagated by the linearised equations of motion,

    M δv̇ = −D δv − K δx + f,   δẋ = δv,

with the derivatives D, K of the forces (DAMPING, STIFFNESS). Over a step, exp(z) is approximated by

    R(z) = (1 + (1 − 3γ) z + (½ − 3γ + 3γ²) z²)/(1 − γz)³,

of second order and, for γ from .18 to 2.18, L-stable (Hairer & Wanner II, 1996, section IV.6). With
γ = h/µ, µ the real eigenvalue of Radau's matrix, the factors of 1 − γz are those of the step. K
contains the tangential springs k_t of sticking contacts. But ξ counts from where a contact has
touched or begun to stick, and does not contain the error e that the positions had there. So these
springs pull by k_t e less: the source term f (FORCING), constant over a step, enters by (R − 1)/z.

The vector shows that contacts resist an error, that a doublet which tips over amplifies it, and
that errors of opposite sign cancel. After each step its own estimated error is added;
loop/stated_error.py adds the errors of events.

The second subject is the overlap of a pressed contact at the end of a long step. Where a step does
not resolve the vibration of a contact, its overlap is an algebraic variable: k_n times the overlap
is the multiplier of a constraint. Radau IIA has a lower order for those (Hairer & Wanner II, 1996,
section VII.4). So the motion may be right to the tolerance while the contact force, where the load
is small, is wrong by several times itself, which decides when the contact opens. The stages show
this: their overlaps do not lie on a line.
"""

from flocsim.integrators.radau.systems import solve_prepared
from flocsim.integrators.radau.tableau import EIGENVALUES, NODES, REAL, SECOND_STAGE, THIRD_STAGE
from flocsim.integrators.rhs.blocks import subtract_product
from flocsim.integrators.rhs.contact_stiffness import unresolved_fraction
from flocsim.integrators.rhs.error import at_least_rounding
from flocsim.integrators.rhs.propagated_error import bound_propagated
from flocsim.integrators.rhs.views import inertia
from flocsim.state.clock import RADAU
from flocsim.state.contacts import CLOSED
from flocsim.state.work import CHANGE, FIRST_STAGE, FORCING, NOW, PROPAGATED, STEP_ERROR, STIFFNESS


def apply_resolvent(scene, work, full, weight):
    """Apply (1 − γz)⁻¹ to CHANGE, after adding ``weight`` times γh FORCING/M.

    ``full`` [s] is the step whose factors are at hand: γh = full/µ.
    """
    part = full / EIGENVALUES[REAL].real
    for body in range(work.place.shape[1]):
        for axis in range(3):
            load = inertia(scene, body, axis) / part * work.velocity[CHANGE, body, axis]
            load += weight * work.velocity[FORCING, body, axis]
            work.loads[REAL, 3 * body + axis] = load
    subtract_product(work, STIFFNESS, 1.0)
    # Solve for the velocities; positions follow from δx' = δx + γh δv'.
    solve_prepared(scene, work)
    for body in range(work.place.shape[1]):
        for axis in range(3):
            speed = work.loads[REAL, 3 * body + axis].real
            work.velocity[CHANGE, body, axis] = speed
            work.place[CHANGE, body, axis] += part * speed


def combine_with_carried(work, of_change, of_carried):
    """Replace CHANGE by a linear combination of itself and the propagated error PROPAGATED."""
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


def add_step_error(work):
    """Replace the propagated error by CHANGE plus the estimated error of the step itself."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            step_error = work.place[STEP_ERROR, body, axis]
            work.place[PROPAGATED, body, axis] = work.place[CHANGE, body, axis] + step_error
            step_error = work.velocity[STEP_ERROR, body, axis]
            work.velocity[PROPAGATED, body, axis] = work.velocity[CHANGE, body, axis] + step_error


def propagate_error(scene, work, clock, step):
    """Propagate the error over an accepted step; return its largest norm over the bodies [m]."""
    bound_propagated(scene, work)
    full = clock.stages_step
    # A step that was cut short still has the factors of its full size.
    gamma = full / (EIGENVALUES[REAL].real * step)
    first = (1.0 - 3.0 * gamma) / gamma
    second = (0.5 - 3.0 * gamma + 3.0 * gamma * gamma) / (gamma * gamma)
    # R as a polynomial in u = 1/(1 − γz), z being (1 − 1/u)/γ; what a constant force leads to is
    # (R − 1)/z = γ (u + (1 − second) u² + (1 + first + second) u³).
    combine_with_carried(work, 0.0, 1.0)
    apply_resolvent(scene, work, full, 1.0)
    combine_with_carried(work, 1.0 + first + second, -first - 2.0 * second)
    apply_resolvent(scene, work, full, 1.0 - second)
    combine_with_carried(work, 1.0, second)
    apply_resolvent(scene, work, full, 1.0)
    add_step_error(work)
    return bound_propagated(scene, work)


OVERLAP_ERROR_FACTOR = 2.0
"""Error of the last overlap over its scatter: about ½ as a rule, a few times that where a contact
opens slowly (tests/verification/test_slow_release.py)."""


MAX_SCATTER = 0.4
"""Largest scatter of an overlap, over the overlap itself, in a step in which a contact is unloaded.
At a larger one the contact might hold although it should open."""

ROUNDING_FACTOR = 30.0
"""Overlaps below this multiple of the rounding of positions scatter by chance."""


def overlap_scatter(scene, work, clock, step, row):
    """Return how far the overlap at the end of a step is off the line through the other stages [m].

    Weighted by the fraction to which the step does not resolve the contact's vibration; 0 for other
    kinds of step.
    """
    if work.tally.kind != RADAU:
        return 0.0
    g, span = work.geometry, NODES[1] - NODES[0]
    slope = (g[SECOND_STAGE, row].gap - g[FIRST_STAGE, row].gap) / span
    scatter = g[THIRD_STAGE, row].gap - g[SECOND_STAGE, row].gap - slope * (1.0 - NODES[1])
    return abs(scatter) * unresolved_fraction(scene, work, clock, step, row)


def overlap_error(scene, work, clock, row):
    """Return the expected error of the overlap of a contact [m]."""
    return OVERLAP_ERROR_FACTOR * overlap_scatter(scene, work, clock, clock.stages_step, row)


def release_uncertainty(scene, work, clock, step):
    """Return the largest ratio of overlap scatter to its tolerance over contacts that may open in
    this step.

    It scales as h².
    """
    largest, g = 0.0, work.geometry
    # Ignore scatter that is rounding.
    least = ROUNDING_FACTOR * at_least_rounding(work, NOW, 0.0)
    for row in range(work.tally.candidates):
        if work.candidates[row].contact_mode == CLOSED:
            # Overlaps at both ends of the step.
            start, end = -g[NOW, row].gap, -g[THIRD_STAGE, row].gap
            scatter = overlap_scatter(scene, work, clock, step, row)
            # Only contacts that are unloaded in the step, within the uncertainty of their overlap,
            # may open.
            if end - OVERLAP_ERROR_FACTOR * scatter < start and start > 0.0:
                largest = max(largest, scatter / (MAX_SCATTER * max(start, -end, least)))
    return largest
