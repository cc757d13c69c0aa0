"""The outline of a shape as pieces, segments and arcs, for sums over it."""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from flocsim.arrays import BEND, EXTENT, PIECE_COLUMNS
from flocsim.errors import ShapeError
from flocsim.geometry.shapes.cores import signed_area
from flocsim.geometry.shapes.moments import exposed_arcs, exposed_chords, is_disc, pieces_of
from flocsim.geometry.shapes.parts import Part
from flocsim.geometry.shapes.shape import Shape

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
    rows = np.column_stack([middle, units, half, np.zeros_like(half), middle, half, radii])
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
    rows = [centre, way, np.tan(0.5 * half), radius, middle, radius * np.sin(half), radius]
    return np.column_stack(rows)


def outline_pieces(parts: Sequence[Part]) -> np.ndarray:
    """The pieces (k, PIECE_COLUMNS) of the outline of parts, each core ⊕ disk, exact: offset edges
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
    return rows[(rows[:, BEND] > 0.0) | (rows[:, EXTENT] > ROUNDED * rows[:, EXTENT].max())]


def pieces_of_bodies(shapes: Sequence[Shape], count: int) -> Pieces:
    """The Pieces of bodies of these shapes; of so many bodies with none where there are none."""
    rows = [pieces_that_count(shape) for shape in shapes] or [np.zeros((0, PIECE_COLUMNS))] * count
    first = np.concatenate([[0], np.cumsum([len(each) for each in rows])])
    return Pieces(np.ascontiguousarray(np.concatenate(rows)), first.astype(np.int64))
