"""What an outline comes to at a point outside of it, for a pair attraction C/r⁶: of bodies without
an end along the third direction, by Green's theorem over the outline,

    S(x) = ∮ n·(y − x)/|y − x|⁵ ds(y) = −p [s (3p² + 2s²)/(3p⁴ (p² + s²)^{3/2})] over segments,

n being outward, p = n·(x − y) and s along a segment. (H/8π) S is the energy of a unit volume at x,
and −4/(3 h³) the sum over a plane at the distance h.

Of an arc of radius R, x being p outside of its circle and q = R + p from its centre, ρ² = p² + u²
with u = 2 √(R q) sin(φ/2), φ from the direction of x on. In v = u/ρ what is singular is a
polynomial,

    p⁻⁴ ∫ (1 − v²) (−p + u²/(2R)) √(R/q) (1 − u²/(4 R q))^{−1/2} dv,

and what is left of it smooth: Gauss's rule takes it.
"""

import math

# Gauss's rules of eight and of six nodes on [−1, 1].
EIGHT = (
    (-0.9602898564975363, 0.10122853629037626), (-0.7966664774136267, 0.22238103445337448),
    (-0.525532409916329, 0.31370664587788727), (-0.1834346424956498, 0.362683783378362),
    (0.1834346424956498, 0.362683783378362), (0.525532409916329, 0.31370664587788727),
    (0.7966664774136267, 0.22238103445337448), (0.9602898564975363, 0.10122853629037626),
)  # fmt: skip

FLAT = 1e-3
"""A point is on the line of a segment, beside it, where p²/s² is less: terms of higher order are
then below 1e-9, and the formula's own difference of two like numbers is not."""

FACING = 0.7
"""Of u²/(4 R q) = sin²(φ/2): arcs that go on beyond that are taken from their middle."""


def primitive(p, s):
    """s (3p² + 2s²)/(3p⁴ (p² + s²)^{3/2}), whose difference is ∫ ρ⁻⁵ ds [1/m⁴]."""
    squared = p * p + s * s
    return s * (3.0 * p * p + 2.0 * s * s) / (3.0 * p**4 * squared * math.sqrt(squared))


def beside(p, s):
    """The same, less a constant, where s is far above p: −1/(4 s⁴) + 5p²/(12 s⁶) − …"""
    share = p * p / (s * s)
    return (-0.25 + share * (5.0 / 12.0 - 35.0 / 64.0 * share)) / s**4


def segment_sum(p, low, high):
    """∫ n·(y − x)/ρ⁵ ds over a segment from ``low`` to ``high`` along its line [1/m³]."""
    if p == 0.0 or not low < high:
        return 0.0
    if low * high > 0.0:
        nearest = min(abs(low), abs(high))
        if p * p < FLAT * nearest * nearest:
            found = beside(p, abs(high)) - beside(p, abs(low))
            return -p * (found if low > 0.0 else -found)
    return -p * (primitive(p, high) - primitive(p, low))


def segment_at(x, y, piece, inset, lens):
    """S of a segment within ``lens`` of a point, the body's outline being ``inset`` further in."""
    dx, dy = x - piece.x, y - piece.y
    p = dx * piece.way_y - dy * piece.way_x + inset
    along = dx * piece.way_x + dy * piece.way_y
    reach = lens * lens - p * p
    if reach <= 0.0:
        return 0.0
    reach = math.sqrt(reach)
    return segment_sum(p, max(-piece.size - along, -reach), min(piece.size - along, reach))


def arc_ends(piece):
    """The directions of the two ends of an arc from its centre, (x, y), (x, y)."""
    squared = piece.size * piece.size
    c, s = (1.0 - squared) / (1.0 + squared), 2.0 * piece.size / (1.0 + squared)
    x, y = piece.way_x, piece.way_y
    return (c * x + s * y, c * y - s * x), (c * x - s * y, c * y + s * x)


def chord_to(x, y, end):
    """2 sin(φ/2) of the angle φ from a direction to another."""
    dx, dy = end[0] - x, end[1] - y
    length = math.sqrt(dx * dx + dy * dy)
    return length if x * end[1] - y * end[0] >= 0.0 else -length


def facing_arc(p, radius, distance, low, high, lens):
    """S of an arc that x faces: between the chords ``low`` and ``high`` from its direction."""
    scale = math.sqrt(radius * distance)
    reach = lens * lens - p * p
    if reach <= 0.0:
        return 0.0
    reach = math.sqrt(reach)
    u, w = max(scale * low, -reach), min(scale * high, reach)
    if not u < w:
        return 0.0
    first, last = u / math.sqrt(p * p + u * u), w / math.sqrt(p * p + w * w)
    middle, half = 0.5 * (first + last), 0.5 * (last - first)
    total, ahead, around = 0.0, 0.5 * p * p / radius, 0.25 * p * p / (radius * distance)
    for node, weight in EIGHT:
        v = middle + half * node
        left = 1.0 - v * v
        total += weight * (ahead * v * v - p * left) / math.sqrt(1.0 - around * v * v / left)
    return half * total * math.sqrt(radius / distance) / p**4


def averted_arc(x, y, piece, radius, lens):
    """S of an arc from its middle, x as seen from its centre."""
    total = 0.0
    for node, weight in EIGHT:
        t = piece.size * node
        grown = 1.0 + t * t
        c, s = (1.0 - t * t) / grown, 2.0 * t / grown
        nx, ny = c * piece.way_x - s * piece.way_y, c * piece.way_y + s * piece.way_x
        dx, dy = radius * nx - x, radius * ny - y
        squared = dx * dx + dy * dy
        if squared < lens * lens:
            ahead = nx * dx + ny * dy
            total += weight * ahead / (grown * squared * squared * math.sqrt(squared))
    return 2.0 * radius * piece.size * total


def arc_at(x, y, piece, inset, lens):
    """S of an arc within ``lens`` of a point, the body's outline being ``inset`` further in."""
    dx, dy = x - piece.x, y - piece.y
    distance = math.sqrt(dx * dx + dy * dy)
    radius = max(piece.bend - inset, 0.5 * piece.bend)
    p = distance - radius
    if p > radius:
        return averted_arc(dx, dy, piece, radius, lens)
    toward_x, toward_y = dx / distance, dy / distance
    start, end = arc_ends(piece)
    low, high = chord_to(toward_x, toward_y, start), chord_to(toward_x, toward_y, end)
    if low > high or max(low * low, high * high) > 4.0 * FACING:
        return averted_arc(dx, dy, piece, radius, lens)
    return facing_arc(p, radius, distance, low, high, lens)


def piece_at_point(x, y, piece, inset, lens):
    """S of a piece within ``lens`` [m] of a point, the outline being ``inset`` [m] further in."""
    if piece.bend > 0.0:
        return arc_at(x, y, piece, inset, lens)
    return segment_at(x, y, piece, inset, lens)
