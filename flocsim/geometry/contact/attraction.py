"""Attraction of outlines with the pair energy −C/r⁶: the field of one outline at a point, and the
energy of two.

**Field.** For bodies that are infinite in the third direction, Green's theorem gives the field of
an outline with outward normal n as

    S(x) = ∮ n·(y − x)/|y − x|⁵ ds(y).

(H/8π) S is the energy per unit volume at x; for a half plane at the distance h, S = −4/(3 h³).

For a segment, with x at the height p = n·(x − y) above its line, S = −p ∫ ds/ρ⁵, and

    T(s) = ∫ p ds/ρ⁵ from s to ∞ = p (2 + s/ρ)/(3 ρ² (ρ + s)²)

has no cancellation, however far beside the segment x lies.

For an arc of radius R, with x at the distance p outside of its circle and q = R + p from its
centre, ρ² = p² + u² with u = 2 √(R q) sin(φ/2), where φ is measured from the direction of x. With w
= u²/(4 R q),

    S = √(R/q) ∫ (u²/(2R) − p) ρ⁻⁵ (1 − w)^{−1/2} du,

whose terms in powers of w have closed forms.

**Energy.** For two bodies of depth W, H_A = π² C, Green's theorem over both outlines gives

    E = W ∮∮ (n₁·n₂) f(ρ) ds₁ ds₂,  f = H_A/(24πρ³) q(ρ/W),
    q(τ) = (2/π) (atan(1/τ) − τ/2 + (τ³/2) ln(1 + 1/τ²)),  q = 1 for infinite depth.

Both integrals use panels that are the shorter the nearer the other outline is; about eight digits.
This takes some ten milliseconds. Runs use faster sums of their own
(integrators/rhs/outline_sum.py).
"""

import math

import numpy as np

from flocsim.compiler.composer import compiled
from flocsim.compiler.linker import loops_apart
from flocsim.geometry.shapes.pieces import (
    Pose,
    at_parameter,
    distance_to,
    piece_at,
    placed,
)
from flocsim.state.outlines import MOST_ORDER

LEAST_ATTRACTION = 1e-9
"""Attraction of a node [1/m³] that is not distinguished from none: that of plates 1 km apart. Laws
take powers of the plate gap, which would overflow for less."""

SERIES_LIMIT = 0.7
"""Largest w = sin²(φ/2) at which the series in w is used; arcs that extend further are integrated
by Gauss's rule."""

CUBE_ROOT = (2.48719599, -4.51910029, 4.92375927, -1.86079247)
"""Coefficients of r^{−1/3} in powers of r, within 4 % for r from 0.1 to 1.25: start of an
iteration."""

PANEL = 2.0 / 3.0
"""Panel over the distance of its beginning from where the integrand peaks: its pole is then two
half-lengths from the middle, and Gauss's rule with twelve nodes errs by 3.7^−24 = 2e-14."""

SHORTEST_PANEL = 1e-9
"""Shortest panel over half a piece, for outlines that touch."""


def segment_tail(p, s):
    """Return T(s) for s ≥ 0 [1/m³]."""
    rho = math.sqrt(p * p + s * s)
    inverse = 1.0 / (rho * (rho + s))
    return p * (2.0 + s * (rho + s) * inverse) * inverse * inverse / 3.0


@loops_apart
def add_segment(nodes, count, piece, inset, lens):
    """Add S of a segment to each of ``count`` nodes, and update the nodes' gap.

    Only parts within ``lens`` [m] of a node count. The outline is moved inward by ``inset`` [m].
    """
    # No branches, so that the compiler evaluates several nodes at once.
    for k in range(count):
        dx, dy = nodes.x[k] - piece.x, nodes.y[k] - piece.y
        height = dx * piece.direction_y - dy * piece.direction_x
        along = dx * piece.direction_x + dy * piece.direction_y
        # Distance from the core of the piece, less the distance of core and outline.
        past = abs(along) - piece.half
        past = past if past > 0.0 else 0.0
        deep = height + piece.core_depth
        gap = math.sqrt(deep * deep + past * past) - piece.core_depth
        known = nodes.gap[k]
        nodes.gap[k] = gap if gap < known else known
        p = height + inset
        # The segment is cut to the part within the lens around the node.
        reach = lens * lens - p * p
        reach = math.sqrt(reach if reach > 0.0 else 0.0)
        low, high = -piece.half - along, piece.half - along
        low, high = low if low > -reach else -reach, high if high < reach else reach
        first, last = segment_tail(p, abs(low)), segment_tail(p, abs(high))
        first = first if low >= 0.0 else -first
        last = last if high > 0.0 else -last
        # Both T are defined for s ≥ 0: with the foot inside, integrate the whole line, less both
        # tails.
        whole = 4.0 / (3.0 * p * p * p) if (low < 0.0) & (high > 0.0) else 0.0
        found = whole + first - last
        nodes.attraction[k] -= found if (low < high) & (p != 0.0) else 0.0


def gauss_order(away):
    """Return how many nodes integrate a piece seen from ``away`` times its half-length.

    The integrand is analytic within an ellipse through the point, of which the semi-axes add up to
    e = away + √(away² − 1): n nodes err by about e^−2n, at most 1e-10 here.
    """
    if away > 16.0:
        return 4
    if away > 5.0:
        return 6
    return 10 if away > 2.5 else MOST_ORDER


def arc_by_gauss(x, y, rules, piece, radius, lens):
    """Return S of an arc by Gauss's rule; x, y as seen from its centre."""
    total = 0.0
    # The circle around the piece is at least as wide as the arc is long.
    middle_x, middle_y = piece.middle_x - piece.x, piece.middle_y - piece.y
    away = math.sqrt((x - middle_x) * (x - middle_x) + (y - middle_y) * (y - middle_y))
    order = gauss_order((away - piece.arc_radius + radius) / piece.extent)
    for k in range(order):
        node, weight = rules[order, 0, k], rules[order, 1, k]
        # The arc is parametrised by t = tan(φ/2) from its middle.
        t = piece.half * node
        inverse = 1.0 / (1.0 + t * t)
        c, s = (1.0 - t * t) * inverse, 2.0 * t * inverse
        nx, ny = (
            c * piece.direction_x - s * piece.direction_y,
            c * piece.direction_y + s * piece.direction_x,
        )
        dx, dy = radius * nx - x, radius * ny - y
        squared = dx * dx + dy * dy
        if squared < lens * lens:
            ahead = nx * dx + ny * dy
            total += weight * ahead * inverse / (squared * squared * math.sqrt(squared))
    return 2.0 * radius * piece.half * total


def arc_by_series(p, radius, distance, low, high):
    """Return S of an arc that faces the point, from u = ``low`` to ``high``, as a + b log c: a, b,
    c.

    The logarithm is left to the caller so that this part vectorises.
    """
    squared, start, end = p * p, abs(low), abs(high)
    rho, rho_2 = math.sqrt(squared + start * start), math.sqrt(squared + end * end)
    v, v_2 = start / rho, end / rho_2
    inverse, inverse_2 = 1.0 / (rho * (rho + start)), 1.0 / (rho_2 * (rho_2 + end))
    # 3 ∫ ρ⁻⁵ du and 3 ∫ u² ρ⁻⁵ du from each end to infinity; ends on either side of the foot
    # combine as for a segment.
    zeroth, zeroth_2 = (2.0 + v) * inverse * inverse, (2.0 + v_2) * inverse_2 * inverse_2
    first, first_2 = (1.0 + v + v * v) * inverse, (1.0 + v_2 + v_2 * v_2) * inverse_2
    sign, sign_2 = 1.0 if low >= 0.0 else -1.0, 1.0 if high > 0.0 else -1.0
    inside = (low < 0.0) & (high > 0.0)
    whole = 2.0 / squared if inside else 0.0
    zeroth = (2.0 * whole / squared if inside else 0.0) + sign * zeroth - sign_2 * zeroth_2
    first = whole + sign * first - sign_2 * first_2
    # The ratio whose logarithm is the difference of asinh(u/p) at both ends.
    steep, steep_2 = rho + start, rho_2 + end
    ratio = steep_2 / steep if sign > 0.0 else steep / steep_2
    ratio = steep * steep_2 / squared if inside else ratio
    # ∫ u⁴ ρ⁻⁵ du = rest + times · log(ratio), and the integrals of higher powers by recursion.
    v, v_2 = sign * v, sign_2 * v_2
    cube, cube_2 = v * v * v, v_2 * v_2 * v_2
    rest, times = v - v_2 - (cube_2 - cube) / 3.0, 1.0
    # Powers of 1/(4 R q) times the coefficients (2k − 1)/(2k) … 1/2 of (1 − w)^{−1/2}.
    bend, share = 0.5 / radius, 0.25 / (radius * distance)
    factor = 0.5 * share
    total = (bend * first - p * zeroth + factor * (3.0 * bend * rest - p * first)) / 3.0
    logarithm = factor * bend
    for k in range(2, 5):
        factor *= share * (k - 0.5) / k
        cube, cube_2 = cube * start * start, cube_2 * end * end
        down, falling = 1.0 / (2 * k - 2), (2 * k + 1) * squared
        next_rest, next_times = down * (cube_2 - cube - falling * rest), -down * falling * times
        total += factor * (bend * next_rest - p * rest)
        logarithm += factor * (bend * next_times - p * times)
        rest, times = next_rest, next_times
    root = math.sqrt(radius / distance)
    return root * total, root * logarithm, ratio


def arc_ends(piece):
    """Return the unit vectors from the centre of an arc to its two ends, (x, y), (x, y)."""
    squared = piece.half * piece.half
    c, s = (1.0 - squared) / (1.0 + squared), 2.0 * piece.half / (1.0 + squared)
    x, y = piece.direction_x, piece.direction_y
    return (c * x + s * y, c * y - s * x), (c * x - s * y, c * y + s * x)


def chord_to(x, y, distance, radius, end):
    """Return u of an end of an arc, and whether that end faces the point.

    x, y: the point as seen from the centre; ``end``: the direction of the end.
    """
    ahead, aside = x * end[0] + y * end[1], x * end[1] - y * end[0]
    facing = ahead > (1.0 - 2.0 * SERIES_LIMIT) * distance
    return aside * math.sqrt(2.0 * radius / (distance + ahead if facing else distance)), facing


@loops_apart
def add_arc(nodes, rules, count, piece, inset, lens):
    """Add S of an arc to each of ``count`` nodes, as `add_segment` does for a segment."""
    start, end = arc_ends(piece)
    radius = max(piece.arc_radius - inset, 0.5 * piece.arc_radius)
    for k in range(count):
        x, y = nodes.x[k] - piece.x, nodes.y[k] - piece.y
        distance = math.sqrt(x * x + y * y)
        gap, known = distance - piece.core_depth, nodes.gap[k]
        nodes.gap[k] = gap if gap < known else known
        p = distance - radius
        reach = lens * lens - p * p
        reach = math.sqrt(reach if reach > 0.0 else 0.0)
        low, faces = chord_to(x, y, distance, radius, start)
        high, faces_too = chord_to(x, y, distance, radius, end)
        low, high = low if low > -reach else -reach, high if high < reach else reach
        seen = low < high
        # An empty interval would give log(0): use a harmless one, its result is discarded.
        high = high if seen else low + radius
        found, logarithm, ratio = arc_by_series(p, radius, distance, low, high)
        faces = faces & faces_too & (p <= radius)
        seen = seen & faces
        nodes.attraction[k] += found if seen else 0.0
        nodes.log_share[k] = logarithm if seen else 0.0
        nodes.log_of[k] = ratio if faces else -1.0
    # Logarithms are scalar calls: a loop of its own keeps the loop above vectorised.
    for k in range(count):
        if nodes.log_of[k] < 0.0:
            x, y = nodes.x[k] - piece.x, nodes.y[k] - piece.y
            nodes.attraction[k] += arc_by_gauss(x, y, rules, piece, radius, lens)
        elif nodes.log_share[k] != 0.0:
            log = math.log(nodes.log_of[k])
            nodes.attraction[k] += nodes.log_share[k] * log


FADE_COEFFICIENT = 12.88
"""c in the weight (1 − s)³ (1 + 3s + c s²), s = (gap/lens)², that fades S out towards the lens.

c = 6 makes the fade as flat as possible. The larger value exceeds 1 before the end, by what is
missed beyond the lens where the gap keeps growing as outlines curve apart. Steeper fades cost
steps: a fade as 1 − (gap/lens)⁶ took a fifth more.
"""


@loops_apart
def convert_to_plate_gaps(nodes, count, inset, lens):
    """Convert S at the nodes to plate gaps (−3S/4)^{−1/3} [m]: plates at these gaps attract
    equally.

    S fades to zero at the distance ``lens`` [m].
    """
    for k in range(count):
        share = nodes.gap[k] / lens
        share *= share
        weight = 1.0 - share
        weight *= weight * weight * (1.0 + share * (3.0 + share * FADE_COEFFICIENT))
        cube = -0.75 * nodes.attraction[k] * weight
        nodes.attraction[k] = cube
        # The plate gap is close to the gap itself, so S gap³ is near 1: two steps of a fourth-order
        # iteration for the cube root leave 1e-16.
        shifted_gap = nodes.gap[k] + inset
        ratio = cube * shifted_gap * shifted_gap * shifted_gap
        known = (ratio > 0.1) & (ratio < 1.25)
        root = CUBE_ROOT[2] + ratio * CUBE_ROOT[3]
        root = CUBE_ROOT[0] + ratio * (CUBE_ROOT[1] + ratio * root)
        for _ in range(2):
            off = 1.0 - ratio * root * root * root
            root *= 1.0 + off * (1.0 / 3.0 + off * (2.0 / 9.0 + off * (14.0 / 81.0)))
        nodes.plate_gap[k] = shifted_gap * root if known else -1.0
    for k in range(count):
        if nodes.plate_gap[k] < 0.0:
            nodes.plate_gap[k] = max(nodes.attraction[k], LEAST_ATTRACTION) ** (-1.0 / 3.0)


def finite_depth_factor(distance, depth):
    """Return q at a distance; 1 for infinite depth."""
    if depth == math.inf:
        return 1.0
    t = distance / depth
    if t > 30.0:
        # Asymptotic series: the closed form cancels, with rounding errors that grow as t³.
        return 2.0 / math.pi * (0.75 - 1.0 / (6.0 * t * t)) / t
    rest = math.atan(1.0 / t) - 0.5 * t + 0.5 * t * t * t * math.log1p(1.0 / (t * t))
    return 2.0 / math.pi * rest


def panel_end(begin, end, distance):
    """Return the parameter at which a panel ends that begins so far from where its integrand
    peaks."""
    return min(begin + max(PANEL * distance, SHORTEST_PANEL * end), end)


def piece_integral(x, y, nx, ny, piece, depth, rule):
    """Return ∫ (n·n(s)) q ρ⁻³ ds over a piece, seen from a point with a normal [1/m²]."""
    total, begin = 0.0, -piece.half
    while begin < piece.half:
        x_2, y_2, _, _, metres = at_parameter(piece, begin)
        away = math.sqrt((x - x_2) * (x - x_2) + (y - y_2) * (y - y_2))
        stop = panel_end(begin, piece.half, away / metres)
        middle, half = 0.5 * (begin + stop), 0.5 * (stop - begin)
        for k in range(rule.shape[1]):
            x_2, y_2, nx_2, ny_2, metres = at_parameter(piece, middle + half * rule[0, k])
            squared = (x - x_2) * (x - x_2) + (y - y_2) * (y - y_2)
            away = math.sqrt(squared)
            share = finite_depth_factor(away, depth) * (nx * nx_2 + ny * ny_2)
            total += half * rule[1, k] * metres * share / (squared * away)
        begin = stop
    return total


def piece_pair_integral(one, other, depth, rule):
    """Return ∬ (n₁·n₂) q ρ⁻³ ds₁ ds₂ of two pieces [1/m]."""
    total, begin = 0.0, -one.half
    while begin < one.half:
        x, y, _, _, metres = at_parameter(one, begin)
        stop = panel_end(begin, one.half, abs(distance_to(x, y, other)) / metres)
        middle, half = 0.5 * (begin + stop), 0.5 * (stop - begin)
        for k in range(rule.shape[1]):
            x, y, nx, ny, metres = at_parameter(one, middle + half * rule[0, k])
            found = piece_integral(x, y, nx, ny, other, depth, rule)
            total += half * rule[1, k] * metres * found
        begin = stop
    return total


def sum_of_pairs(pieces_a, pieces_b, x, y, angle, depth, rule):
    """Return ∮∮ (n₁·n₂) q ρ⁻³ ds₁ ds₂ of two outlines [1/m]; a lies at x, y [m] and an angle in b's
    frame."""
    pose, total = Pose(x, y, math.cos(angle), math.sin(angle)), 0.0
    for i in range(pieces_a.shape[0]):
        one = placed(pieces_a, i, pose)
        for j in range(pieces_b.shape[0]):
            total += piece_pair_integral(one, piece_at(pieces_b, j), depth, rule)
    return total


def attraction_energy(
    pieces_a: np.ndarray,
    pieces_b: np.ndarray,
    pose: tuple[float, float, float],
    hamaker: float,
    depth: float = math.inf,
) -> float:
    """Return the van der Waals energy of two outlines that do not touch.

    Parameters
    ----------
    pieces_a, pieces_b : arrays of Piece
        Outlines, from `outline_pieces` or `polygon_pieces`.
    pose : (float, float, float)
        Position [m] and angle [rad] of a in the frame of b.
    hamaker : float
        Hamaker constant H_A [J].
    depth : float, optional
        Extent in the third direction [m]; infinite by default.

    Returns
    -------
    float
        Energy [J]; per metre of depth [J/m] if the depth is infinite.

    Notes
    -----
    Pairwise summation of −C/r⁶ (Hamaker 1937); equations at the top of the module.
    """
    rule = np.array(np.polynomial.legendre.leggauss(12))
    x, y, angle = (float(each) for each in pose)
    total = compiled(sum_of_pairs)(pieces_a, pieces_b, x, y, angle, float(depth), rule)
    return hamaker / (24.0 * math.pi) * total * (1.0 if depth == math.inf else depth)
