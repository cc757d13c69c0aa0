"""The outline of a shape as pieces, segments and arcs; how far those of two outlines lie apart, and
where to look at one for what another does to it.

Distances are those of the parts of the cores that pieces are offsets of, negative where outlines
overlap. A piece is seen through a Placed: its numbers in the frame of the other body.

What another outline does peaks where it is near, at feet, and falls off over a length of its own
from there. So a piece is cut between its feet; on each side of one Gauss's rule takes what lies
nearer than the length a over which the gap grows by twice itself, and once more what lies beyond
it, by the logarithm of the way.
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

WIDEST = 0.5 * math.pi
"""No arc is longer than this angle [rad]."""

ROUNDED = 1e-7
"""Of the longest piece: segments that are shorter are what rounding has left of a side at a reflex
corner."""


def segment_rows(starts, units, low, high, radius):
    """Rows of segments: each from ``low`` to ``high`` along its unit tangent from its start."""
    middle = starts + 0.5 * (low + high)[:, None] * units
    half = 0.5 * (high - low)
    radii = np.broadcast_to(radius, half.shape)
    rows = Piece.of(middle, units, half, np.zeros_like(half), middle, half, radii)
    return rows[half > 0.0]


def arc_rows(centres, radii, low, high):
    """Rows of arcs from one angle to another, none of them longer than WIDEST."""
    counts = np.maximum(np.ceil((high - low) / WIDEST - 1e-9), 1.0).astype(int)
    owner = np.repeat(np.arange(len(counts)), counts)
    place = np.concatenate([np.arange(count) for count in counts]) if len(counts) else owner
    half = 0.5 * (high - low)[owner] / counts[owner]
    angle = low[owner] + half * (2.0 * place + 1.0)
    way = np.column_stack([np.cos(angle), np.sin(angle)])
    radius, centre = radii[owner], centres[owner]
    middle = centre + (radius * np.cos(half))[:, None] * way
    size, extent = np.tan(0.5 * half), radius * np.sin(half)
    return Piece.of(centre, way, size, radius, middle, extent, radius)


def outline_pieces(parts: Sequence[Part]) -> np.ndarray:
    """The pieces (k,) of the outline of parts, each core ⊕ disk, exact: offset edges
    and arcs as far as no other part of the shape covers them, holes included."""
    if is_disc(parts):
        [centre] = parts[0].rings[0]
        radius = np.array([float(parts[0].radius)])
        return arc_rows(centre[None], radius, np.zeros(1), np.full(1, 2.0 * np.pi))
    found = pieces_of(parts)
    origins, units, low, high, radius = exposed_chords(parts, found)
    segments = segment_rows(origins, units, low, high, radius)
    return np.concatenate([segments, arc_rows(*exposed_arcs(parts, found))])


def polygon_pieces(vertices: np.ndarray) -> np.ndarray:
    """The pieces of a polygon with sharp corners (N, 2) [m], in either sense.

    ShapeError for fewer than three corners.
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
    """The pieces of some bodies; a Scene has the same fields."""

    pieces: np.ndarray
    first_piece: np.ndarray


@lru_cache(maxsize=256)
def pieces_of_shape(shape: Shape) -> np.ndarray:
    """The pieces of a shape's outline around its centroid."""
    return outline_pieces(shape.parts)


def pieces_that_count(shape: Shape) -> np.ndarray:
    """The pieces of a shape's outline without those that are nothing but rounding: they would be
    looked at as often as any other."""
    rows = pieces_of_shape(shape)
    return rows[(rows["bend"] > 0.0) | (rows["extent"] > ROUNDED * rows["extent"].max())]


def pieces_of_bodies(shapes: Sequence[Shape], count: int) -> Pieces:
    """The Pieces of bodies of these shapes; of so many bodies with none where there are none."""
    rows = [pieces_that_count(shape) for shape in shapes] or [Piece.rows(0)] * count
    first = np.concatenate([[0], np.cumsum([len(each) for each in rows])])
    return Pieces(np.ascontiguousarray(np.concatenate(rows)), first.astype(np.int64))


class Pose(NamedTuple):
    """Where a body lies in the frame of another: x, y [m], cosine and sine of its angle."""

    x: float
    y: float
    cosine: float
    sine: float


class Placed(NamedTuple):
    """A Piece in some frame."""

    x: float
    y: float
    way_x: float
    way_y: float
    half: float
    bend: float
    middle_x: float
    middle_y: float
    extent: float
    inward: float


def piece_at(pieces, row):
    """A piece in the frame of its own body."""
    own = pieces[row]
    return Placed(
        own.x, own.y, own.way_x, own.way_y, own.half, own.bend,
        own.middle_x, own.middle_y, own.extent, own.inward,
    )  # fmt: skip


def placed(pieces, row, pose):
    """A piece of a body that lies in a Pose."""
    x, y, c, s = pose
    own = piece_at(pieces, row)
    return Placed(
        x + c * own.x - s * own.y, y + s * own.x + c * own.y,
        c * own.way_x - s * own.way_y, s * own.way_x + c * own.way_y,
        own.half, own.bend,
        x + c * own.middle_x - s * own.middle_y, y + s * own.middle_x + c * own.middle_y,
        own.extent, own.inward,
    )  # fmt: skip


def core_of(piece):
    """(middle, half the way from it to either end) of the core of a piece, (x, y), (x, y) [m]."""
    if piece.bend > 0.0:
        return (piece.x, piece.y), (0.0, 0.0)
    # The outward normal is the tangent turned clockwise.
    x = piece.x - piece.inward * piece.way_y
    y = piece.y + piece.inward * piece.way_x
    return (x, y), (piece.half * piece.way_x, piece.half * piece.way_y)


def place_beside(x, y, middle, half):
    """Where on a core, from −1 to 1, it is nearest to a point."""
    squared = half[0] * half[0] + half[1] * half[1]
    if squared == 0.0:
        return 0.0
    along = ((x - middle[0]) * half[0] + (y - middle[1]) * half[1]) / squared
    return min(max(along, -1.0), 1.0)


def from_core(x, y, piece):
    """(dx, dy) to a point from where the core of a piece is nearest to it [m], and whether that is
    an end of the core."""
    middle, half = core_of(piece)
    place = place_beside(x, y, middle, half)
    dx, dy = x - middle[0] - place * half[0], y - middle[1] - place * half[1]
    return dx, dy, piece.bend > 0.0 or abs(place) == 1.0


def distance_to(x, y, piece):
    """How far a point is outside of what lies behind a piece [m], negative inside of it."""
    dx, dy, _ = from_core(x, y, piece)
    return math.sqrt(dx * dx + dy * dy) - piece.inward


def beside_end(end, middle, half, middle_2, half_2):
    """(squared distance, x, y of an end of a core, x, y on the other one) where that is nearest."""
    x, y = middle[0] + end * half[0], middle[1] + end * half[1]
    place = place_beside(x, y, middle_2, half_2)
    x_2, y_2 = middle_2[0] + place * half_2[0], middle_2[1] + place * half_2[1]
    return (x - x_2) * (x - x_2) + (y - y_2) * (y - y_2), x, y, x_2, y_2


def between_cores(one, other):
    """(squared distance, x, y on the one's core, x, y on the other's) where two are nearest."""
    (middle, half), (middle_2, half_2) = core_of(one), core_of(other)
    # The core of an arc is a point.
    if one.bend > 0.0:
        return beside_end(0.0, middle, half, middle_2, half_2)
    least = math.inf
    x, y, x_2, y_2 = 0.0, 0.0, 0.0, 0.0
    for end in (-1.0, 1.0):
        if other.bend == 0.0:
            squared, px, py, qx, qy = beside_end(end, middle, half, middle_2, half_2)
            if squared < least:
                least, x, y, x_2, y_2 = squared, px, py, qx, qy
        squared, qx, qy, px, py = beside_end(end, middle_2, half_2, middle, half)
        if squared < least:
            least, x, y, x_2, y_2 = squared, px, py, qx, qy
    return least, x, y, x_2, y_2


def may_be_within(one, other, reach):
    """Whether two pieces may be nearer to each other than a reach [m], by the circles that hold
    them."""
    dx, dy = one.middle_x - other.middle_x, one.middle_y - other.middle_y
    most = one.extent + other.extent + reach
    return most > 0.0 and dx * dx + dy * dy < most * most


def are_within(one, other, reach):
    """Whether two pieces, or what lies behind them, are nearer to each other than a reach [m]."""
    if not may_be_within(one, other, reach):
        return False
    squared, _, _, _, _ = between_cores(one, other)
    most = reach + one.inward + other.inward
    return squared < most * most


def ends_of(piece):
    """The parameters at both ends of a piece: metres along a segment, tan(φ/2) along an arc."""
    return -piece.half, piece.half


def at_parameter(piece, parameter):
    """(x, y), (outward normal), and metres for a unit of the parameter, at one of a piece."""
    if piece.bend == 0.0:
        x, y = piece.x + parameter * piece.way_x, piece.y + parameter * piece.way_y
        return x, y, piece.way_y, -piece.way_x, 1.0
    grown = 1.0 + parameter * parameter
    c, s = (1.0 - parameter * parameter) / grown, 2.0 * parameter / grown
    nx, ny = c * piece.way_x - s * piece.way_y, c * piece.way_y + s * piece.way_x
    return piece.x + piece.bend * nx, piece.y + piece.bend * ny, nx, ny, 2.0 * piece.bend / grown


def parameter_beside(piece, x, y):
    """The parameter at which the normal of a piece, or of the line or circle that it is part of,
    leads to a point."""
    dx, dy = x - piece.x, y - piece.y
    ahead = dx * piece.way_x + dy * piece.way_y
    if piece.bend == 0.0:
        return ahead
    aside = dy * piece.way_x - dx * piece.way_y
    distance = math.sqrt(dx * dx + dy * dy)
    if distance + ahead <= 1e-9 * distance:
        return math.inf if aside >= 0.0 else -math.inf
    return aside / (distance + ahead)


def foot_of(piece, other):
    """The parameter at which a piece is nearest to another; it may lie beyond its ends."""
    _, x, y, x_2, y_2 = between_cores(piece, other)
    if piece.bend == 0.0:
        return (x - piece.x) * piece.way_x + (y - piece.y) * piece.way_y
    return parameter_beside(piece, x_2, y_2)


def parameter_before(piece, x, y, way, most):
    """The parameter at which a ray from a point along a unit vector ``way`` meets a piece, or the
    line or circle that it is part of, no further than ``most`` [m] away; inf where it does not."""
    dx, dy = piece.x - x, piece.y - y
    if piece.bend == 0.0:
        crossing = way[0] * piece.way_y - way[1] * piece.way_x
        along = (dx * piece.way_y - dy * piece.way_x) / crossing if crossing != 0.0 else math.inf
    else:
        ahead, aside = dx * way[0] + dy * way[1], dx * way[1] - dy * way[0]
        squared = piece.bend * piece.bend - aside * aside
        along = ahead - math.sqrt(squared) if squared > 0.0 else math.inf
    if not 0.0 < along < most:
        return math.inf
    return parameter_beside(piece, x + along * way[0], y + along * way[1])
