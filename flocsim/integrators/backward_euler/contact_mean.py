"""A contact over a whole step: its law, of what is closed at the step's end.

In a step from 0 to 1 that does not end at switches, with overlaps Δ⁺ = max(Δ, 0),

    N = N(Δ₁⁺, (Δ₁⁺ − Δ₀⁺)/h),   T = s T(ξ₁, v_t),   ξ₁ = ξ₀ + s h v_t, cut to |ξ₁| ≤ L(Δ₁⁺):

the spring is that of the end, as backward Euler has it, the dashpot gives the impulse that it gives
in a step of which the contact is closed but for a part, and s is that part, as the gap goes along a
line. All of it is continuous in the state at the end, whichever contacts close or open, and N of
springs and dashpots is the derivative of a convex function of Δ₁: a step has one solution, as far
as directions do not turn and friction does not slide. The cut is the return mapping of plasticity.
"""

from flocsim.arrays import (
    CANDIDATES,
    CLOSED,
    DAMPING,
    EDGE_BODY,
    GAP,
    NEW,
    NOW,
    PAIR,
    RADIUS,
    SLIDING,
    STIFFNESS,
    STUCK,
    TRIAL,
    VERTEX_BODY,
    ContactView,
)
from flocsim.compiler.composer import apart
from flocsim.integrators.rhs.friction import limit_slope
from flocsim.integrators.rhs.jacobian import (
    add_product,
    add_turning,
    normal_rows,
    tangent_rows,
)
from flocsim.integrators.rhs.views import effective_mass, push_pair, tangential_rate
from flocsim.laws import SLIP_LIMIT, contact_derivatives, contact_force, has, slip_limit


def takes_part(work, row):
    """Whether a pair is closed at the start of the step, TRIAL, or at its end, NOW."""
    return work.geometry[NOW, row, GAP] < 0.0 or work.geometry[TRIAL, row, GAP] < 0.0


def closed_share(work, row):
    """The part of the step for which a pair is closed, as its gap goes along a line."""
    before, after = work.geometry[TRIAL, row, GAP], work.geometry[NOW, row, GAP]
    if before < 0.0:
        return 1.0 if after <= 0.0 else before / (before - after)
    return after / (after - before) if after < 0.0 else 0.0


def end_overlap(work, row):
    """Δ₁⁺ of a pair, by its gap at the end [m]."""
    return max(-work.geometry[NOW, row, GAP], 0.0)


def mean_view(scene, work, row, step, after):
    """The ContactView of a pair over the step, of an overlap ``after`` at its end [m]; ξ₁ goes to
    NEW, whether it slides to SLIDING."""
    a, b = work.candidates[row, VERTEX_BODY], work.candidates[row, EDGE_BODY]
    before = max(-work.geometry[TRIAL, row, GAP], 0.0)
    rate = tangential_rate(work, NOW, row)
    slip, side = work.slip[NOW, row] + closed_share(work, row) * step * rate, 0
    mass = effective_mass(scene, a, b)
    radius_a, radius_b = scene.bodies[a, RADIUS], scene.bodies[b, RADIUS]
    pressing = (after - before) / step
    if has(scene, SLIP_LIMIT) and after > 0.0 and work.candidates[row, STUCK] == 0:
        pressed = ContactView(after, pressing, 0.0, 0.0, mass, radius_a, radius_b)
        limit = slip_limit(scene, pressed)
        if abs(slip) > limit:
            side = 1 if slip > 0.0 else -1
            slip = side * limit
    work.slip[NEW, row], work.candidates[row, SLIDING] = slip, side
    return ContactView(after, pressing, slip, rate, mass, radius_a, radius_b)


@apart
def add_mean_force(scene, work, row, step, after):
    """Add the force of a contact in the step to those in NOW; flag it where it slides."""
    view = mean_view(scene, work, row, step, after)
    normal, tangential = contact_force(scene, view)
    push_pair(work, NOW, row, normal, closed_share(work, row) * tangential)


@apart
def add_mean_forces(scene, work, step):
    """Add the forces of all contacts in the step."""
    for row in range(work.tally[CANDIDATES]):
        if takes_part(work, row):
            add_mean_force(scene, work, row, step, end_overlap(work, row))
        else:
            work.slip[NEW, row], work.candidates[row, SLIDING] = 0.0, 0


@apart
def normal_stiffness(scene, work, row, step, after):
    """dN/dΔ₁ of a pair of an overlap at the end [N/m]."""
    found = contact_derivatives(scene, mean_view(scene, work, row, step, after))
    return found[2] + found[4] / step


@apart
def add_mean_derivatives(scene, work, row, step, after, part, turning):
    """Add the derivatives of a contact's force by the velocities and places at the end; ``part`` of
    them by the overlap; ``turning``: of its direction, too."""
    a, b = work.candidates[row, VERTEX_BODY], work.candidates[row, EDGE_BODY]
    pair, share = work.candidates[row, PAIR], closed_share(work, row)
    found = contact_derivatives(scene, mean_view(scene, work, row, step, after))
    along, across = normal_rows(work, row), tangent_rows(work, row)
    side = work.candidates[row, SLIDING]
    # ξ₁ goes with the velocity, or with the overlap where it slides.
    by_rate = share * step if side == 0 else 0.0
    if part > 0.0:
        by_overlap = side * limit_slope(scene, work, NOW, row) if side != 0 else 0.0
        normal = part * (found[2] + found[4] / step + by_overlap * found[6])
        tangential = part * share * (found[3] + found[5] / step + by_overlap * found[7])
        add_product(scene, work, STIFFNESS, pair, a, b, along, along, normal)
        add_product(scene, work, STIFFNESS, pair, a, b, across, along, tangential)
    normal = found[8] + by_rate * found[6]
    tangential = share * (found[9] + by_rate * found[7])
    add_product(scene, work, DAMPING, pair, a, b, along, across, -normal)
    add_product(scene, work, DAMPING, pair, a, b, across, across, -tangential)
    if turning:
        add_turning(scene, work, row, found[0], share * found[1])


@apart
def add_all_derivatives(scene, work, step):
    """The same of all contacts that take part."""
    for row in range(work.tally[CANDIDATES]):
        if takes_part(work, row):
            after = end_overlap(work, row)
            part = 1.0 if after > 0.0 else 0.0
            add_mean_derivatives(scene, work, row, step, after, part, True)


def mode_of(work, row):
    """A number that tells apart what a pair does: open, sticks, slides one way or the other."""
    if work.geometry[NOW, row, GAP] >= 0.0:
        return 0
    return 3 + work.candidates[row, SLIDING]


SLIDES_BOTH_WAYS = 6
"""The sum of the modes of sliding one way and the other; that of sticking twice, as well."""

CLOSE = 0.02
"""Pairs nearer than this share of r_i + r_j are in the pattern of the systems, closed or not: most
of those that close in a step need no other one."""


def flag_close(scene, work):
    """Flag, as closed, all pairs that are or may well be so in this step; none is taken back."""
    for row in range(work.tally[CANDIDATES]):
        a, b = work.candidates[row, VERTEX_BODY], work.candidates[row, EDGE_BODY]
        near = CLOSE * (scene.bodies[a, RADIUS] + scene.bodies[b, RADIUS])
        if work.geometry[NOW, row, GAP] < near or work.geometry[TRIAL, row, GAP] < 0.0:
            work.candidates[row, CLOSED] = 1
