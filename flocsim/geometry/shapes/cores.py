"""Cores (points and edges), and Parts, cores swept by disks, from which every shape is built.

Geometry of points and edges (distances, areas, crossings, point in polygon) is implemented only
here, in up to two forms: on scalars, for kernels, compiled or not, and on arrays of points.

A part is a core of one or several rings, swept by one disk. A sphere, a segment and a polygon are
one part of one ring; a polygon with holes is one part with a further ring for each hole; several
parts fixed to each other are a composite.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


def closest_share(px, py, ax, ay, bx, by):
    """Return the position on segment a–b closest to p: 0 at a, 1 at b; 0 if a = b."""
    dx = bx - ax
    dy = by - ay
    length2 = dx * dx + dy * dy
    if length2 == 0.0:
        return 0.0
    # Orthogonal projection on the line, clipped to the segment.
    share = ((px - ax) * dx + (py - ay) * dy) / length2
    return min(max(share, 0.0), 1.0)


def segment_distance2(px, py, ax, ay, bx, by):
    share = closest_share(px, py, ax, ay, bx, by)
    dx = px - (ax + share * (bx - ax))
    dy = py - (ay + share * (by - ay))
    return dx * dx + dy * dy


def is_near(px, py, ax, ay, bx, by, limit):
    """Return True if p is within √limit of segment a–b, without a division.

    Exact for integers: centres of pixels often lie just at the limit.
    """
    ux, uy = bx - ax, by - ay
    wx, wy = px - ax, py - ay
    along = wx * ux + wy * uy
    if along <= 0.0:
        return wx * wx + wy * wy <= limit
    length2 = ux * ux + uy * uy
    if along >= length2:
        wx, wy = px - bx, py - by
        return wx * wx + wy * wy <= limit
    # Inside the segment: distance² = across²/length².
    across = wx * uy - wy * ux
    return across * across <= limit * length2


def side(ax, ay, bx, by, px, py):
    """Return twice the signed area of the triangle a, b, p: positive if p is to the left of a–b."""
    return (bx - ax) * (py - ay) - (by - ay) * (px - ax)


def segments_cross(ax, ay, bx, by, cx, cy, dx, dy):
    """Return True if the segments a–b and c–d cross at an inner point of both."""
    return (side(ax, ay, bx, by, cx, cy) > 0.0) != (side(ax, ay, bx, by, dx, dy) > 0.0) and (
        side(cx, cy, dx, dy, ax, ay) > 0.0
    ) != (side(cx, cy, dx, dy, bx, by) > 0.0)


def edges_of(vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (starts, ends) of a core's edges: none for a point, one for a segment, N for a
    polygon."""
    if len(vertices) == 2:
        return vertices[:1], vertices[1:]
    if len(vertices) == 1:
        return vertices[:0], vertices[:0]
    return vertices, np.roll(vertices, -1, axis=0)


def unit_edges(vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    starts, ends = edges_of(vertices)
    lengths = np.hypot(*(ends - starts).T)
    return starts, (ends - starts) / lengths[:, None], lengths


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the z component of the cross product of plane vectors, elementwise."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def signed_area(vertices: np.ndarray) -> float:
    """Return the area of the core polygon [m²], positive for counter-clockwise vertices."""
    return 0.5 * np.sum(cross(vertices, np.roll(vertices, -1, axis=0)))


def from_edges(points: np.ndarray, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return the vectors (k, edges, 2) from the closest point of each edge to each of the points
    (k, 2)."""
    ax, ay = (ends - starts).T
    x, y = points.T[..., None] - starts.T[:, None]
    # Orthogonal projection on every edge, clipped to it.
    share = np.clip((x * ax + y * ay) / (ax * ax + ay * ay), 0.0, 1.0)
    return np.moveaxis(np.stack([x - share * ax, y - share * ay]), 0, -1)


def inside_polygon(points: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Return which of the points (k, 2) lie inside the core polygon (crossing number)."""
    if len(vertices) < 3:
        return np.zeros(len(points), dtype=bool)
    a, b = vertices, np.roll(vertices, -1, axis=0)
    x, y = points[:, :1], points[:, 1:]
    # Edges that a horizontal ray to the right of the point crosses; an odd number means inside.
    straddles = (a[:, 1] > y) != (b[:, 1] > y)
    rise = np.where(b[:, 1] == a[:, 1], 1.0, b[:, 1] - a[:, 1])
    crossing = a[:, 0] + (y - a[:, 1]) / rise * (b[:, 0] - a[:, 0])
    return np.count_nonzero(straddles & (x < crossing), axis=1) % 2 == 1


class Part(NamedTuple):
    """A core swept by one disk.

    ``rings``: (k, 2) [m] each, a point, the ends of a segment or the corners of a polygon; the
    outer ring first, counter-clockwise, then holes, clockwise. ``radius`` [m] of the disk.
    """

    rings: tuple[np.ndarray, ...]
    radius: float

    @property
    def points(self) -> np.ndarray:
        """Core points of all rings (N, 2) [m]."""
        return self.rings[0] if len(self.rings) == 1 else np.concatenate(self.rings)


Parts = tuple[Part, ...]


def is_compound(parts: Sequence[Part]) -> bool:
    """Return True if there is more than one ring."""
    return len(parts) > 1 or len(parts[0].rings) > 1


def moved_parts(parts: Sequence[Part], x: float, y: float, angle: float) -> Parts:
    """Return parts rotated by an angle [rad] about the origin, then shifted."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, s], [-s, c]])
    return tuple(
        Part(tuple(ring @ turn + (x, y) for ring in part.rings), part.radius) for part in parts
    )


def scaled_parts(parts: Sequence[Part], factor: float, radii: float | None = None) -> Parts:
    """Return parts scaled by ``factor``, their spheroradii by ``radii`` (by default also
    ``factor``)."""
    wider = factor if radii is None else radii
    return tuple(
        Part(tuple(ring * factor for ring in part.rings), part.radius * wider) for part in parts
    )


class PointTable(NamedTuple):
    """Parts as columns, for files.

    For every core point its ``place`` (N, 2) [m], the numbers of its ``part`` and of its ``ring``
    in that part (N,), and the ``radius`` (N,) [m] of its part.
    """

    place: np.ndarray
    part: np.ndarray
    ring: np.ndarray
    radius: np.ndarray


def table_of(parts: Sequence[Part]) -> PointTable:
    """Return the PointTable of some parts."""
    rows = [
        (ring, np.full(len(ring), number), np.full(len(ring), place),
         np.full(len(ring), part.radius))
        for number, part in enumerate(parts) for place, ring in enumerate(part.rings)
    ]  # fmt: skip
    return PointTable(*(np.concatenate(column) for column in zip(*rows, strict=True)))


def parts_in(table: PointTable) -> Parts:
    """Return the parts of a PointTable read from a file.

    Raises ValueError if part or ring numbers do not count up from 0, or a part has several radii.
    """
    place, part, ring, radius = (np.asarray(column) for column in table)
    found: list[Part] = []
    names = np.column_stack([part, ring])
    # A new ring begins where the part or ring number changes.
    breaks = np.flatnonzero(np.any(np.diff(names, axis=0) != 0, axis=1)) + 1
    for rows in np.split(np.arange(len(place)), breaks):
        number, hole = names[rows[0]].tolist()
        if np.any(radius[part == number] != radius[rows[0]]):
            raise ValueError("core points of a part have several radii")
        # A new part begins with its outer ring; further rings of it are holes.
        if hole == 0 and number == len(found):
            found.append(Part((place[rows],), float(radius[rows[0]])))
        elif number == len(found) - 1 and hole == len(found[-1].rings):
            found[-1] = Part((*found[-1].rings, place[rows]), found[-1].radius)
        else:
            raise ValueError("numbers of parts and rings do not count up from 0")
    return tuple(found)
