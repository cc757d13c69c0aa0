"""What an outline comes to at a point outside of it, for a pair attraction C/r⁶: of bodies without
an end along the third direction, by Green's theorem over the outline,

    S(x) = ∮ n·(y − x)/|y − x|⁵ ds(y),

n being outward. (H/8π) S is the energy of a unit volume at x, and −4/(3 h³) the sum over a plane at
the distance h. Of a segment, x being p = n·(x − y) above its line, S is −p ∫ ds/ρ⁵, and

    T(s) = ∫ p ds/ρ⁵ from s to ∞ = p (2 + s/ρ)/(3 ρ² (ρ + s)²)

has no like numbers that cancel, however far beside a segment x lies.

Of an arc of radius R, x being p outside of its circle and q = R + p from its centre, ρ² = p² + u²
with u = 2 √(R q) sin(φ/2), φ from the direction of x on. With w = u²/(4 R q),

    S = √(R/q) ∫ (u²/(2R) − p) ρ⁻⁵ (1 − w)^{−1/2} du,

whose terms in powers of w have closed forms.
"""

import math

import flocsim.arrays as at
from flocsim.compiler.linker import loops_apart

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
        dx, dy = nodes[at.NODE_X, k] - piece.x, nodes[at.NODE_Y, k] - piece.y
        height = dx * piece.way_y - dy * piece.way_x
        along = dx * piece.way_x + dy * piece.way_y
        past = abs(along) - piece.size
        past = past if past > 0.0 else 0.0
        deep = height + piece.inward
        gap = math.sqrt(deep * deep + past * past) - piece.inward
        known = nodes[at.NODE_GAP, k]
        nodes[at.NODE_GAP, k] = gap if gap < known else known
        p = height + inset
        reach = lens * lens - p * p
        reach = math.sqrt(reach if reach > 0.0 else 0.0)
        low, high = -piece.size - along, piece.size - along
        low, high = low if low > -reach else -reach, high if high < reach else reach
        first, last = beyond(p, abs(low)), beyond(p, abs(high))
        first = first if low >= 0.0 else -first
        last = last if high > 0.0 else -last
        # Where the foot lies between them, all of the line less what is beyond both ends.
        whole = 4.0 / (3.0 * p * p * p) if (low < 0.0) & (high > 0.0) else 0.0
        found = whole + first - last
        nodes[at.NODE_SUM, k] -= found if (low < high) & (p != 0.0) else 0.0


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
    squared = piece.size * piece.size
    c, s = (1.0 - squared) / (1.0 + squared), 2.0 * piece.size / (1.0 + squared)
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
        x, y = nodes[at.NODE_X, k] - piece.x, nodes[at.NODE_Y, k] - piece.y
        distance = math.sqrt(x * x + y * y)
        gap, known = distance - piece.inward, nodes[at.NODE_GAP, k]
        nodes[at.NODE_GAP, k] = gap if gap < known else known
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
        nodes[at.NODE_SUM, k] += found if seen else 0.0
        nodes[at.NODE_LOG_SHARE, k] = logarithm if seen else 0.0
        nodes[at.NODE_LOG_OF, k] = ratio if faces else -1.0
    # A logarithm is taken of one number at a time.
    for k in range(count):
        if nodes[at.NODE_LOG_OF, k] < 0.0:
            x, y = nodes[at.NODE_X, k] - piece.x, nodes[at.NODE_Y, k] - piece.y
            nodes[at.NODE_SUM, k] += averted_arc(x, y, piece, radius, lens)
        elif nodes[at.NODE_LOG_SHARE, k] != 0.0:
            log = math.log(nodes[at.NODE_LOG_OF, k])
            nodes[at.NODE_SUM, k] += nodes[at.NODE_LOG_SHARE, k] * log


MADE_UP = 12.88
"""Of 1 + 3s + c s², s = (gap/lens)²: with 6 the share of S that counts fades as smoothly as can be,
and with this it is larger before that by what is missed where the gap of outlines that bend away
from each other goes on growing beyond the lens. A fade that is steeper costs steps."""


@loops_apart
def find_plates(nodes, count, inset, lens):
    """From S at so many nodes the gaps (−3S/4)^{−1/3} [m] of plates that attract each other as
    strongly; what is as far as ``lens`` [m] no longer counts."""
    for k in range(count):
        share = nodes[at.NODE_GAP, k] / lens
        share *= share
        left = 1.0 - share
        left *= left * left * (1.0 + share * (3.0 + share * MADE_UP))
        cube = -0.75 * nodes[at.NODE_SUM, k] * left
        nodes[at.NODE_SUM, k] = cube
        # Nearly that of a plane as near: two steps from there leave 1e-16 of it.
        parted = nodes[at.NODE_GAP, k] + inset
        ratio = cube * parted * parted * parted
        known = (ratio > 0.1) & (ratio < 1.25)
        root = CUBE_ROOT[2] + ratio * CUBE_ROOT[3]
        root = CUBE_ROOT[0] + ratio * (CUBE_ROOT[1] + ratio * root)
        for _ in range(2):
            off = 1.0 - ratio * root * root * root
            root *= 1.0 + off * (1.0 / 3.0 + off * (2.0 / 9.0 + off * (14.0 / 81.0)))
        nodes[at.NODE_PLATES, k] = parted * root if known else -1.0
    for k in range(count):
        if nodes[at.NODE_PLATES, k] < 0.0:
            cube = nodes[at.NODE_SUM, k]
            far = cube ** (-1.0 / 3.0) if cube > 0.0 else NO_ATTRACTION
            nodes[at.NODE_PLATES, k] = min(far, NO_ATTRACTION)
