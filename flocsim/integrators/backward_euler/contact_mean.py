"""A contact over a whole step: its law, of what is closed at the step's end.

In a step from 0 to 1 that does not end at switches, with overlaps Δ⁺ = max(Δ, 0),

    N = N(Δ₁⁺, (Δ₁⁺ − Δ₀⁺)/h),   T = s T(ξ₁, v_t),   ξ₁ = ξ₀ + s h v_t, cut to |ξ₁| ≤ L(Δ₁⁺):

the spring is that of the end, as backward Euler has it, the dashpot gives the impulse that it gives
in a step of which the contact is closed but for a part, and s is that part, as the gap goes along a
line. All of it is continuous in the state at the end, whichever contacts close or open, and N of
springs and dashpots is the derivative of a convex function of Δ₁: a step has one solution, as far
as directions do not turn and friction does not slide. The cut is the return mapping of plasticity.

Without a limit of friction a pair may open by T and close without it; then it ends just open, by
the s with which it does neither. That s would fall to nothing within Δ₀, which may be next to
nothing: a pair that opens is taken to be closed at the start by FADING of the tolerance at least.
"""

import math

from flocsim.compiler.linker import apart
from flocsim.hooks import SLIP_LIMIT, contact_derivatives, contact_force, has, slip_limit
from flocsim.integrators.radau.tableau import REAL
from flocsim.integrators.rhs.friction import limit_slope
from flocsim.integrators.rhs.jacobian import (
    add_geometric_stiffness,
    add_outer_products,
    normal_rows,
    tangent_rows,
)
from flocsim.integrators.rhs.views import (
    add_pair_force,
    effective_mass,
    smaller_radius,
    tangential_rate,
)
from flocsim.state.views import ContactView, moved_contact
from flocsim.state.work import DAMPING, NEW, NOW, STIFFNESS, TRIAL

FADING = 0.01
"""The tangential force of a pair that opens falls to half within a gap of this share of the
tolerance, or of its overlap at the start where that is more."""


def takes_part(work, row):
    """Whether a pair is closed at the start of the step, TRIAL, or at its end, NOW."""
    return work.geometry[NOW, row].gap < 0.0 or work.geometry[TRIAL, row].gap < 0.0


def closed_share(work, row):
    """The part of the step for which a pair is closed, as its gap goes along a line."""
    before, after = work.geometry[TRIAL, row].gap, work.geometry[NOW, row].gap
    if before < 0.0:
        return (
            1.0
            if after <= 0.0
            else work.interior[row].fading_gap / (work.interior[row].fading_gap + after)
        )
    return after / (after - before) if after < 0.0 else 0.0


def share_slope(work, row):
    """By how much that grows with the gap at the end [1/m]."""
    before, after = work.geometry[TRIAL, row].gap, work.geometry[NOW, row].gap
    if before < 0.0 < after:
        return -work.interior[row].fading_gap / (work.interior[row].fading_gap + after) ** 2
    return -before / (after - before) ** 2 if after < 0.0 <= before else 0.0


def end_overlap(work, row):
    """Δ₁⁺ of a pair, by its gap at the end [m]."""
    return max(-work.geometry[NOW, row].gap, 0.0)


def view_with(scene, work, row, step, after, slip, rate):
    """The ContactView of a pair over the step, of an overlap ``after`` at its end [m]."""
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    pressing = (after - max(-work.geometry[TRIAL, row].gap, 0.0)) / step
    return ContactView(
        after, pressing, slip, rate, effective_mass(scene, a, b),
        scene.bodies[a].radius, scene.bodies[b].radius, smaller_radius(scene, a, b),
    )  # fmt: skip


def sticking_slopes(scene, view, limit, step):
    """By how much the friction of a pair falls with ξ [N/m] and with v_t [N s/m] while it sticks,
    by differences that are well below its ``limit`` [m]: that of a small load is tiny."""
    slip, rate = 0.5 * limit, 1e-3 * limit / step
    sheared = moved_contact(view, view.overlap, 0.0, slip, 0.0)
    dragged = moved_contact(view, view.overlap, 0.0, 0.0, rate)
    by_slip = -contact_force(scene, sheared)[1] / slip
    return by_slip, -contact_force(scene, dragged)[1] / rate


def bearing_of(work, row):
    """The overlap that the friction of a pair goes by [m]: its own, unless another one is held, and
    PART with it."""
    held = work.interior[row].held_overlap
    return held if held > 0.0 else work.interior[row].overlap


def friction_view(scene, work, row, step):
    """The ContactView of a pair over the step of the overlap that its friction goes by; ξ₁ goes to
    NEW, whether it slides to SLIDING."""
    bearing, rate = bearing_of(work, row), tangential_rate(work, NOW, row)
    slip, side = work.slip[NOW, row] + work.interior[row].step_share * step * rate, 0
    if has(scene, SLIP_LIMIT):
        limit = slip_limit(scene, view_with(scene, work, row, step, bearing, 0.0, 0.0))
        if abs(slip) > limit:
            side = 1 if slip > 0.0 else -1
            slip = side * limit
    work.slip[NEW, row], work.candidates[row].slide_direction = slip, side
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
    return (
        work.interior[row].step_share
        * contact_force(scene, friction_view(scene, work, row, step))[1]
    )


@apart
def add_mean_forces(scene, work, step):
    """Add the forces of all contacts in the step to those in NOW; friction goes by the overlaps at
    its end."""
    for row in range(work.tally.candidates):
        work.interior[row].overlap = end_overlap(work, row)
        if work.interior[row].held_overlap == 0.0:
            work.interior[row].step_share = closed_share(work, row)
        if takes_part(work, row):
            normal = normal_force(scene, work, row, step, work.interior[row].overlap)
            add_pair_force(work, NOW, row, normal, friction_force(scene, work, row, step))
        else:
            work.slip[NEW, row], work.candidates[row].slide_direction = 0.0, 0


@apart
def add_held_friction(scene, work, step):
    """Add to the loads what friction that goes by what is held lacks of that at the end."""
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        held, part = work.interior[row].held_overlap, work.interior[row].step_share
        if held > 0.0 and takes_part(work, row):
            work.interior[row].held_overlap, work.interior[row].step_share = (
                0.0,
                closed_share(work, row),
            )
            missing = friction_force(scene, work, row, step)
            work.interior[row].held_overlap, work.interior[row].step_share = held, part
            missing -= friction_force(scene, work, row, step)
            a, b = candidate.vertex_body, candidate.edge_body
            of_a, of_b = tangent_rows(work, row)
            for axis in range(3):
                work.loads[REAL, 3 * a + axis] += missing * of_a[axis]
                work.loads[REAL, 3 * b + axis] += missing * of_b[axis]


def add_slopes(scene, work, row, normal, tangential, coupled):
    """Add to the system what the force of a contact falls by for a metre of the gap, and with the
    rate along the tangent [N/m, N s/m]; and by how much friction falls for a metre of the gap."""
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    pair = candidate.pair
    along, across = normal_rows(work, row), tangent_rows(work, row)
    add_outer_products(scene, work, STIFFNESS, pair, a, b, along, along, normal)
    if coupled != 0.0:
        add_outer_products(scene, work, STIFFNESS, pair, a, b, across, along, coupled)
    add_outer_products(scene, work, DAMPING, pair, a, b, across, across, tangential)


def friction_slopes(scene, work, row, step):
    """By how much the friction of a pair falls with v_t at the end [N s/m], and grows with its
    overlap [N/m] and its part of the step [N]."""
    view = friction_view(scene, work, row, step)
    found = contact_derivatives(scene, view)
    part, side = work.interior[row].step_share, work.candidates[row].slide_direction
    by_slip, by_rate, by_limit = -found[7], -found[9], 0.0
    if side != 0:
        by_limit = side * limit_slope(scene, work, NOW, row) * found[7]
        by_slip = 0.0
    elif has(scene, SLIP_LIMIT):
        limit = slip_limit(scene, view)
        if 0.0 < limit < math.inf:
            by_slip, by_rate = sticking_slopes(scene, view, limit, step)
    by_overlap = part * (found[3] + found[5] / step + by_limit)
    by_part = found[1] - part * by_slip * step * tangential_rate(work, NOW, row)
    return part * (by_rate + part * step * by_slip), by_overlap, by_part


@apart
def add_all_derivatives(scene, work, step):
    """Add the derivatives of all contacts in the step by the places and velocities at its end."""
    for row in range(work.tally.candidates):
        if takes_part(work, row):
            after, stiffness = end_overlap(work, row), 0.0
            slope, by_overlap, by_part = friction_slopes(scene, work, row, step)
            coupled = -share_slope(work, row) * by_part
            if after > 0.0:
                stiffness = normal_stiffness(scene, work, row, step, after)
                coupled += by_overlap
            if work.interior[row].held_overlap > 0.0:
                coupled = 0.0
            add_slopes(scene, work, row, stiffness, slope, coupled)
            force = normal_force(scene, work, row, step, after)
            add_geometric_stiffness(scene, work, row, force, friction_force(scene, work, row, step))


CLOSE = 0.01
"""Pairs nearer than this share of r_i + r_j are in the pattern of the systems, closed or not: most
of those that close in a step need no other one."""


def flag_close(scene, work):
    """Flag, as closed, all pairs that are or may well be so in this step; none is taken back."""
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        a, b = candidate.vertex_body, candidate.edge_body
        near = CLOSE * (scene.bodies[a].radius + scene.bodies[b].radius)
        if work.geometry[NOW, row].gap < near or work.geometry[TRIAL, row].gap < 0.0:
            candidate.contact_mode = 1
