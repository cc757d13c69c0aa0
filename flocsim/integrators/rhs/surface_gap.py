"""The gap of two outlines as a smooth function of the bodies' positions, and its derivatives.

The closest pair of features changes as bodies move, and a force through it would jump, for example
from one end of an edge to the other; repulsion turns such a jump into endless chatter. Surface
forces therefore act at a soft minimum over all near pairs k of features. With a smoothing length ℓ
far shorter than the length over which the forces change, and u defined by du/dg = 1/ℓ(g),

    u(g̃) = −ln Σ exp(−u(g_k)),   F = F(g̃),

and the fraction s_k = ∂g̃/∂g_k = ℓ(g̃)/ℓ(g_k) exp(u(g̃) − u(g_k)) of F acts through pair k. Force
and torque thus derive from one potential W(g̃), W' = −F, and conserve energy. For a constant ℓ this
is g̃ = −ℓ ln Σ exp(−g_k/ℓ). ℓ grows in proportion to the gap, ℓ = ℓ₀ + growth · g up to an end;
forces are biased by at most LARGEST_BIAS (forces/outline.py).
"""

import math

from flocsim.geometry.contact.candidates import core_radius, relative_speed
from flocsim.geometry.contact.points import length_of, locate_polygons, separation, update_rotations
from flocsim.integrators.rhs.error import ROUNDING
from flocsim.integrators.rhs.views import centre_line, normal_rate, pair_view
from flocsim.state.bodies import ANGLE
from flocsim.state.contacts import OPEN
from flocsim.state.work import NEW, NOW


def smoothing_length(scene, gap):
    """Return ℓ at a gap [m]."""
    shortest, growth, end = scene.smoothing
    return shortest + growth * min(max(gap, 0.0), end)


def scaled_gap(scene, gap):
    """Return u at a gap [-]: its integral, ln(1 + growth g/ℓ₀)/growth where ℓ grows."""
    shortest, growth, end = scene.smoothing
    if gap <= 0.0 or growth == 0.0:
        return gap / shortest
    # Logarithmic while ℓ grows, linear beyond.
    near = min(gap, end)
    found = math.log1p(growth * near / shortest) / growth
    return found + (gap - near) / (shortest + growth * end)


def gap_from_scaled(scene, measure):
    """Return the gap with a given u [m], the inverse of scaled_gap."""
    shortest, growth, end = scene.smoothing
    if measure <= 0.0 or growth == 0.0:
        return measure * shortest
    near = min(measure, math.log1p(growth * end / shortest) / growth)
    gap = shortest * math.expm1(growth * near) / growth
    return gap + (measure - near) * (shortest + growth * end)


def share_reach(scene, gap):
    """Return the gap up to which pairs may have a share if the least gap is this one [m]."""
    # A share exp(u(gap) − u) below rounding is none.
    return gap_from_scaled(scene, scaled_gap(scene, gap) - math.log(ROUNDING))


def pair_end(work, row):
    """Return the end of the run of candidate rows that belong to the same two bodies as this
    one."""
    pair, end = work.candidates[row].pair, row + 1
    while end < work.tally.candidates and work.candidates[end].pair == pair:
        end += 1
    return end


def least_row(work, state, row, end):
    """Return the row of two bodies with the least gap."""
    least = row
    for each in range(row + 1, end):
        if work.geometry[state, each].gap < work.geometry[state, least].gap:
            least = each
    return least


def least_gap(work, state, row, end):
    """Return the least gap of the rows of two bodies [m]."""
    return work.geometry[state, least_row(work, state, row, end)].gap


def flag_near(scene, work, state, step):
    """Flag the pairs of features that may have a share of a surface force within a step of this
    size [s]."""
    row = 0
    while row < work.tally.candidates:
        end = pair_end(work, row)
        a, b = work.candidates[row].vertex_body, work.candidates[row].edge_body
        displacement = step * relative_speed(scene, work, a, b) if step > 0.0 else 0.0
        # Both this pair's gap and the least one may change by the displacement.
        reach = share_reach(scene, least_gap(work, state, row, end)) + 2.0 * displacement
        for each in range(row, end):
            # Flags stay fixed in the step.
            near = work.geometry[state, each].gap <= reach
            work.candidates[each].surface_active = 1 if near else 0
        row = end


def missed_sharing(scene, work):
    """Return True if a pair that was not flagged as near has a share at the end of the step."""
    row = 0
    while row < work.tally.candidates:
        end = pair_end(work, row)
        reach = share_reach(scene, least_gap(work, NEW, row, end))
        for each in range(row, end):
            if work.candidates[each].surface_active == 0 and work.geometry[NEW, each].gap < reach:
                return True
        row = end
    return False


def core_displacement(scene, work, state, a, b):
    """Return how far the cores of two bodies may have moved relative to each other from now to a
    state [m]."""
    x, y = separation(scene, work, state, a, b)
    x_now, y_now = separation(scene, work, NOW, a, b)
    displacement = length_of(x - x_now, y - y_now)
    # Rotation moves core points by the core radius at most.
    for body in (a, b):
        turn = abs(work.place[state, body, ANGLE] - work.place[NOW, body, ANGLE])
        displacement += turn * core_radius(scene, body)
    return displacement


def locate_sharing(scene, work, state):
    """Locate, in a stage, closed pairs and those flagged ones that may have a share of a surface
    force.

    The gap of other flagged pairs is set to inf, which saves locating them.
    """
    update_rotations(work, state)
    row = 0
    while row < work.tally.candidates:
        end = pair_end(work, row)
        a, b = work.candidates[row].vertex_body, work.candidates[row].edge_body
        displacement = core_displacement(scene, work, state, a, b)
        reach = share_reach(scene, least_gap(work, NOW, row, end) + displacement) + displacement
        for each in range(row, end):
            closed = work.candidates[each].contact_mode != OPEN
            if closed or work.candidates[each].surface_active == 1:
                if closed or work.geometry[NOW, each].gap <= reach:
                    locate_polygons(scene, work, state, each)
                else:
                    work.geometry[state, each].gap = math.inf
        row = end


def evaluate_smooth_gap(scene, work, state, row, end):
    """Return (g̃ [m], its rate [m/s]) of two bodies; the fractions s_k of their rows are stored."""
    geometry = work.geometry
    # The least gap comes first, so that exp() never overflows.
    least, total, rate = math.inf, 0.0, 0.0
    for each in range(row, end):
        if work.candidates[each].surface_active == 1:
            least = min(least, geometry[state, each].gap)
    # s_k ∝ exp(u(g_min) − u(g_k)), summed to Σ.
    reach = share_reach(scene, least)
    for each in range(row, end):
        gap, share = geometry[state, each].gap, 0.0
        if work.candidates[each].surface_active == 1 and gap <= reach:
            share = 1.0
            if gap > least:
                share = math.exp(scaled_gap(scene, least) - scaled_gap(scene, gap))
        geometry[state, each].force_share = share
        total += share
    # u(g̃) = u(g_min) − ln Σ.
    gap = least
    if total > 1.0:
        gap = gap_from_scaled(scene, scaled_gap(scene, least) - math.log(total))
    # Normalise: s_k = ℓ(g̃)/ℓ(g_k) · weight/Σ, and dg̃/dt = Σ s_k dg_k/dt.
    length = smoothing_length(scene, gap)
    for each in range(row, end):
        if geometry[state, each].force_share > 0.0:
            own = smoothing_length(scene, geometry[state, each].gap)
            geometry[state, each].force_share *= length / (own * total)
            rate += geometry[state, each].force_share * normal_rate(work, state, each)
    work.tally.smooth_gap = gap
    return gap, rate


def share_sensitivity(scene, gap):
    """Return κ = (1 + dℓ/dg)/ℓ at a gap [1/m]: −d ln s_k/dg_k."""
    _, growth, end = scene.smoothing
    slope = growth if 0.0 < gap < end else 0.0
    return (1.0 + slope) / smoothing_length(scene, gap)


def surface_view(scene, work, time, state, row, end):
    """Return the PairView of the two bodies of a run of rows, their gap being g̃."""
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    gap, rate = evaluate_smooth_gap(scene, work, state, row, end)
    _, _, distance = centre_line(scene, work, state, a, b)
    return pair_view(scene, time, a, b, gap, rate, distance)


def smooth_gap_gradient(work, row, end):
    """Return the derivatives of g̃ by the coordinates of both bodies of the first row."""
    g, first = work.geometry, work.candidates[row].vertex_body
    x, y, turn_a, turn_b = 0.0, 0.0, 0.0, 0.0
    for each in range(row, end):
        share = g[NOW, each].force_share
        arm_v, arm_e = g[NOW, each].vertex_arm_n, g[NOW, each].edge_arm_n
        vertex_turn, edge_turn = share * arm_v, -share * arm_e
        # Rows list a vertex of either body; the normal of the others points the other way.
        if work.candidates[each].vertex_body != first:
            share, vertex_turn, edge_turn = -share, edge_turn, vertex_turn
        x, y = x + share * g[NOW, each].normal_x, y + share * g[NOW, each].normal_y
        turn_a, turn_b = turn_a + vertex_turn, turn_b + edge_turn
    return (x, y, turn_a), (-x, -y, turn_b)
