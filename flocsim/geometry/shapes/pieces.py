"""Outlines as pieces (segments and arcs), distances of pieces, and quadrature along them.

Distances are those of the cores that pieces are offsets of, minus the offsets; negative where
outlines overlap. A Placed holds a piece in the frame of the other body.

The influence of another outline peaks at the feet, where it is nearest, and decays over a length of
its own from there. So a piece is cut between its feet. On each side one Gauss rule covers the part
within the length a over which the gap grows by twice itself, and another one the rest, in the
logarithm of the distance.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from flocsim.errors import ShapeError
from flocsim.geometry.shapes.cores import Part, signed_area
from flocsim.geometry.shapes.moments import exposed_arcs, exposed_chords, is_disc, pieces_of
from flocsim.geometry.shapes.shape import Shape
from flocsim.state.outlines import Piece

WIDEST_ARC = 0.5 * math.pi
"""Largest angle of an arc [rad]; longer ones are split."""

SHORTEST_SEGMENT = 1e-7
"""Shortest segment over the longest piece: shorter ones are rounding remnants of a side at a reflex
corner."""


def segment_rows(starts, units, low, high, radius):
    """Return segments as rows, each from ``low`` to ``high`` along its unit tangent from its
    start."""
    # A segment encloses itself: its midpoint is the centre, its half-length the radius of the
    # circle.
    middle = starts + 0.5 * (low + high)[:, None] * units
    half = 0.5 * (high - low)
    radii = np.broadcast_to(radius, half.shape)
    rows = Piece.of(middle, units, half, np.zeros_like(half), middle, half, radii)
    return rows[half > 0.0]


def arc_rows(centres, radii, low, high):
    """Return arcs as rows, from one angle to another, split at WIDEST_ARC."""
    # Equal parts of at most WIDEST_ARC; the margin keeps rounding from adding one more.
    counts = np.maximum(np.ceil((high - low) / WIDEST_ARC - 1e-9), 1.0).astype(int)
    owner = np.repeat(np.arange(len(counts)), counts)
    place = np.concatenate([np.arange(count) for count in counts]) if len(counts) else owner
    half = 0.5 * (high - low)[owner] / counts[owner]
    angle = low[owner] + half * (2.0 * place + 1.0)
    way = np.column_stack([np.cos(angle), np.sin(angle)])
    radius, centre = radii[owner], centres[owner]
    middle = centre + (radius * np.cos(half))[:, None] * way
    # tan of a quarter of the arc's angle: the end of the parameter tan(φ/2), φ measured from the
    # middle.
    size, extent = np.tan(0.5 * half), radius * np.sin(half)
    return Piece.of(centre, way, size, radius, middle, extent, radius)


def outline_pieces(parts: Sequence[Part]) -> np.ndarray:
    """Return the exact outline of a shape's parts as pieces.

    Parameters
    ----------
    parts : sequence of Part
        Cores, each swept by its disk, e.g. ``shape.parts``.

    Returns
    -------
    array (k,) of Piece
        Offset edges and arcs, cut where another part of the shape covers them, holes included.
    """
    if is_disc(parts):
        [centre] = parts[0].rings[0]
        # A disc is four arcs of a quarter circle.
        radius = np.array([float(parts[0].radius)])
        return arc_rows(centre[None], radius, np.zeros(1), np.full(1, 2.0 * np.pi))
    # The exposed chords and arcs of moments.py are the pieces.
    found = pieces_of(parts)
    origins, units, low, high, radius = exposed_chords(parts, found)
    segments = segment_rows(origins, units, low, high, radius)
    return Piece.joined([segments, arc_rows(*exposed_arcs(parts, found))])


def polygon_pieces(vertices: np.ndarray) -> np.ndarray:
    """Return the outline of a polygon with sharp corners as pieces.

    Parameters
    ----------
    vertices : (N, 2) array
        Corners [m], in either direction.

    Returns
    -------
    array (N,) of Piece

    Raises
    ------
    ShapeError
        For fewer than three corners.
    """
    corners = np.asarray(vertices, dtype=float)
    if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3:
        raise ShapeError(
            f"a polygon needs corners (N, 2) with N of 3 or more, found an array {corners.shape}"
        )
    if signed_area(corners) < 0.0:
        corners = corners[::-1]
    ways = np.roll(corners, -1, axis=0) - corners
    lengths = np.hypot(*ways.T)
    return segment_rows(corners, ways / lengths[:, None], np.zeros(len(lengths)), lengths, 0.0)


class Pieces(NamedTuple):
    """Pieces of some bodies; a Scene has the same fields."""

    pieces: np.ndarray
    first_piece: np.ndarray


@lru_cache(maxsize=256)
def pieces_of_shape(shape: Shape) -> np.ndarray:
    """Return the pieces of a shape's outline around its centroid."""
    return outline_pieces(shape.parts)


def pieces_that_count(shape: Shape) -> np.ndarray:
    """Return the pieces of a shape's outline without rounding remnants, which cost as much as
    others."""
    rows = pieces_of_shape(shape)
    return rows[
        (rows["arc_radius"] > 0.0) | (rows["extent"] > SHORTEST_SEGMENT * rows["extent"].max())
    ]


def pieces_of_bodies(shapes: Sequence[Shape], count: int) -> Pieces:
    """Return the Pieces of bodies of these shapes; without shapes, of ``count`` bodies without
    pieces."""
    rows = [pieces_that_count(shape) for shape in shapes] or [Piece.rows(0)] * count
    first = np.concatenate([[0], np.cumsum([len(each) for each in rows])])
    return Pieces(Piece.joined(rows), first.astype(np.int64))


class Pose(NamedTuple):
    """Pose of a body in the frame of another: x, y [m], cosine and sine of its angle."""

    x: float
    y: float
    cosine: float
    sine: float


class Placed(NamedTuple):
    """A Piece in some frame."""

    x: float
    y: float
    direction_x: float
    direction_y: float
    half: float
    arc_radius: float
    middle_x: float
    middle_y: float
    extent: float
    core_depth: float


def piece_at(pieces, row):
    """Return a piece in the frame of its own body."""
    own = pieces[row]
    return Placed(
        own.x, own.y, own.direction_x, own.direction_y, own.half, own.arc_radius,
        own.middle_x, own.middle_y, own.extent, own.core_depth,
    )  # fmt: skip


def placed(pieces, row, pose):
    """Return a piece of a body in a Pose."""
    x, y, c, s = pose
    own = piece_at(pieces, row)
    return Placed(
        x + c * own.x - s * own.y, y + s * own.x + c * own.y,
        c * own.direction_x - s * own.direction_y, s * own.direction_x + c * own.direction_y,
        own.half, own.arc_radius,
        x + c * own.middle_x - s * own.middle_y, y + s * own.middle_x + c * own.middle_y,
        own.extent, own.core_depth,
    )  # fmt: skip


def core_of(piece):
    """Return (midpoint, half the vector between the ends) of the core of a piece [m]."""
    if piece.arc_radius > 0.0:
        return (piece.x, piece.y), (0.0, 0.0)
    # The outward normal is the tangent turned clockwise.
    x = piece.x - piece.core_depth * piece.direction_y
    y = piece.y + piece.core_depth * piece.direction_x
    return (x, y), (piece.half * piece.direction_x, piece.half * piece.direction_y)


def closest_position(x, y, middle, half):
    """Return the position on a core, from −1 to 1, closest to a point."""
    squared = half[0] * half[0] + half[1] * half[1]
    if squared == 0.0:
        return 0.0
    along = ((x - middle[0]) * half[0] + (y - middle[1]) * half[1]) / squared
    return min(max(along, -1.0), 1.0)


def vector_from_core(x, y, piece):
    """Return (dx, dy) from the closest core point of a piece to a point [m], and whether it is an
    end."""
    middle, half = core_of(piece)
    place = closest_position(x, y, middle, half)
    dx, dy = x - middle[0] - place * half[0], y - middle[1] - place * half[1]
    return dx, dy, piece.arc_radius > 0.0 or abs(place) == 1.0


def distance_to(x, y, piece):
    """Return the distance of a point from the swept core behind a piece [m], negative inside."""
    dx, dy, _ = vector_from_core(x, y, piece)
    return math.sqrt(dx * dx + dy * dy) - piece.core_depth


def end_distance(end, middle, half, middle_2, half_2):
    """Return (squared distance, end of one core, closest point of the other core)."""
    x, y = middle[0] + end * half[0], middle[1] + end * half[1]
    place = closest_position(x, y, middle_2, half_2)
    x_2, y_2 = middle_2[0] + place * half_2[0], middle_2[1] + place * half_2[1]
    return (x - x_2) * (x - x_2) + (y - y_2) * (y - y_2), x, y, x_2, y_2


def closest_points(one, other):
    """Return (squared distance, x, y on one core, x, y on the other) of two cores."""
    (middle, half), (middle_2, half_2) = core_of(one), core_of(other)
    # The core of an arc is a point. The distance of two segments is attained at an end of one of
    # them (cores do not cross).
    if one.arc_radius > 0.0:
        return end_distance(0.0, middle, half, middle_2, half_2)
    least = math.inf
    x, y, x_2, y_2 = 0.0, 0.0, 0.0, 0.0
    for end in (-1.0, 1.0):
        if other.arc_radius == 0.0:
            squared, px, py, qx, qy = end_distance(end, middle, half, middle_2, half_2)
            if squared < least:
                least, x, y, x_2, y_2 = squared, px, py, qx, qy
        squared, qx, qy, px, py = end_distance(end, middle_2, half_2, middle, half)
        if squared < least:
            least, x, y, x_2, y_2 = squared, px, py, qx, qy
    return least, x, y, x_2, y_2


def may_be_within(one, other, reach):
    """Return True if two pieces may be closer than a reach [m], by their enclosing circles."""
    dx, dy = one.middle_x - other.middle_x, one.middle_y - other.middle_y
    most = one.extent + other.extent + reach
    return most > 0.0 and dx * dx + dy * dy < most * most


def are_within(one, other, reach):
    """Return True if two pieces, or the swept cores behind them, are closer than a reach [m]."""
    if not may_be_within(one, other, reach):
        return False
    squared, _, _, _, _ = closest_points(one, other)
    most = reach + one.core_depth + other.core_depth
    return squared < most * most


def ends_of(piece):
    """Return the parameters at both ends of a piece: metres along a segment, tan(φ/2) along
    an arc."""
    return -piece.half, piece.half


def at_parameter(piece, parameter):
    """Return (x, y, outward normal, metres per unit of the parameter) at a parameter of a piece."""
    if piece.arc_radius == 0.0:
        x, y = piece.x + parameter * piece.direction_x, piece.y + parameter * piece.direction_y
        return x, y, piece.direction_y, -piece.direction_x, 1.0
    # cos φ and sin φ from t = tan(φ/2), without trigonometric functions.
    grown = 1.0 + parameter * parameter
    c, s = (1.0 - parameter * parameter) / grown, 2.0 * parameter / grown
    nx, ny = (
        c * piece.direction_x - s * piece.direction_y,
        c * piece.direction_y + s * piece.direction_x,
    )
    return (
        piece.x + piece.arc_radius * nx,
        piece.y + piece.arc_radius * ny,
        nx,
        ny,
        2.0 * piece.arc_radius / grown,
    )


def parameter_facing(piece, x, y):
    """Return the parameter at which the normal of a piece points to a point.

    The piece is extended to its line or circle.
    """
    dx, dy = x - piece.x, y - piece.y
    ahead = dx * piece.direction_x + dy * piece.direction_y
    if piece.arc_radius == 0.0:
        return ahead
    aside = dy * piece.direction_x - dx * piece.direction_y
    distance = math.sqrt(dx * dx + dy * dy)
    # Opposite to the middle of the arc: φ = ±π, tan(φ/2) is infinite.
    if distance + ahead <= 1e-9 * distance:
        return math.inf if aside >= 0.0 else -math.inf
    # tan(φ/2) = sin φ/(1 + cos φ).
    return aside / (distance + ahead)


def foot_of(piece, other):
    """Return the parameter at which a piece is closest to another; it may lie beyond its ends."""
    _, x, y, x_2, y_2 = closest_points(piece, other)
    if piece.arc_radius == 0.0:
        return (x - piece.x) * piece.direction_x + (y - piece.y) * piece.direction_y
    return parameter_facing(piece, x_2, y_2)


def ray_parameter(piece, x, y, way, most):
    """Return the parameter at which a ray from a point along a unit vector meets a piece.

    The piece is extended to its line or circle; inf if it lies further than ``most`` [m] away, or
    the ray misses.
    """
    dx, dy = piece.x - x, piece.y - y
    if piece.arc_radius == 0.0:
        # Intersection of two lines, by cross products.
        crossing = way[0] * piece.direction_y - way[1] * piece.direction_x
        along = (
            (dx * piece.direction_y - dy * piece.direction_x) / crossing
            if crossing != 0.0
            else math.inf
        )
    else:
        # Ray and circle: the first of two intersections.
        ahead, aside = dx * way[0] + dy * way[1], dx * way[1] - dy * way[0]
        squared = piece.arc_radius * piece.arc_radius - aside * aside
        along = ahead - math.sqrt(squared) if squared > 0.0 else math.inf
    if not 0.0 < along < most:
        return math.inf
    return parameter_facing(piece, x + along * way[0], y + along * way[1])
