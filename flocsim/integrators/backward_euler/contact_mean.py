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
    GAIN,
    GAP,
    NEW,
    NOW,
    OVERLAP,
    PAIR,
    PART,
    RADIUS,
    SLIDING,
    STIFFNESS,
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


def acts(work, row):
    """Whether a pair has a force in the step, be it that of a friction that is yet to follow."""
    return takes_part(work, row) or work.slip[PART, row] > 0.0


def closed_share(work, row):
    """The part of the step for which a pair is closed, as its gap goes along a line."""
    before, after = work.geometry[TRIAL, row, GAP], work.geometry[NOW, row, GAP]
    if before < 0.0:
        return 1.0 if after <= 0.0 else before / (before - after)
    return after / (after - before) if after < 0.0 else 0.0


def end_overlap(work, row):
    """Δ₁⁺ of a pair, by its gap at the end [m]."""
    return max(-work.geometry[NOW, row, GAP], 0.0)


def go_by(work, row, overlap, part):
    """Let the friction of a pair go by an overlap [m] and a part of the step from now on."""
    work.slip[OVERLAP, row], work.slip[PART, row] = overlap, part


def follow(work, row):
    """Let the friction of a pair go by how it is pressed now. A pair may open by its own friction
    and close without it: where the part of the step turns back, it goes half as far from then on.
    """
    part, gain = work.slip[PART, row], work.slip[GAIN, row]
    change = closed_share(work, row) - part
    if change * gain < 0.0:
        gain *= -0.5
    work.slip[GAIN, row] = gain
    go_by(work, row, end_overlap(work, row), part + abs(gain) * change)


def view_with(scene, work, row, step, after, slip, rate):
    """The ContactView of a pair over the step, of an overlap ``after`` at its end [m]."""
    a, b = work.candidates[row, VERTEX_BODY], work.candidates[row, EDGE_BODY]
    pressing = (after - max(-work.geometry[TRIAL, row, GAP], 0.0)) / step
    return ContactView(
        after, pressing, slip, rate, effective_mass(scene, a, b),
        scene.bodies[a, RADIUS], scene.bodies[b, RADIUS],
    )  # fmt: skip


def friction_view(scene, work, row, step):
    """The ContactView of a pair over the step of the overlap that its friction goes by; ξ₁ goes to
    NEW, whether it slides to SLIDING."""
    bearing, rate = work.slip[OVERLAP, row], tangential_rate(work, NOW, row)
    slip, side = work.slip[NOW, row] + work.slip[PART, row] * step * rate, 0
    if has(scene, SLIP_LIMIT):
        limit = slip_limit(scene, view_with(scene, work, row, step, bearing, 0.0, 0.0))
        if abs(slip) > limit:
            side = 1 if slip > 0.0 else -1
            slip = side * limit
    work.slip[NEW, row], work.candidates[row, SLIDING] = slip, side
    return view_with(scene, work, row, step, bearing, slip, rate)


def normal_force(scene, work, row, step, after):
    """N of a pair of an overlap at the end [N]."""
    return contact_force(scene, view_with(scene, work, row, step, after, 0.0, 0.0))[0]


def normal_stiffness(scene, work, row, step, after):
    """dN/dΔ₁ of a pair of an overlap at the end [N/m]."""
    found = contact_derivatives(scene, view_with(scene, work, row, step, after, 0.0, 0.0))
    return found[2] + found[4] / step


def friction_force(scene, work, row, step):
    """s T of a pair [N]; it is flagged where it slides."""
    return work.slip[PART, row] * contact_force(scene, friction_view(scene, work, row, step))[1]


def friction_slope(scene, work, row, step):
    """By how much that falls with v_t at the end [N s/m]: ξ₁ goes with it where the pair sticks."""
    found, part = contact_derivatives(scene, friction_view(scene, work, row, step)), work.slip[PART]
    by_slip = part[row] * step * found[7] if work.candidates[row, SLIDING] == 0 else 0.0
    return -part[row] * (found[9] + by_slip)


@apart
def add_mean_forces(scene, work, step):
    """Add the forces of all contacts in the step to those in NOW."""
    for row in range(work.tally[CANDIDATES]):
        if acts(work, row):
            normal = normal_force(scene, work, row, step, end_overlap(work, row))
            push_pair(work, NOW, row, normal, friction_force(scene, work, row, step))
        else:
            work.slip[NEW, row], work.candidates[row, SLIDING] = 0.0, 0


def add_slopes(scene, work, row, normal, tangential):
    """Add to the system what the force of a contact falls by for a metre of the gap [N/m], and with
    the rate along the tangent [N s/m]."""
    a, b = work.candidates[row, VERTEX_BODY], work.candidates[row, EDGE_BODY]
    pair = work.candidates[row, PAIR]
    along, across = normal_rows(work, row), tangent_rows(work, row)
    add_product(scene, work, STIFFNESS, pair, a, b, along, along, normal)
    add_product(scene, work, DAMPING, pair, a, b, across, across, tangential)


def add_coupling(scene, work, row, step):
    """Add by how much friction grows with the overlap at the end to the system."""
    a, b = work.candidates[row, VERTEX_BODY], work.candidates[row, EDGE_BODY]
    found = contact_derivatives(scene, friction_view(scene, work, row, step))
    side = work.candidates[row, SLIDING]
    by_slip = side * limit_slope(scene, work, NOW, row) if side != 0 else 0.0
    total = work.slip[PART, row] * (found[3] + found[5] / step + by_slip * found[7])
    along, across = normal_rows(work, row), tangent_rows(work, row)
    add_product(scene, work, STIFFNESS, work.candidates[row, PAIR], a, b, across, along, total)


@apart
def add_all_derivatives(scene, work, step, coupled):
    """Add the derivatives of all contacts in the step by the places and velocities at its end; with
    how friction goes by the gaps if they are ``coupled``."""
    for row in range(work.tally[CANDIDATES]):
        if acts(work, row):
            after = end_overlap(work, row)
            normal = normal_stiffness(scene, work, row, step, after) if after > 0.0 else 0.0
            add_slopes(scene, work, row, normal, friction_slope(scene, work, row, step))
            force = normal_force(scene, work, row, step, after)
            add_turning(scene, work, row, force, friction_force(scene, work, row, step))
            if coupled and after > 0.0:
                add_coupling(scene, work, row, step)


def mode_of(work, row):
    """A number that tells apart what a pair does: open, too weak for friction, sticks, slides one
    way or the other."""
    if work.geometry[NOW, row, GAP] >= 0.0:
        return 0
    return 3 + work.candidates[row, SLIDING] if work.slip[OVERLAP, row] > 0.0 else 1


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
