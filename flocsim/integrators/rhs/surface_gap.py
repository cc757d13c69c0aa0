"""The gap of two outlines as a smooth function of where the bodies are, and what follows from it.

The closest pair of features changes as bodies move, and a force that follows it jumps there, from
one end of an edge to the other; repulsion makes an endless chatter of that. Surface forces act at
the soft minimum over all near pairs k instead, ℓ being a length far shorter than that over which
the forces change:

    u(g̃) = −ln Σ exp(−u(g_k)),  du/dg = 1/ℓ(g),  force F(g̃), of which the share
    s_k = ∂g̃/∂g_k = ℓ(g̃)/ℓ(g_k) exp(u(g̃) − u(g_k)) acts through pair k:

force and torque of the one potential W(g̃), W' = −F. With one ℓ for all gaps that is
g̃ = −ℓ ln Σ exp(−g_k/ℓ). The force is off by no more than LARGEST_BIAS (forces/outline.py).
"""

import math

from flocsim.geometry.contact.candidates import core_radius, relative_speed
from flocsim.geometry.contact.points import length_of, locate_polygons, separation, turn_bodies
from flocsim.integrators.rhs.views import centre_line, normal_rate, pair_view
from flocsim.state.bodies import ANGLE
from flocsim.state.contacts import OPEN
from flocsim.state.work import NEW, NOW

RANGE = 40.0
"""Pairs whose u is so much above the least have no share: exp(−40) is below rounding."""

LOOK_AHEAD = 1.25
"""Pairs that could come near in a step so many times as long are near in it."""


def length_at(scene, gap):
    """ℓ at a gap [m]."""
    shortest, growth, end = scene.smoothing
    return shortest + growth * min(max(gap, 0.0), end)


def measure_of(scene, gap):
    """u at a gap."""
    shortest, growth, end = scene.smoothing
    if gap <= 0.0 or growth == 0.0:
        return gap / shortest
    near = min(gap, end)
    found = math.log1p(growth * near / shortest) / growth
    return found + (gap - near) / (shortest + growth * end)


def gap_of(scene, measure):
    """The gap with that u [m]."""
    shortest, growth, end = scene.smoothing
    if measure <= 0.0 or growth == 0.0:
        return measure * shortest
    near = min(measure, math.log1p(growth * end / shortest) / growth)
    gap = shortest * math.expm1(growth * near) / growth
    return gap + (measure - near) * (shortest + growth * end)


def reach_of(scene, gap):
    """The gap up to which a pair may have a share where the least gap is this one [m]: that of
    RANGE more."""
    shortest, growth, end = scene.smoothing
    if growth == 0.0 or gap <= 0.0:
        return gap_of(scene, measure_of(scene, gap) + RANGE)
    if gap < end:
        # u goes with ln(1 + growth g/shortest) up to the end, where the power is met or not.
        start = shortest / growth
        reach = (gap + start) * math.exp(growth * RANGE) - start
        if reach <= end:
            return reach
        return gap_of(scene, measure_of(scene, gap) + RANGE)
    return gap + RANGE * (shortest + growth * end)


def run_end(work, row):
    """The end of the run of rows that belong to the same two bodies as this one."""
    pair, end = work.candidates[row].pair, row + 1
    while end < work.tally.candidates and work.candidates[end].pair == pair:
        end += 1
    return end


def least_row(work, state, row, end):
    """The row of two bodies with the least gap."""
    least = row
    for each in range(row + 1, end):
        if work.geometry[state, each].gap < work.geometry[state, least].gap:
            least = each
    return least


def least_gap(work, state, row, end):
    """The least gap of the rows of two bodies [m]."""
    return work.geometry[state, least_row(work, state, row, end)].gap


def flag_near(scene, work, state, step):
    """Flag the pairs that may have a share of a surface force within a step of this size [s]."""
    row = 0
    while row < work.tally.candidates:
        end = run_end(work, row)
        a, b = work.candidates[row].vertex_body, work.candidates[row].edge_body
        way = LOOK_AHEAD * step * relative_speed(scene, work, a, b) if step > 0.0 else 0.0
        reach = reach_of(scene, least_gap(work, state, row, end)) + 2.0 * way
        for each in range(row, end):
            near = work.geometry[state, each].gap <= reach
            work.candidates[each].near = 1 if near else 0
        row = end


def overlooked(scene, work):
    """Whether a pair that was not flagged has a share at the end of the step."""
    row = 0
    while row < work.tally.candidates:
        end = run_end(work, row)
        reach = reach_of(scene, least_gap(work, NEW, row, end))
        for each in range(row, end):
            if work.candidates[each].near == 0 and work.geometry[NEW, each].gap < reach:
                return True
        row = end
    return False


def way_to(scene, work, state, a, b):
    """How far the cores of two bodies may have moved against each other from now to a state [m]."""
    x, y = separation(scene, work, state, a, b)
    x_now, y_now = separation(scene, work, NOW, a, b)
    way = length_of(x - x_now, y - y_now)
    for body in (a, b):
        turn = abs(work.place[state, body, ANGLE] - work.place[NOW, body, ANGLE])
        way += turn * core_radius(scene, body)
    return way


def locate_sharing(scene, work, state):
    """Geometry, in a stage, of closed pairs and of flagged ones that may have a share of a surface
    force there; the gap of others counts as without end."""
    turn_bodies(work, state)
    row = 0
    while row < work.tally.candidates:
        end = run_end(work, row)
        a, b = work.candidates[row].vertex_body, work.candidates[row].edge_body
        way = way_to(scene, work, state, a, b)
        reach = reach_of(scene, least_gap(work, NOW, row, end) + way) + way
        for each in range(row, end):
            closed = work.candidates[each].closed != OPEN
            if closed or work.candidates[each].near == 1:
                if closed or work.geometry[NOW, each].gap <= reach:
                    locate_polygons(scene, work, state, each)
                else:
                    work.geometry[state, each].gap = math.inf
        row = end


def soften(scene, work, state, row, end):
    """(g̃ [m], its rate [m/s]) of two bodies, the shares of their rows written down."""
    geometry = work.geometry
    least, total, rate = math.inf, 0.0, 0.0
    for each in range(row, end):
        if work.candidates[each].near == 1:
            least = min(least, geometry[state, each].gap)
    reach = reach_of(scene, least)
    for each in range(row, end):
        gap, share = geometry[state, each].gap, 0.0
        if work.candidates[each].near == 1 and gap <= reach:
            share = 1.0
            if gap > least:
                share = math.exp(measure_of(scene, least) - measure_of(scene, gap))
        geometry[state, each].share = share
        total += share
    gap = least
    if total > 1.0:
        gap = gap_of(scene, measure_of(scene, least) - math.log(total))
    length = length_at(scene, gap)
    for each in range(row, end):
        if geometry[state, each].share > 0.0:
            own = length_at(scene, geometry[state, each].gap)
            geometry[state, each].share *= length / (own * total)
            rate += geometry[state, each].share * normal_rate(work, state, each)
    work.tally.soft_gap = gap
    return gap, rate


def sharpness(scene, gap):
    """(1 + dℓ/dg)/ℓ at a gap [1/m]: how fast shares change with it."""
    _, growth, end = scene.smoothing
    slope = growth if 0.0 < gap < end else 0.0
    return (1.0 + slope) / length_at(scene, gap)


def surface_view(scene, work, time, state, row, end):
    """The PairView of the two bodies of a run of rows, their gap being g̃."""
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    gap, rate = soften(scene, work, state, row, end)
    _, _, distance = centre_line(scene, work, state, a, b)
    return pair_view(scene, time, a, b, gap, rate, distance)


def mean_direction(work, row, end):
    """Derivatives of g̃ by the places of both bodies of the first row, now."""
    g, first = work.geometry, work.candidates[row].vertex_body
    x, y, turn_a, turn_b = 0.0, 0.0, 0.0, 0.0
    for each in range(row, end):
        share = g[NOW, each].share
        arm_v, arm_e = g[NOW, each].vertex_arm_n, g[NOW, each].edge_arm_n
        if work.candidates[each].vertex_body == first:
            x, y = (
                x + share * g[NOW, each].normal_x,
                y + share * g[NOW, each].normal_y,
            )
            turn_a, turn_b = turn_a + share * arm_v, turn_b - share * arm_e
        else:
            x, y = (
                x - share * g[NOW, each].normal_x,
                y - share * g[NOW, each].normal_y,
            )
            turn_a, turn_b = turn_a - share * arm_e, turn_b + share * arm_v
    return (x, y, turn_a), (-x, -y, turn_b)
