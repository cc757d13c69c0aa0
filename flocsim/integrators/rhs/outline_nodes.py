"""Quadrature nodes on the smaller of two outlines, graded towards the feet of the other one's
pieces.

A foot is a point of a piece from where the gap grows both ways. From each foot on, the parameter of
the piece is graded as

    s = s_foot + scale · 2 t/(1 − t²),

which resolves a pressure that falls with a power of the gap (flocsim.geometry.shapes.pieces), and
Gauss's rule is applied in t, in panels. Panels end wherever the gap has a kink, as the nearest
piece of the other outline changes. Nodes must vary continuously with the bodies' positions: jumps
of the force cost steps.
"""

import math

from flocsim.compiler.linker import loops_apart
from flocsim.geometry.contact.attraction import arc_ends
from flocsim.geometry.shapes.pieces import (
    at_parameter,
    distance_to,
    ends_of,
    foot_of,
    piece_at,
    ray_parameter,
    vector_from_core,
)
from flocsim.state.outlines import (
    MOST_FEET,
)

SAME_POINT = 1e-3
"""Fraction of the gap below which two pieces count as equally near, or two feet as one; width of a
panel, in t, below which its ends count as one."""

LEAST_GROWTH = 1e-6
"""A gap that grows by less than this fraction of itself counts as constant."""

MOST_PANELS = 4
"""Panels on one side of a foot."""

BEND_RANGE = 30.0
"""Panels end at kinks of the gap up to this multiple of the gap at their foot; those further out do
not matter."""


def gap_from(scene, work, x, y):
    """Return the distance of a point from the listed pieces of the other outline [m]."""
    near, gap = work.near, math.inf
    for j in range(near.around[0]):
        gap = min(gap, distance_to(x, y, piece_at(scene.pieces, near.around[1 + j])))
    return gap


def find_feet(scene, work, piece, inset, lens):
    """Write the feet of a piece to ``work.feet``, in order; return their number."""
    near, count = work.near, 0
    first, last = ends_of(piece)
    for j in range(near.around[0]):
        other = piece_at(scene.pieces, near.around[1 + j])
        # The closest point of the piece to each other piece, or its end.
        parameter = min(max(foot_of(piece, other), first), last)
        x, y, _, _, metres = at_parameter(piece, parameter)
        gap = distance_to(x, y, other)
        # It is a foot only where that other piece is the nearest.
        tolerance = SAME_POINT * (gap + inset)
        if gap < lens and gap <= gap_from(scene, work, x, y) + tolerance:
            count = add_foot(work.feet, count, parameter, tolerance / metres)
    return count


def add_foot(feet, count, parameter, tolerance):
    """Insert a foot in order unless one exists within ``tolerance``; return the new number."""
    place = count
    while place > 0 and feet[place - 1] > parameter:
        place -= 1
    if place > 0 and parameter - feet[place - 1] <= tolerance:
        return count
    if (place < count and feet[place] - parameter <= tolerance) or count == MOST_FEET:
        return count
    for k in range(count, place, -1):
        feet[k] = feet[k - 1]
    feet[place] = parameter
    return count + 1


def parameter_to_gap(scene, work, piece, foot, extent, target):
    """Return how far along a piece from a foot the gap has grown to ``target`` [m], at most
    ``extent``.

    In units of the piece's parameter. Continuous in the bodies' positions, as the quadrature must
    be.
    """
    x, y, _, _, _ = at_parameter(piece, foot + extent)
    beyond = gap_from(scene, work, x, y)
    if beyond <= target:
        return extent
    # Halve the range until its middle is near enough, then interpolate linearly in its outer half.
    # The foot itself is near enough (find_feet); where nothing is, as of NaN, the range ends at 0.
    while abs(extent) > 0.0:
        x, y, _, _, _ = at_parameter(piece, foot + 0.5 * extent)
        gap = gap_from(scene, work, x, y)
        if gap <= target:
            return 0.5 * extent * (1.0 + (target - gap) / (beyond - gap))
        beyond = gap
        extent *= 0.5
    return extent


@loops_apart
def write_nodes(nodes, rules, count, piece, foot, scale, low, high, order):
    """Append the nodes of a panel, t in [low, high], on a piece graded from a foot; see the
    module."""
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    for k in range(order):
        # Gauss's node and weight in t; ds/dt = 2 scale (1 + t²)/(1 − t²)².
        t = middle + half * rules[order, 0, k]
        factor = 1.0 / (1.0 - t * t)
        part = 2.0 * half * rules[order, 1, k] * abs(scale) * (1.0 + t * t) * factor * factor
        x, y, nx, ny, metres = at_parameter(piece, foot + 2.0 * scale * t * factor)
        nodes.x[count + k], nodes.y[count + k] = x, y
        nodes.normal_x[count + k], nodes.normal_y[count + k] = nx, ny
        nodes.weight[count + k] = metres * part
        nodes.gap[count + k], nodes.attraction[count + k] = math.inf, 0.0


def gauss_order(width, nearness):
    """Return the number of Gauss nodes for a panel of this width in t, for an error below 1e-7.

    The integrand has its poles near t = ±i. ``nearness`` is the least gap anywhere over that at the
    panel's beginning: the smaller it is, the less the panel counts.
    """
    if nearness < 0.2:
        return 8 if nearness > 0.03 and width > 0.3 else 4
    if width > 0.6:
        return 16 if width > 0.8 else 12
    if width > 0.3:
        return 8
    return 6 if width > 0.1 else 4


def graded_parameter(share):
    """Return t for which 2 t/(1 − t²) equals ``share``."""
    return share / (1.0 + math.sqrt(1.0 + share * share))


def gap_expansion(scene, work, piece, foot):
    """Return (gap [m], first derivative [-], second derivative [1/m], metres per unit of parameter)
    at a foot."""
    x, y, nx, ny, metres = at_parameter(piece, foot)
    near, gap, slope, second_derivative = work.near, math.inf, 0.0, 0.0
    for j in range(near.around[0]):
        other = piece_at(scene.pieces, near.around[1 + j])
        dx, dy, end = vector_from_core(x, y, other)
        distance = math.sqrt(dx * dx + dy * dy)
        if distance - other.core_depth < gap:
            gap = distance - other.core_depth
            # First and second derivative of the distance along the piece, which may be an arc
            # itself.
            away = (nx * dx + ny * dy) / distance
            slope = (nx * dy - ny * dx) / distance
            second_derivative = -away / piece.arc_radius if piece.arc_radius > 0.0 else 0.0
            second_derivative += away * away / distance if end else 0.0
    return gap, slope, second_derivative, metres


def write_side(scene, work, count, piece, foot, growth, end, inset, lens, least):
    """Append the nodes of a piece from a foot to an end; return the new count.

    ``growth`` is gap_expansion at the foot, ``least`` the least gap plus inset of the two bodies
    [m].
    """
    reach = parameter_to_gap(scene, work, piece, foot, end - foot, lens)
    gap, slope, second_derivative, metres = growth
    parted_gap, slope = gap + inset, max(slope if end > foot else -slope, 0.0)
    # Scale: where the quadratic expansion doubles the gap, corrected by the gap found there.
    full_length = abs(reach) * metres
    root = slope + math.sqrt(slope * slope + 2.0 * max(second_derivative, 0.0) * parted_gap)
    extent = min(2.0 * parted_gap / max(root, parted_gap / full_length), full_length)
    x, y, _, _, _ = at_parameter(piece, foot + math.copysign(extent / metres, reach))
    relative_growth = (gap_from(scene, work, x, y) - gap) / parted_gap
    scale = extent / math.sqrt(max(relative_growth, LEAST_GROWTH))
    # Panels from kink to kink, the last one to the lens.
    last = graded_parameter(full_length / scale)
    scale, low = math.copysign(scale / metres, reach), 0.0
    bends = min(BEND_RANGE * parted_gap, lens)
    for panel in range(1, MOST_PANELS + 1):
        high = last
        if panel < MOST_PANELS:
            high = next_bend(scene, work, piece, foot, scale, low, last, bends)
        order = gauss_order(high - low, least / parted_gap)
        write_nodes(work.nodes, work.rules, count, piece, foot, scale, low, high, order)
        count, low = count + order, high
        if high == last:
            break
    return count


def next_bend(scene, work, piece, foot, scale, low, last, gap):
    """Return the first t beyond ``low`` at which the nearest piece of the other outline changes, up
    to a gap [m]: the gap has a kink there. Return ``last`` if there is none before."""
    near, bend, count = work.near, last, work.near.around[0]
    for j in range(count):
        other = piece_at(scene.pieces, near.around[1 + j])
        # At the normals through both ends of an arc.
        if other.arc_radius > 0.0:
            for end in arc_ends(other):
                bend_parameter = ray_parameter(piece, other.x, other.y, end, other.arc_radius + gap)
                bend = earlier_bend(bend_parameter, foot, scale, low, bend)
        else:
            # Where two faces meet in a reflex corner: on the bisector of their normals.
            next_piece = piece_at(scene.pieces, near.around[1 + (j + 1) % count])
            x, y, nx, ny, _ = at_parameter(other, other.half)
            x_2, y_2, nx_2, ny_2, _ = at_parameter(next_piece, -next_piece.half)
            dx, dy = x_2 - x, y_2 - y
            if next_piece.arc_radius == 0.0 and dx * dx + dy * dy < 1e-12 * other.half * other.half:
                nx, ny = nx + nx_2, ny + ny_2
                length = math.sqrt(nx * nx + ny * ny)
                bend_parameter = ray_parameter(piece, x, y, (nx / length, ny / length), gap)
                bend = earlier_bend(bend_parameter, foot, scale, low, bend)
    return bend


def earlier_bend(bend_parameter, foot, scale, low, bend):
    """Return t at a parameter if it lies beyond ``low`` and before ``bend``, else ``bend``."""
    if bend_parameter == math.inf:
        return bend
    t = graded_parameter((bend_parameter - foot) / scale)
    return t if low + SAME_POINT < t < bend else bend
