"""The gap of two outlines as a smooth function of where the bodies are, and what follows from it.

The closest pair of features changes as bodies move, and a force that follows it jumps there, from
one end of an edge to the other; repulsion makes an endless chatter of that. Surface forces act at
the soft minimum over all near pairs k instead,

    g̃ = −ℓ ln Σ exp(−g_k/ℓ),  force F(g̃), of which the share exp(−g_k/ℓ)/Σ acts through pair k:

force and torque of the one potential W(g̃), W' = −F. It lies below the least gap by no more than
ℓ ln K with K pairs; ℓ is chosen so that the force is off by no more than LARGEST_BIAS (scene_of).
"""

import math

from flocsim.arrays import (
    CANDIDATES,
    EDGE_ARM_N,
    EDGE_BODY,
    GAP,
    NEAR,
    NEW,
    NORMAL_X,
    NORMAL_Y,
    NOW,
    SHARE,
    VERTEX_ARM_N,
    VERTEX_BODY,
)
from flocsim.geometry.contact.candidates import relative_speed
from flocsim.integrators.rhs.views import centre_line, normal_rate, pair_view

RANGE = 40.0
"""Pairs so many ℓ above the least gap have no share: exp(−40) is below rounding."""

LOOK_AHEAD = 2.0
"""Pairs that could come near in a step so many times as long are near in it."""


def run_end(work, row):
    """The end of the run of rows that belong to the same two bodies as this one."""
    a, b = work.candidates[row, VERTEX_BODY], work.candidates[row, EDGE_BODY]
    end = row + 1
    while end < work.tally[CANDIDATES]:
        c, d = work.candidates[end, VERTEX_BODY], work.candidates[end, EDGE_BODY]
        if not ((c == a and d == b) or (c == b and d == a)):
            break
        end += 1
    return end


def least_gap(work, state, row, end):
    """The least gap of the rows of two bodies [m]."""
    least = math.inf
    for each in range(row, end):
        least = min(least, work.geometry[state, each, GAP])
    return least


def flag_near(scene, work, state, step):
    """Flag the pairs that may have a share of a surface force within a step of this size [s]."""
    row = 0
    while row < work.tally[CANDIDATES]:
        end = run_end(work, row)
        a, b = work.candidates[row, VERTEX_BODY], work.candidates[row, EDGE_BODY]
        way = LOOK_AHEAD * step * relative_speed(scene, work, a, b) if step > 0.0 else 0.0
        reach = least_gap(work, state, row, end) + RANGE * scene.smoothing + 2.0 * way
        for each in range(row, end):
            near = work.geometry[state, each, GAP] <= reach
            work.candidates[each, NEAR] = 1 if near else 0
        row = end


def overlooked(scene, work):
    """Whether a pair that was not flagged has a share at the end of the step."""
    row = 0
    while row < work.tally[CANDIDATES]:
        end = run_end(work, row)
        reach = least_gap(work, NEW, row, end) + RANGE * scene.smoothing
        for each in range(row, end):
            if work.candidates[each, NEAR] == 0 and work.geometry[NEW, each, GAP] < reach:
                return True
        row = end
    return False


def soften(scene, work, state, row, end):
    """(g̃ [m], its rate [m/s]) of two bodies, the shares of their rows written down."""
    geometry = work.geometry
    least, total, rate = math.inf, 0.0, 0.0
    for each in range(row, end):
        if work.candidates[each, NEAR] == 1:
            least = min(least, geometry[state, each, GAP])
    for each in range(row, end):
        share = 0.0
        if work.candidates[each, NEAR] == 1:
            share = math.exp((least - geometry[state, each, GAP]) / scene.smoothing)
        geometry[state, each, SHARE] = share
        total += share
    for each in range(row, end):
        if geometry[state, each, SHARE] > 0.0:
            geometry[state, each, SHARE] /= total
            rate += geometry[state, each, SHARE] * normal_rate(work, state, each)
    return least - scene.smoothing * math.log(total), rate


def surface_view(scene, work, time, state, row, end):
    """The PairView of the two bodies of a run of rows, their gap being g̃."""
    a, b = work.candidates[row, VERTEX_BODY], work.candidates[row, EDGE_BODY]
    gap, rate = soften(scene, work, state, row, end)
    _, _, distance = centre_line(work, state, a, b)
    return pair_view(scene, time, a, b, gap, rate, distance)


def mean_direction(work, row, end):
    """Derivatives of g̃ by the places of both bodies of the first row, now."""
    g, first = work.geometry, work.candidates[row, VERTEX_BODY]
    x, y, turn_a, turn_b = 0.0, 0.0, 0.0, 0.0
    for each in range(row, end):
        share = g[NOW, each, SHARE]
        arm_v, arm_e = g[NOW, each, VERTEX_ARM_N], g[NOW, each, EDGE_ARM_N]
        if work.candidates[each, VERTEX_BODY] == first:
            x, y = x + share * g[NOW, each, NORMAL_X], y + share * g[NOW, each, NORMAL_Y]
            turn_a, turn_b = turn_a + share * arm_v, turn_b - share * arm_e
        else:
            x, y = x - share * g[NOW, each, NORMAL_X], y - share * g[NOW, each, NORMAL_Y]
            turn_a, turn_b = turn_a - share * arm_e, turn_b + share * arm_v
    return (x, y, turn_a), (-x, -y, turn_b)
