"""Where the smaller one of two outlines is looked at: nodes along its pieces, from feet of the
other one's pieces on (flocsim.geometry.shapes.pieces says how they are spaced).

Which nodes there are changes little by little with where the bodies are: jumps of a force cost
steps. So panels end wherever the gap has a bend, and lose it again where it no longer counts.
"""

import math

from flocsim.compiler.linker import loops_apart
from flocsim.geometry.contact.attraction import arc_ends
from flocsim.geometry.shapes.pieces import (
    at_parameter,
    distance_to,
    ends_of,
    foot_of,
    from_core,
    parameter_before,
    piece_at,
)
from flocsim.state.outlines import (
    MOST_FEET,
)

SAME = 1e-3
"""Of the gap: pieces of the other outline that are as near as that are both the nearest, and feet
that are as near to each other are one."""

MOST_HALVES = 40
"""How often a way along a piece is halved: far below any length that counts."""

MOST_PANELS = 4
"""Of one side of a foot."""

BENDS = 30.0
"""Panels end at bends of the gap up to so many times the gap at their foot."""

LEAST_WIDTH = 1e-3
"""Of t: no panel is narrower."""

LEAST_GROWTH = 1e-6
"""Of the gap: what grows by less is flat."""


def gap_from(scene, work, x, y):
    """How far the other outline, as far as it is around, is from a point [m]."""
    near, gap = work.near, math.inf
    for j in range(near.around[0]):
        gap = min(gap, distance_to(x, y, piece_at(scene.pieces, near.around[1 + j])))
    return gap


def find_feet(scene, work, piece, inset, lens):
    """Write the feet of a piece to ``work.feet``, in their order; how many there are. They are the
    places, ends among them, from where the gap within the lens grows either way."""
    near, count = work.near, 0
    first, last = ends_of(piece)
    for j in range(near.around[0]):
        other = piece_at(scene.pieces, near.around[1 + j])
        parameter = min(max(foot_of(piece, other), first), last)
        x, y, _, _, metres = at_parameter(piece, parameter)
        gap = distance_to(x, y, other)
        # Only where the other is what lies nearest there.
        same = SAME * (gap + inset)
        if gap < lens and gap <= gap_from(scene, work, x, y) + same:
            count = add_foot(work.feet, count, parameter, same / metres)
    return count


def add_foot(feet, count, parameter, same):
    """Put a foot among those found so far, in their order, unless one is as near as ``same``; how
    many there are then."""
    place = count
    while place > 0 and feet[place - 1] > parameter:
        place -= 1
    if place > 0 and parameter - feet[place - 1] <= same:
        return count
    if (place < count and feet[place] - parameter <= same) or count == MOST_FEET:
        return count
    for k in range(count, place, -1):
        feet[k] = feet[k - 1]
    feet[place] = parameter
    return count + 1


def way_to_gap(scene, work, piece, foot, way, wanted):
    """How far along a piece from a foot, in its parameter and ``way`` at most, the gap has grown to
    the one that is wanted [m]: continuous in where the bodies are, as the quadrature is then."""
    x, y, _, _, _ = at_parameter(piece, foot + way)
    beyond = gap_from(scene, work, x, y)
    if beyond <= wanted:
        return way
    for _ in range(MOST_HALVES):
        x, y, _, _, _ = at_parameter(piece, foot + 0.5 * way)
        gap = gap_from(scene, work, x, y)
        if gap <= wanted:
            return 0.5 * way * (1.0 + (wanted - gap) / (beyond - gap))
        beyond = gap
        way *= 0.5
    return way


@loops_apart
def write_nodes(nodes, rules, count, piece, foot, scale, low, high, order):
    """Write the nodes of a panel behind so many others: t from ``low`` to ``high``, where a piece
    goes on from a foot by 2 t/(1 − t²) times a scale in its parameter."""
    # In loops over few rows each, so that several nodes are taken at once.
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    for k in range(order):
        t = middle + half * rules[order, 0, k]
        shrunk = 1.0 / (1.0 - t * t)
        part = 2.0 * half * rules[order, 1, k] * abs(scale) * (1.0 + t * t) * shrunk * shrunk
        nodes.weight[count + k] = part
        nodes.attraction[count + k] = foot + 2.0 * scale * t * shrunk
    if piece.bend == 0.0:
        for k in range(order):
            parameter = nodes.attraction[count + k]
            nodes.x[count + k] = piece.x + parameter * piece.way_x
            nodes.y[count + k] = piece.y + parameter * piece.way_y
        for k in range(order):
            nodes.normal_x[count + k] = piece.way_y
            nodes.normal_y[count + k] = -piece.way_x
    else:
        for k in range(order):
            parameter = nodes.attraction[count + k]
            shrunk = 1.0 / (1.0 + parameter * parameter)
            c, s = (1.0 - parameter * parameter) * shrunk, 2.0 * parameter * shrunk
            nodes.normal_x[count + k] = c * piece.way_x - s * piece.way_y
            nodes.normal_y[count + k] = c * piece.way_y + s * piece.way_x
            nodes.weight[count + k] *= 2.0 * piece.bend * shrunk
        for k in range(order):
            nodes.x[count + k] = piece.x + piece.bend * nodes.normal_x[count + k]
            nodes.y[count + k] = piece.y + piece.bend * nodes.normal_y[count + k]
    for k in range(order):
        nodes.gap[count + k], nodes.attraction[count + k] = math.inf, 0.0


def order_of(width, nearness):
    """How many nodes of Gauss's rule a panel of so much t takes: what it is taken of has its poles
    near ±i, from where the error is below 1e-7 of the whole; ``nearness``: the least gap anywhere
    over that where the panel begins, with which its share in the whole falls."""
    if nearness < 0.2:
        return 8 if nearness > 0.03 and width > 0.3 else 4
    if width > 0.6:
        return 16 if width > 0.8 else 12
    if width > 0.3:
        return 8
    return 6 if width > 0.1 else 4


def t_after(share):
    """t where a piece has gone on from a foot by so many times its scale: 2 t/(1 − t²) of it."""
    return share / (1.0 + math.sqrt(1.0 + share * share))


def growth_at(scene, work, piece, foot):
    """(gap, its slope along a piece [-], that of the slope [1/m], metres for a unit of the
    parameter) at a foot."""
    x, y, nx, ny, metres = at_parameter(piece, foot)
    near, gap, slope, rise = work.near, math.inf, 0.0, 0.0
    for j in range(near.around[0]):
        other = piece_at(scene.pieces, near.around[1 + j])
        dx, dy, end = from_core(x, y, other)
        distance = math.sqrt(dx * dx + dy * dy)
        if distance - other.inward < gap:
            gap = distance - other.inward
            away = (nx * dx + ny * dy) / distance
            slope = (nx * dy - ny * dx) / distance
            rise = -away / piece.bend if piece.bend > 0.0 else 0.0
            rise += away * away / distance if end else 0.0
    return gap, slope, rise, metres


def put_side(scene, work, count, piece, foot, growth, end, inset, lens, least):
    """Put the nodes of a piece from a foot, with its growth_at, to an end after so many others; how
    many there are then. ``least``: gap and inset where the bodies are nearest [m]."""
    reach = way_to_gap(scene, work, piece, foot, end - foot, lens)
    gap, slope, rise, metres = growth
    parted, slope = gap + inset, max(slope if end > foot else -slope, 0.0)
    # Where the gap, as it grows there, has become twice as large; and as it has grown by then.
    whole = abs(reach) * metres
    root = slope + math.sqrt(slope * slope + 2.0 * max(rise, 0.0) * parted)
    way = min(2.0 * parted / max(root, parted / whole), whole)
    x, y, _, _, _ = at_parameter(piece, foot + math.copysign(way / metres, reach))
    grown = (gap_from(scene, work, x, y) - gap) / parted
    scale = way / math.sqrt(max(grown, LEAST_GROWTH))
    last = t_after(whole / scale)
    scale, low = math.copysign(scale / metres, reach), 0.0
    bends = min(BENDS * parted, lens)
    for panel in range(1, MOST_PANELS + 1):
        high = last
        if panel < MOST_PANELS:
            high = next_bend(scene, work, piece, foot, scale, low, last, bends)
        order = order_of(high - low, least / parted)
        write_nodes(work.nodes, work.rules, count, piece, foot, scale, low, high, order)
        count, low = count + order, high
        if high == last:
            break
    return count


def next_bend(scene, work, piece, foot, scale, low, last, gap):
    """The first t behind ``low`` at which what of the other outline is nearest, up to a gap [m],
    goes over from one of its pieces into the next: the gap bends there; ``last`` where it does not
    before."""
    near, bend, count = work.near, last, work.near.around[0]
    for j in range(count):
        other = piece_at(scene.pieces, near.around[1 + j])
        if other.bend > 0.0:
            for end in arc_ends(other):
                met = parameter_before(piece, other.x, other.y, end, other.bend + gap)
                bend = earlier(met, foot, scale, low, bend)
        else:
            # Where two faces meet in a reflex corner, on the bisector of their normals.
            behind = piece_at(scene.pieces, near.around[1 + (j + 1) % count])
            x, y = other.x + other.half * other.way_x, other.y + other.half * other.way_y
            dx = behind.x - behind.half * behind.way_x - x
            dy = behind.y - behind.half * behind.way_y - y
            if behind.bend == 0.0 and dx * dx + dy * dy < 1e-12 * other.half * other.half:
                nx, ny = other.way_y + behind.way_y, -other.way_x - behind.way_x
                length = math.sqrt(nx * nx + ny * ny)
                met = parameter_before(piece, x, y, (nx / length, ny / length), gap)
                bend = earlier(met, foot, scale, low, bend)
    return bend


def earlier(met, foot, scale, low, bend):
    """t at a parameter, or another one where that is earlier, or this one not behind ``low``."""
    if met == math.inf:
        return bend
    t = t_after((met - foot) / scale)
    return t if low + LEAST_WIDTH < t < bend else bend
