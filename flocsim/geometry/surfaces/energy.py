"""The energy of two outlines that attract each other as −C/r⁶, to some eight digits.

Of bodies of a depth W, H_A = π² C, by Green's theorem over both,

    E = W ∮∮ (n₁·n₂) f(ρ) ds₁ ds₂,  f = H_A/(24πρ³) q(ρ/W),
    q(τ) = (2/π) (atan(1/τ) − τ/2 + (τ³/2) ln(1 + 1/τ²)),  1 where they have no end,

the one by panels that shrink towards where the other is near, the other in closed form, or by
panels as well. It takes milliseconds: forces have sums of their own (integrators.rhs.outline_sum).
"""

import math
from functools import cache

import numpy as np

from flocsim.compiler.composer import compose
from flocsim.geometry.surfaces.distances import Pose, between_cores, distance_to, piece_at, placed
from flocsim.geometry.surfaces.nodes import at_parameter, ends_of, parameter_beside

NODES, WEIGHTS = np.polynomial.legendre.leggauss(12)

PANEL = 1.5
"""The longest panel of t."""

FINEST = 0.25
"""The smallest panel at a place, over how far the other piece is from there."""


def share_of_depth(distance, depth):
    """q at a distance; depth inf: 1."""
    if depth == math.inf:
        return 1.0
    t = distance / depth
    if t > 30.0:
        # What is left of large numbers, whose rounding grows as t³.
        return 2.0 / math.pi * (0.75 - 1.0 / (6.0 * t * t)) / t
    rest = math.atan(1.0 / t) - 0.5 * t + 0.5 * t * t * t * math.log1p(1.0 / (t * t))
    return 2.0 / math.pi * rest


def on_line(p, low, high, depth, rule):
    """∫ q ρ⁻³ ds along a line at the distance p, over a part of it on one side of the foot, by
    s = p sinh(t) [1/m²]."""
    total, p = 0.0, abs(p)
    first, last = math.asinh(low / p), math.asinh(high / p)
    count = 1 + int((last - first) / PANEL)
    half = 0.5 * (last - first) / count
    for panel in range(count):
        middle = first + (2.0 * panel + 1.0) * half
        for k in range(rule.shape[1]):
            rise = math.cosh(middle + half * rule[0, k])
            total += rule[1, k] * share_of_depth(p * rise, depth) / (rise * rise)
    return half * total / (p * p)


def from_segment(x, y, piece, depth, rule):
    """∫ q ρ⁻³ ds over a segment, seen from a point [1/m²]."""
    dx, dy = x - piece.x, y - piece.y
    p, along = dx * piece.way_y - dy * piece.way_x, dx * piece.way_x + dy * piece.way_y
    low, high = -piece.size - along, piece.size - along
    if low < 0.0 < high or abs(p) > 1e-3 * min(abs(low), abs(high)):
        if depth == math.inf:
            first, last = low / math.sqrt(p * p + low * low), high / math.sqrt(p * p + high * high)
            return (last - first) / (p * p)
        if low < 0.0 < high:
            below = on_line(p, low, 0.0, depth, rule)
            return below + on_line(p, 0.0, high, depth, rule)
        return on_line(p, low, high, depth, rule)
    # On the line of the segment, beside it: by the logarithm of the distance, which may be small.
    total = 0.0
    first, last = math.log(min(abs(low), abs(high))), math.log(max(abs(low), abs(high)))
    middle, half = 0.5 * (first + last), 0.5 * (last - first)
    for k in range(rule.shape[1]):
        s = math.exp(middle + half * rule[0, k])
        squared = p * p + s * s
        share = share_of_depth(math.sqrt(squared), depth)
        total += rule[1, k] * share * s / (squared * math.sqrt(squared))
    return half * total


def from_arc(x, y, nx, ny, piece, depth, rule):
    """∫ (n·n(s)) q ρ⁻³ ds over an arc, seen from a point with a normal [1/m²]: by panels that grow
    with the distance from where the point faces its circle."""
    foot = min(max(parameter_beside(piece, x, y), -piece.size), piece.size)
    fx, fy, _, _, metres = at_parameter(piece, foot)
    near = math.sqrt((x - fx) * (x - fx) + (y - fy) * (y - fy)) / metres
    total = 0.0
    for side in range(2):
        end = piece.size if side == 0 else -piece.size
        way = 1.0 if end > foot else -1.0
        begin, step = foot, max(near, 1e-9 * piece.size)
        while (end - begin) * way > 0.0:
            stop = begin + way * step
            if (end - stop) * way < 0.5 * step:
                stop = end
            middle, half = 0.5 * (begin + stop), 0.5 * abs(stop - begin)
            for k in range(rule.shape[1]):
                x_2, y_2, nx_2, ny_2, length = at_parameter(piece, middle + half * rule[0, k])
                squared = (x - x_2) * (x - x_2) + (y - y_2) * (y - y_2)
                share = share_of_depth(math.sqrt(squared), depth)
                alike = nx * nx_2 + ny * ny_2
                total += half * rule[1, k] * length * share * alike / (squared * math.sqrt(squared))
            begin, step = stop, 2.0 * step
    return total


def on_panel(one, other, low, high, depth, rule):
    """The sum over a panel of a piece and all of another [1/m]."""
    total, middle, half = 0.0, 0.5 * (low + high), 0.5 * (high - low)
    for k in range(rule.shape[1]):
        x, y, nx, ny, metres = at_parameter(one, middle + half * rule[0, k])
        if other.bend > 0.0:
            found = from_arc(x, y, nx, ny, other, depth, rule)
        else:
            alike = nx * other.way_y - ny * other.way_x
            found = alike * from_segment(x, y, other, depth, rule)
        total += rule[1, k] * metres * found
    return half * total


def between_marks(one, other, mark, end, depth, rule):
    """The sum from a mark to an end of a piece, by panels each twice as long as the one before."""
    x, y, _, _, metres = at_parameter(one, mark)
    step = FINEST * max(abs(distance_to(x, y, other)), 1e-9 * one.extent) / metres
    total, begin, way = 0.0, mark, 1.0 if end > mark else -1.0
    while (end - begin) * way > 0.0:
        stop = begin + way * step
        if (end - stop) * way < 0.5 * step:
            stop = end
        total += on_panel(one, other, min(begin, stop), max(begin, stop), depth, rule)
        begin, step = stop, 2.0 * step
    return total


def between_pieces(one, other, depth, rule, marks):
    """∬ (n₁·n₂) q ρ⁻³ ds₁ ds₂ of two pieces [1/m]."""
    first, last = ends_of(one)
    _, _, _, x, y = between_cores(one, other)
    marks[0] = min(max(parameter_beside(one, x, y), first), last)
    low, high = ends_of(other)
    for k in range(2):
        x, y, _, _, _ = at_parameter(other, low if k == 0 else high)
        marks[1 + k] = min(max(parameter_beside(one, x, y), first), last)
    for k in range(1, 3):
        place = k
        while place > 0 and marks[place - 1] > marks[place]:
            marks[place - 1], marks[place] = marks[place], marks[place - 1]
            place -= 1
    total = between_marks(one, other, marks[0], first, depth, rule)
    total += between_marks(one, other, marks[2], last, depth, rule)
    for k in range(2):
        middle = 0.5 * (marks[k] + marks[k + 1])
        total += between_marks(one, other, marks[k], middle, depth, rule)
        total += between_marks(one, other, marks[k + 1], middle, depth, rule)
    return total


def sum_of_pairs(pieces_a, pieces_b, x, y, angle, depth, rule, marks):
    """∮∮ (n₁·n₂) q ρ⁻³ ds₁ ds₂ of two outlines, a lying at x, y [m] and an angle from b [1/m]."""
    pose, total = Pose(x, y, math.cos(angle), math.sin(angle)), 0.0
    for i in range(pieces_a.shape[0]):
        one = placed(pieces_a, i, pose)
        for j in range(pieces_b.shape[0]):
            total += between_pieces(one, piece_at(pieces_b, j), depth, rule, marks)
    return total


@cache
def compiled_sum():
    return compose(sum_of_pairs, {})


def attraction_energy(
    pieces_a: np.ndarray,
    pieces_b: np.ndarray,
    pose: tuple[float, float, float],
    hamaker: float,
    depth: float = math.inf,
) -> float:
    """E [J] of two outlines of a depth [m], or that of a metre of it [J/m] where it is inf.

    ``pieces_a``, ``pieces_b``: of `outline_pieces`; ``pose``: x, y [m] and angle [rad] of a in the
    frame of b. The outlines may not touch.
    """
    rule = np.array([NODES, WEIGHTS])
    x, y, angle = (float(each) for each in pose)
    total = compiled_sum()(pieces_a, pieces_b, x, y, angle, float(depth), rule, np.zeros(3))
    return hamaker / (24.0 * math.pi) * total * (1.0 if depth == math.inf else depth)
