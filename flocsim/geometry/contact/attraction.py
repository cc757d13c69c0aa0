"""Outlines that attract each other as −C/r⁶: what one comes to at a point outside of it, which is
summed in a run, and the energy of two, to some eight digits.

Of bodies without an end along the third direction, by Green's theorem over the outline,

    S(x) = ∮ n·(y − x)/|y − x|⁵ ds(y),

n being outward. (H/8π) S is the energy of a unit volume at x, and −4/(3 h³) the sum over a plane at
the distance h. Of a segment, x being p = n·(x − y) above its line, S is −p ∫ ds/ρ⁵, and

    T(s) = ∫ p ds/ρ⁵ from s to ∞ = p (2 + s/ρ)/(3 ρ² (ρ + s)²)

has no like numbers that cancel, however far beside a segment x lies.

Of an arc of radius R, x being p outside of its circle and q = R + p from its centre, ρ² = p² + u²
with u = 2 √(R q) sin(φ/2), φ from the direction of x on. With w = u²/(4 R q),

    S = √(R/q) ∫ (u²/(2R) − p) ρ⁻⁵ (1 − w)^{−1/2} du,

whose terms in powers of w have closed forms.

The energy of bodies of a depth W, H_A = π² C, by Green's theorem over both, is

    E = W ∮∮ (n₁·n₂) f(ρ) ds₁ ds₂,  f = H_A/(24πρ³) q(ρ/W),
    q(τ) = (2/π) (atan(1/τ) − τ/2 + (τ³/2) ln(1 + 1/τ²)),  1 where they have no end,

the one by panels that shrink towards where the other is near, the other in closed form, or by
panels as well. It takes milliseconds: runs have sums of their own (integrators.rhs.outline_sum).
"""

import math

import numpy as np

from flocsim.compiler.composer import compiled
from flocsim.compiler.linker import loops_apart
from flocsim.geometry.shapes.pieces import (
    Pose,
    at_parameter,
    between_cores,
    distance_to,
    ends_of,
    parameter_beside,
    piece_at,
    placed,
)

# Gauss's rule of eight nodes on [−1, 1].
EIGHT = (
    (-0.9602898564975363, 0.10122853629037626), (-0.7966664774136267, 0.22238103445337448),
    (-0.525532409916329, 0.31370664587788727), (-0.1834346424956498, 0.362683783378362),
    (0.1834346424956498, 0.362683783378362), (0.525532409916329, 0.31370664587788727),
    (0.7966664774136267, 0.22238103445337448), (0.9602898564975363, 0.10122853629037626),
)  # fmt: skip

NO_ATTRACTION = 1e3
"""The gap [m] of plates that stands for none."""

FACING = 0.7
"""Of w = sin²(φ/2): arcs that go on beyond that are taken from their middle."""

# Of (1 − w)^{−1/2} in powers of w.
ROOT = (1.0, 0.5, 0.375, 0.3125, 0.2734375, 0.24609375)

CUBE_ROOT = (2.48719599, -4.51910029, 4.92375927, -1.86079247)
"""Of r^{−1/3} in powers of r, from 0.1 to 1.25 within 4 %: where a root begins from."""

NODES, WEIGHTS = np.polynomial.legendre.leggauss(12)

PANEL = 1.5
"""The longest panel of t."""

FINEST = 0.25
"""The smallest panel at a place, over how far the other piece is from there."""


def beyond(p, s):
    """T(s), of s ≥ 0 [1/m³]."""
    rho = math.sqrt(p * p + s * s)
    inverse = 1.0 / (rho * (rho + s))
    return p * (2.0 + s * (rho + s) * inverse) * inverse * inverse / 3.0


@loops_apart
def add_segment(nodes, count, piece, inset, lens):
    """Add S of a segment within ``lens`` [m] to each of some nodes, the outline being ``inset`` [m]
    further in, and take its gap to them."""
    # Without a branch, so that several nodes are taken at once.
    for k in range(count):
        dx, dy = nodes.x[k] - piece.x, nodes.y[k] - piece.y
        height = dx * piece.way_y - dy * piece.way_x
        along = dx * piece.way_x + dy * piece.way_y
        past = abs(along) - piece.half
        past = past if past > 0.0 else 0.0
        deep = height + piece.inward
        gap = math.sqrt(deep * deep + past * past) - piece.inward
        known = nodes.gap[k]
        nodes.gap[k] = gap if gap < known else known
        p = height + inset
        reach = lens * lens - p * p
        reach = math.sqrt(reach if reach > 0.0 else 0.0)
        low, high = -piece.half - along, piece.half - along
        low, high = low if low > -reach else -reach, high if high < reach else reach
        first, last = beyond(p, abs(low)), beyond(p, abs(high))
        first = first if low >= 0.0 else -first
        last = last if high > 0.0 else -last
        # Where the foot lies between them, all of the line less what is beyond both ends.
        whole = 4.0 / (3.0 * p * p * p) if (low < 0.0) & (high > 0.0) else 0.0
        found = whole + first - last
        nodes.attraction[k] -= found if (low < high) & (p != 0.0) else 0.0


def averted_arc(x, y, piece, radius, lens):
    """S of an arc from its middle, x as seen from its centre."""
    total = 0.0
    for node, weight in EIGHT:
        t = piece.half * node
        grown = 1.0 + t * t
        c, s = (1.0 - t * t) / grown, 2.0 * t / grown
        nx, ny = c * piece.way_x - s * piece.way_y, c * piece.way_y + s * piece.way_x
        dx, dy = radius * nx - x, radius * ny - y
        squared = dx * dx + dy * dy
        if squared < lens * lens:
            ahead = nx * dx + ny * dy
            total += weight * ahead / (grown * squared * squared * math.sqrt(squared))
    return 2.0 * radius * piece.half * total


def facing_arc(p, radius, distance, low, high):
    """S of an arc that x faces, from u = ``low`` to ``high``: a, b and c of a + b log c."""
    squared, start, end = p * p, abs(low), abs(high)
    rho, rho_2 = math.sqrt(squared + start * start), math.sqrt(squared + end * end)
    v, v_2 = start / rho, end / rho_2
    inverse, inverse_2 = 1.0 / (rho * (rho + start)), 1.0 / (rho_2 * (rho_2 + end))
    # 3 ∫ ρ⁻⁵ du and 3 ∫ u² ρ⁻⁵ du from each end to ∞.
    zeroth, zeroth_2 = (2.0 + v) * inverse * inverse, (2.0 + v_2) * inverse_2 * inverse_2
    first, first_2 = (1.0 + v + v * v) * inverse, (1.0 + v_2 + v_2 * v_2) * inverse_2
    sign, sign_2 = 1.0 if low >= 0.0 else -1.0, 1.0 if high > 0.0 else -1.0
    inside = (low < 0.0) & (high > 0.0)
    whole = 2.0 / squared if inside else 0.0
    zeroth = (2.0 * whole / squared if inside else 0.0) + sign * zeroth - sign_2 * zeroth_2
    first = whole + sign * first - sign_2 * first_2
    # The difference of asinh(u/p) at both ends.
    steep, steep_2 = rho + start, rho_2 + end
    ratio = steep_2 / steep if sign > 0.0 else steep / steep_2
    ratio = steep * steep_2 / squared if inside else ratio
    # ∫ u⁴ ρ⁻⁵ du, and from it those of higher powers: a number, and what the logarithm is times.
    v, v_2 = sign * v, sign_2 * v_2
    cube, cube_2 = v * v * v, v_2 * v_2 * v_2
    rest, times = v - v_2 - (cube_2 - cube) / 3.0, 1.0
    bend, share = 0.5 / radius, 0.25 / (radius * distance)
    factor = share * ROOT[1]
    total = (bend * first - p * zeroth + factor * (3.0 * bend * rest - p * first)) / 3.0
    logarithm = factor * bend
    factor = share * share
    for k in range(2, 5):
        cube, cube_2 = cube * start * start, cube_2 * end * end
        down, falling = 1.0 / (2 * k - 2), (2 * k + 1) * squared
        next_rest, next_times = down * (cube_2 - cube - falling * rest), -down * falling * times
        total += ROOT[k] * factor * (bend * next_rest - p * rest)
        logarithm += ROOT[k] * factor * (bend * next_times - p * times)
        rest, times = next_rest, next_times
        factor *= share
    root = math.sqrt(radius / distance)
    return root * total, root * logarithm, ratio


def arc_ends(piece):
    """The directions of the two ends of an arc from its centre, (x, y), (x, y)."""
    squared = piece.half * piece.half
    c, s = (1.0 - squared) / (1.0 + squared), 2.0 * piece.half / (1.0 + squared)
    x, y = piece.way_x, piece.way_y
    return (c * x + s * y, c * y - s * x), (c * x - s * y, c * y + s * x)


def chord_to(x, y, distance, radius, end):
    """u of an end of an arc from the direction of a point that is seen from its centre, and whether
    the point faces it."""
    ahead, aside = x * end[0] + y * end[1], x * end[1] - y * end[0]
    facing = ahead > (1.0 - 2.0 * FACING) * distance
    return aside * math.sqrt(2.0 * radius / (distance + ahead if facing else distance)), facing


@loops_apart
def add_arc(nodes, count, piece, inset, lens):
    """The same as add_segment, of an arc."""
    start, end = arc_ends(piece)
    radius = max(piece.bend - inset, 0.5 * piece.bend)
    for k in range(count):
        x, y = nodes.x[k] - piece.x, nodes.y[k] - piece.y
        distance = math.sqrt(x * x + y * y)
        gap, known = distance - piece.inward, nodes.gap[k]
        nodes.gap[k] = gap if gap < known else known
        p = distance - radius
        reach = lens * lens - p * p
        reach = math.sqrt(reach if reach > 0.0 else 0.0)
        low, faces = chord_to(x, y, distance, radius, start)
        high, faces_too = chord_to(x, y, distance, radius, end)
        low, high = low if low > -reach else -reach, high if high < reach else reach
        seen = low < high
        high = high if seen else low + radius
        found, logarithm, ratio = facing_arc(p, radius, distance, low, high)
        faces = faces & faces_too & (p <= radius)
        seen = seen & faces
        nodes.attraction[k] += found if seen else 0.0
        nodes.log_share[k] = logarithm if seen else 0.0
        nodes.log_of[k] = ratio if faces else -1.0
    # A logarithm is taken of one number at a time.
    for k in range(count):
        if nodes.log_of[k] < 0.0:
            x, y = nodes.x[k] - piece.x, nodes.y[k] - piece.y
            nodes.attraction[k] += averted_arc(x, y, piece, radius, lens)
        elif nodes.log_share[k] != 0.0:
            log = math.log(nodes.log_of[k])
            nodes.attraction[k] += nodes.log_share[k] * log


MADE_UP = 12.88
"""Of 1 + 3s + c s², s = (gap/lens)²: with 6 the share of S that counts fades as smoothly as can be,
and with this it is larger before that by what is missed where the gap of outlines that bend away
from each other goes on growing beyond the lens. A fade that is steeper costs steps."""


@loops_apart
def find_plates(nodes, count, inset, lens):
    """From S at so many nodes the gaps (−3S/4)^{−1/3} [m] of plates that attract each other as
    strongly; what is as far as ``lens`` [m] no longer counts."""
    for k in range(count):
        share = nodes.gap[k] / lens
        share *= share
        left = 1.0 - share
        left *= left * left * (1.0 + share * (3.0 + share * MADE_UP))
        cube = -0.75 * nodes.attraction[k] * left
        nodes.attraction[k] = cube
        # Nearly that of a plane as near: two steps from there leave 1e-16 of it.
        parted = nodes.gap[k] + inset
        ratio = cube * parted * parted * parted
        known = (ratio > 0.1) & (ratio < 1.25)
        root = CUBE_ROOT[2] + ratio * CUBE_ROOT[3]
        root = CUBE_ROOT[0] + ratio * (CUBE_ROOT[1] + ratio * root)
        for _ in range(2):
            off = 1.0 - ratio * root * root * root
            root *= 1.0 + off * (1.0 / 3.0 + off * (2.0 / 9.0 + off * (14.0 / 81.0)))
        nodes.plate_gap[k] = parted * root if known else -1.0
    for k in range(count):
        if nodes.plate_gap[k] < 0.0:
            cube = nodes.attraction[k]
            far = cube ** (-1.0 / 3.0) if cube > 0.0 else NO_ATTRACTION
            nodes.plate_gap[k] = min(far, NO_ATTRACTION)


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
    low, high = -piece.half - along, piece.half - along
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
    foot = min(max(parameter_beside(piece, x, y), -piece.half), piece.half)
    fx, fy, _, _, metres = at_parameter(piece, foot)
    near = math.sqrt((x - fx) * (x - fx) + (y - fy) * (y - fy)) / metres
    total = 0.0
    for side in range(2):
        end = piece.half if side == 0 else -piece.half
        way = 1.0 if end > foot else -1.0
        begin, step = foot, max(near, 1e-9 * piece.half)
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
    total = compiled(sum_of_pairs)(pieces_a, pieces_b, x, y, angle, float(depth), rule, np.zeros(3))
    return hamaker / (24.0 * math.pi) * total * (1.0 if depth == math.inf else depth)
