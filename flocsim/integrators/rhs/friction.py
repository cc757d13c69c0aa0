"""Tangential displacements and forces: rolling, sticking, sliding and grazing of a contact.

Rolling. The tangential displacement ξ of a sticking contact is the time integral of v_t, the
tangential velocity. v_t is the rate of a sum of lengths: the path of the foot along its edge, the
arc by which the normal turns about an end of the edge, and the arc that the vertex's disk rolls
off,

    dξ = ± ds + D (dφ − dθ_b) + r (dθ_b − dθ_a),

s being the foot's position on the edge, φ the direction of the normal, D = r_a + r_b + gap, and r =
r_a + gap/2 the radius at which the disk of the vertex rolls. Inside the edge the normal turns with
the edge, and at an end the foot stays, so one formula serves both. Between two states ξ therefore
follows from positions, as the gap does: a doublet that turns rigidly accumulates none, however long
its steps. (ξ as a sum of velocities drifted by the tolerance in each step, and two contacts of a
doublet wedged each other.) Only a small part must be integrated in time: D and r change with the
gap.

Sliding. A contact slides in the direction s = ±1 once |ξ| has reached the limit L that friction
bears (µ k_n Δ/k_t for Coulomb friction) and would exceed it:

    ξ = s L   as long as   s v_t > dL/dt.

Modes are frozen within a step (Candidate.slide_direction), so forces stay smooth; the driver ends
the step where a mode has to change. ξ never jumps: it solves dξ/dt = v_t under |ξ| ≤ L. Clipping ξ
at the end of each step would converge to that only with the first power of the step.

Grazing. Without a Coulomb limit the tangential force acts however small the overlap is. If the load
on a contact has nearly vanished, that force alone may lift the bodies apart; the contact opens, the
force is gone, the load closes it again, and so on: a sliding mode in the sense of Filippov (1988),
whose cycle gets as short as it is resolved. In its limit the bodies neither part nor overlap,

    d(gap)/dt = 0,   N = 0,   0 ≤ T/T_closed ≤ 1,

with a tangential force T that is an unknown of the step. Here T is the force of a stiff dashpot,

    T = T₀ − K d(gap)/dt,

so stiff that the gap changes by a small fraction of the tolerance only. The pair opens when T
passes through zero; when it ceases to slide it sticks again and its spring takes T over.
"""

import math

from flocsim.hooks import SLIP_LIMIT, has, slip_limit
from flocsim.integrators.rhs.views import (
    contact_view,
    normal_rate,
    tangential_rate,
    view_without_slip,
)
from flocsim.state.bodies import ANGLE
from flocsim.state.contacts import CLOSED
from flocsim.state.work import NEW, NOW

AT_LIMIT = 1.0 - 1e-9
"""A displacement counts as at its limit from this fraction of it on: rounding must not make it
stick."""


def turn_of_normal(work, state, row):
    """Return the angle by which the normal of a pair has turned from now to a state, within ±π
    [rad]."""
    g = work.geometry
    ox, oy = g[NOW, row].normal_x, g[NOW, row].normal_y
    nx, ny = g[state, row].normal_x, g[state, row].normal_y
    return math.atan2(ox * ny - oy * nx, ox * nx + oy * ny)


def slip_of_motion(scene, work, state, row):
    """Return the growth of ξ from now to a state at the present gap [m]; both states are located.

    D and r are those of now; see slip_rate_of_gap_change for the rest.
    """
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    g = work.geometry
    radius_a, radius_b = work.candidates[row].vertex_radius, work.candidates[row].edge_radius
    gap = g[NOW, row].gap
    turn_a = work.place[state, a, ANGLE] - work.place[NOW, a, ANGLE]
    turn_b = work.place[state, b, ANGLE] - work.place[NOW, b, ANGLE]
    # The tangent's orientation along the edge is that of a state whose foot lies inside it: now or
    # then.
    side_state = NOW if g[NOW, row].turning == 0.0 else state
    foot_path = g[side_state, row].side * (g[state, row].foot - g[NOW, row].foot)
    normal_turn = turn_of_normal(work, state, row) - turn_b
    rolling = (radius_a + 0.5 * gap) * (turn_b - turn_a)
    return foot_path + (radius_a + radius_b + gap) * normal_turn + rolling


def slip_rate_of_gap_change(scene, work, state, row):
    """Return the remaining rate of ξ in a state, due to the change of the gap since now [m/s]."""
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    g, spin_b = work.geometry, work.velocity[state, b, ANGLE]
    radius_a, radius_b = work.candidates[row].vertex_radius, work.candidates[row].edge_radius
    gap, gap_change = g[state, row].gap, g[state, row].gap - g[NOW, row].gap
    relative_spin = spin_b - work.velocity[state, a, ANGLE]
    # (D − D_now) (dφ/dt − ω_b) + (r − r_now) (ω_b − ω_a), with D − D_now = gap change and r − r_now
    # half of it.
    normal_turn = 0.0
    if g[state, row].turning != 0.0:
        # The normal turns against the edge only at an end, where the foot rests and v_t is turning
        # plus rolling.
        rolling = (radius_a + 0.5 * gap) * relative_spin
        normal_turn = (tangential_rate(work, state, row) - rolling) / (radius_a + radius_b + gap)
    return gap_change * (normal_turn + 0.5 * relative_spin)


def slip_limit_at(scene, work, state, row):
    """Return the largest |ξ| that friction bears in a state [m]."""
    return slip_limit(scene, contact_view(scene, work, state, row))


def limit_slope(scene, work, state, row):
    """Return the derivative of that limit with respect to the overlap [-], by a difference."""
    view = contact_view(scene, work, state, row)
    # The step is far above rounding of the limit, and far below any overlap that matters.
    increment = 1e-6 * abs(view.overlap) + 1e-15
    more = slip_limit(scene, view_without_slip(view, view.overlap + increment, view.overlap_rate))
    now = slip_limit(scene, view_without_slip(view, view.overlap, view.overlap_rate))
    return (more - now) / increment if more > now else 0.0


def excess_slip_rate(scene, work, state, row, side):
    """Return s v_t − dL/dt [m/s]: positive while a contact at its limit goes on sliding in
    direction s."""
    growth = -normal_rate(work, state, row) * limit_slope(scene, work, state, row)
    return side * tangential_rate(work, state, row) - growth


def limited_slip(scene, work, state, row, sticking_slip):
    """Return ξ of a closed pair in a state [m]: ``sticking_slip`` if it sticks, else its limit."""
    side = work.candidates[row].slide_direction
    if side == 0:
        return sticking_slip
    return side * slip_limit_at(scene, work, state, row)


def sliding_direction(scene, work, row):
    """Return the direction ±1 in which a closed pair slides from now on, 0 if it sticks.

    ξ is set to its limit where it has reached that.
    """
    limit, side = slip_limit_at(scene, work, NOW, row), work.candidates[row].slide_direction
    # A sticking pair below its limit stays in that mode.
    if side == 0:
        slip = work.slip[NOW, row]
        if abs(slip) < AT_LIMIT * limit:
            return 0
        rate = tangential_rate(work, NOW, row)
        side = 1 if slip > 0.0 or (slip == 0.0 and rate > 0.0) else -1
    work.slip[NOW, row] = side * limit
    return side if excess_slip_rate(scene, work, NOW, row, side) > 0.0 else 0


def set_sliding(scene, work):
    """Set the sliding mode of all closed pairs; return True if any has changed."""
    changed = False
    if has(scene, SLIP_LIMIT):
        for row in range(work.tally.candidates):
            candidate = work.candidates[row]
            side = sliding_direction(scene, work, row) if candidate.contact_mode == CLOSED else 0
            changed = changed or candidate.slide_direction != side
            candidate.slide_direction = side
    return changed


def limit_slips(scene, work):
    """Clip the displacements of closed pairs in NEW to their limits.

    This is for methods whose steps do not end where a contact begins to slide.
    """
    if not has(scene, SLIP_LIMIT):
        return
    for row in range(work.tally.candidates):
        if work.candidates[row].contact_mode == CLOSED:
            limit = slip_limit_at(scene, work, NEW, row)
            work.slip[NEW, row] = min(max(work.slip[NEW, row], -limit), limit)


def slip_transition(scene, work, row, step):
    """Return the violation of a pair's stick or slide mode at the end of a step, and where it
    began.

    The violation is a length [m]: how far ξ exceeds its limit, or how far the contact has slid
    backwards. The second value is the fraction of the step; (0, 1) if the mode still holds.
    """
    side = work.candidates[row].slide_direction
    # Sticking: |ξ| must stay below its limit.
    if side == 0:
        before = slip_limit_at(scene, work, NOW, row) - abs(work.slip[NOW, row])
        after = slip_limit_at(scene, work, NEW, row) - abs(work.slip[NEW, row])
        if after >= 0.0:
            return 0.0, 1.0
        return -after, limit_crossing(scene, work, row, step, before, after)
    # Sliding: the excess rate must stay positive; it is interpolated linearly.
    before = excess_slip_rate(scene, work, NOW, row, side)
    after = excess_slip_rate(scene, work, NEW, row, side)
    if after >= 0.0:
        return 0.0, 1.0
    share = max(before, 0.0) / (max(before, 0.0) - after)
    return -0.5 * after * step * (1.0 - share), share


def limit_crossing(scene, work, row, step, before, after):
    """Return the fraction of the step at which a sticking pair reaches its limit.

    ``before`` and ``after`` are the margins L − |ξ| at both ends [m], after < 0. The margin is
    interpolated by the cubic through values and rates there, and its root bisected.
    """
    side = 1 if work.slip[NEW, row] > 0.0 else -1
    start_rate = step * excess_slip_rate(scene, work, NOW, row, side)
    end_rate = step * excess_slip_rate(scene, work, NEW, row, side)
    before = max(before, 0.0)
    low, high = 0.0, 1.0
    for _ in range(40):
        share = 0.5 * (low + high)
        rest = 1.0 - share
        # Hermite basis: values before and after, slopes −start_rate and −end_rate.
        value = (
            rest * rest * (1.0 + 2.0 * share) * before + share * share * (3.0 - 2.0 * share) * after
        )
        value += share * rest * (share * end_rate - rest * start_rate)
        if value > 0.0:
            low = share
        else:
            high = share
    return high


GRAZING_STIFFNESS_RATIO = 1e5
"""K of a grazing pair over the resistance of the step's own system (inertia, drag, other contacts)
to its gap. With 1e5 the gap changes by 1e-5 of what it would without being held."""


def grazing_force(work, state, row):
    """Return T = T₀ − K d(gap)/dt of a grazing pair in a state [N]."""
    contact = work.contacts[row]
    force = contact.grazing_force
    if state == NOW:
        return force
    return force - contact.grazing_resistance * normal_rate(work, state, row)


def gap_responses(scene, work, row):
    """Return the acceleration of the gap per unit normal and per unit tangential force on a pair
    alone [1/kg].

    The second is not zero where the contact point lies beside the line of the centroids.
    """
    candidate, geometry = work.candidates[row], work.geometry[NOW, row]
    normal = tangential = 0.0
    for body, arm_n, arm_t in (
        (candidate.vertex_body, geometry.vertex_arm_n, geometry.vertex_arm_t),
        (candidate.edge_body, geometry.edge_arm_n, geometry.edge_arm_t),
    ):
        if scene.bodies[body].free == 1.0:
            normal += 1.0 / scene.bodies[body].mass + arm_n * arm_n / scene.bodies[body].inertia
            tangential += arm_n * arm_t / scene.bodies[body].inertia
    return normal, tangential
