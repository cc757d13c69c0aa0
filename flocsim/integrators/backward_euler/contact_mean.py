"""The contact law over a whole step that goes on across events.

In a step of size h from gap −Δ₀ to −Δ₁, with the overlaps Δ⁺ = max(Δ, 0),

    N = N(Δ₁⁺, (Δ₁⁺ − Δ₀⁺)/h),   T = s T(ξ₁, v_t),   ξ₁ = ξ₀ + s h v_t, cut to |ξ₁| ≤ L(Δ₁⁺).

The spring is that of the end (backward Euler). The dashpot gives the impulse over the part of the
step in which the contact is closed. s is that part as a fraction, for a gap that changes linearly.
So the law is continuous in the state at the end, whichever contacts close or open. N of springs and
dashpots is the derivative of a convex function of Δ₁: without friction and rotation a step has
exactly one solution. The cut is the return mapping of plasticity.

Without a friction limit a contact may open under T and close without it. It then ends just open,
with the s that balances the two. That s would vanish within Δ₀, which may be arbitrarily small: so
a contact that opens counts as closed at the start by at least a hundredth of the tolerance.
"""

import math

from flocsim.compiler.linker import apart
from flocsim.hooks import SLIP_LIMIT, contact_derivatives, contact_force, has, slip_limit
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
from flocsim.state.contacts import CLOSED
from flocsim.state.views import ContactView, moved_contact
from flocsim.state.work import DAMPING, NEW, NOW, STIFFNESS, TRIAL


def takes_part(work, row):
    """Return True if a pair is closed at the start of the step (TRIAL) or at its end (NOW)."""
    return work.geometry[NOW, row].gap < 0.0 or work.geometry[TRIAL, row].gap < 0.0


def closed_part(work, row):
    """Return the fraction s of the step in which a pair is closed, for a linearly changing gap."""
    gap_start, gap_end = work.geometry[TRIAL, row].gap, work.geometry[NOW, row].gap
    if gap_start < 0.0:
        return (
            1.0
            if gap_end <= 0.0
            else work.interior[row].fade_length / (work.interior[row].fade_length + gap_end)
        )
    # It closes within the step.
    return gap_end / (gap_end - gap_start) if gap_end < 0.0 else 0.0


def closed_part_slope(work, row):
    """Return the derivative of s with respect to the gap at the end [1/m]."""
    gap_start, gap_end = work.geometry[TRIAL, row].gap, work.geometry[NOW, row].gap
    if gap_start < 0.0 < gap_end:
        return -work.interior[row].fade_length / (work.interior[row].fade_length + gap_end) ** 2
    return -gap_start / (gap_end - gap_start) ** 2 if gap_end < 0.0 <= gap_start else 0.0


def end_overlap(work, row):
    """Return the overlap Δ₁⁺ of a pair at the end [m]."""
    return max(-work.geometry[NOW, row].gap, 0.0)


def step_view(scene, work, row, step, overlap_end, slip, rate):
    """Return the ContactView of a pair over the step, for an overlap at its end [m]."""
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    # The mean overlap rate over the step gives the dashpot's impulse.
    pressing = (overlap_end - max(-work.geometry[TRIAL, row].gap, 0.0)) / step
    return ContactView(
        overlap_end, pressing, slip, rate, effective_mass(scene, a, b),
        candidate.vertex_radius, candidate.edge_radius, smaller_radius(scene, a, b),
    )  # fmt: skip


def sticking_slopes(scene, view, limit, step):
    """Return minus the derivatives of friction with respect to ξ [N/m] and v_t [N s/m], while
    sticking.

    By finite differences well below the ``limit`` of ξ [m], which is tiny for a small load.
    """
    slip, rate = 0.5 * limit, 1e-3 * limit / step
    sheared = moved_contact(view, view.overlap, 0.0, slip, 0.0)
    dragged = moved_contact(view, view.overlap, 0.0, 0.0, rate)
    by_slip = -contact_force(scene, sheared)[1] / slip
    return by_slip, -contact_force(scene, dragged)[1] / rate


def friction_view(scene, work, row, step):
    """Return the ContactView of a pair over the step for its friction.

    Writes ξ₁ to ``work.slip[NEW]`` and the direction of sliding to the candidate.
    """
    overlap, rate = work.interior[row].overlap, tangential_rate(work, NOW, row)
    slip, direction = work.slip[NOW, row] + work.interior[row].closed_fraction * step * rate, 0
    # Return mapping: cut the sticking displacement to its limit.
    if has(scene, SLIP_LIMIT):
        limit = slip_limit(scene, step_view(scene, work, row, step, overlap, 0.0, 0.0))
        if abs(slip) > limit:
            direction = 1 if slip > 0.0 else -1
            slip = direction * limit
    work.slip[NEW, row], work.candidates[row].slide_direction = slip, direction
    return step_view(scene, work, row, step, overlap, slip, rate)


def normal_force(scene, work, row, step, overlap_end):
    """Return the normal force N of a pair for an overlap at the end [N]."""
    return contact_force(scene, step_view(scene, work, row, step, overlap_end, 0.0, 0.0))[0]


def normal_stiffness(scene, work, row, step, overlap_end):
    """Return dN/dΔ₁ of a pair for an overlap at the end [N/m]."""
    values = contact_derivatives(scene, step_view(scene, work, row, step, overlap_end, 0.0, 0.0))
    return values[2] + values[4] / step


def friction_force(scene, work, row, step):
    """Return the friction s T of a pair [N]; mark it if it slides."""
    return (
        work.interior[row].closed_fraction
        * contact_force(scene, friction_view(scene, work, row, step))[1]
    )


@apart
def add_mean_forces(scene, work, step):
    """Add the forces of all contacts over the step to those of NOW."""
    for row in range(work.tally.candidates):
        # Friction depends on the overlap at the end, and on s.
        work.interior[row].overlap = end_overlap(work, row)
        work.interior[row].closed_fraction = closed_part(work, row)
        if takes_part(work, row):
            normal = normal_force(scene, work, row, step, work.interior[row].overlap)
            add_pair_force(work, NOW, row, normal, friction_force(scene, work, row, step))
        else:
            work.slip[NEW, row], work.candidates[row].slide_direction = 0.0, 0


def add_contact_slopes(scene, work, row, normal, tangential, coupled):
    """Add the derivatives of a contact's force to the system.

    ``normal`` and ``coupled`` are minus the derivatives of normal force and friction with respect
    to the gap [N/m], ``tangential`` minus that of friction with respect to v_t [N s/m].
    """
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    pair = candidate.pair
    along, across = normal_rows(work, row), tangent_rows(work, row)
    add_outer_products(scene, work, STIFFNESS, pair, a, b, along, along, normal)
    if coupled != 0.0:
        add_outer_products(scene, work, STIFFNESS, pair, a, b, across, along, coupled)
    add_outer_products(scene, work, DAMPING, pair, a, b, across, across, tangential)


def friction_slopes(scene, work, row, step):
    """Return derivatives of the friction of a pair at the end.

    Minus that with respect to v_t [N s/m], that with respect to the overlap [N/m], and to s [N].
    """
    view = friction_view(scene, work, row, step)
    values = contact_derivatives(scene, view)
    fraction, direction = work.interior[row].closed_fraction, work.candidates[row].slide_direction
    by_slip, by_rate, by_limit = -values[7], -values[9], 0.0
    # Sliding: ξ follows the limit, which follows the overlap.
    if direction != 0:
        by_limit = direction * limit_slope(scene, work, NOW, row) * values[7]
        by_slip = 0.0
    elif has(scene, SLIP_LIMIT):
        # Sticking with a limit: differences well below the limit, where the law does not cut
        # friction.
        limit = slip_limit(scene, view)
        if 0.0 < limit < math.inf:
            by_slip, by_rate = sticking_slopes(scene, view, limit, step)
    # Chain rule, with ξ₁ = ξ₀ + s h v_t.
    by_overlap = fraction * (values[3] + values[5] / step + by_limit)
    by_part = values[1] - fraction * by_slip * step * tangential_rate(work, NOW, row)
    return fraction * (by_rate + fraction * step * by_slip), by_overlap, by_part


@apart
def add_all_derivatives(scene, work, step):
    """Add the derivatives of all contacts with respect to positions and velocities at the end."""
    for row in range(work.tally.candidates):
        if takes_part(work, row):
            overlap_end, stiffness = end_overlap(work, row), 0.0
            slope, by_overlap, by_part = friction_slopes(scene, work, row, step)
            # The gap changes friction through s, and through the overlap.
            coupled = -closed_part_slope(work, row) * by_part
            if overlap_end > 0.0:
                stiffness = normal_stiffness(scene, work, row, step, overlap_end)
                coupled += by_overlap
            add_contact_slopes(scene, work, row, stiffness, slope, coupled)
            force = normal_force(scene, work, row, step, overlap_end)
            add_geometric_stiffness(scene, work, row, force, friction_force(scene, work, row, step))


CLOSE_GAP = 0.01
"""Gap, over r_i + r_j, below which a pair is in the sparsity pattern of the systems. Most contacts
that close in a step then need no new pattern."""


def flag_close(scene, work):
    """Mark as closed all pairs that are closed or close to it in this step; take none back."""
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        a, b = candidate.vertex_body, candidate.edge_body
        near = CLOSE_GAP * (scene.bodies[a].radius + scene.bodies[b].radius)
        if work.geometry[NOW, row].gap < near or work.geometry[TRIAL, row].gap < 0.0:
            candidate.contact_mode = CLOSED
