"""Cores as arrays of points: rings, segments and lone points, each with the spheroradius of its
part."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from flocsim.geometry.shapes.cores import cross
from flocsim.geometry.shapes.shape import Shape
from flocsim.state.outlines import EDGE, LONE, NOTHING, CorePoint

STRAIGHT = 1e-9
"""Angle [rad] up to which an outline goes straight on at a vertex."""


def corners(ring: np.ndarray) -> np.ndarray:
    """Return the vertices of a ring (N, 2) [m] at which its outline turns.

    At a joint of two edges in one line both would bear a contact, with twice the stiffness, and a
    disk that rolls or slides across would lose energy to its vibration.
    """
    if len(ring) <= 3:
        return ring
    before, behind = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    along = np.sum(before * behind, axis=1)
    turns = np.abs(cross(before, behind)) > STRAIGHT * np.abs(along)
    return ring[turns | (along <= 0.0)]


def ring_points(ring: np.ndarray, excess: float) -> Any:
    """Return the CorePoints of a ring (N, 2) [m]; ``excess`` of its spheroradius [m]."""
    ring = corners(ring)
    count = len(ring)
    points = CorePoint.rows(count)
    points["x"], points["y"], points["excess_radius"] = *ring.T, excess
    if count == 1:
        points["feature"] = LONE
        return points
    points["edge_offset"], points["feature"] = 1, EDGE
    # The last edge closes the ring; a segment has one edge.
    points[-1].edge_offset = 1 - count if count > 2 else 0
    if count == 2:
        points[-1].feature = NOTHING
    return points


@lru_cache(maxsize=256)
def core_points(shape: Shape) -> Any:
    """Return the CorePoints of a shape."""
    return CorePoint.joined(
        ring_points(ring, part.radius - shape.radius) for part in shape.parts
        for ring in part.rings
    )  # fmt: skip


class Outlines(NamedTuple):
    """Cores of some bodies, as the kernels of near_pairs read them; a Scene has the same fields.

    Core points of body b are rows ``first[b]`` to ``first[b + 1]`` of ``vertices``.
    """

    first: np.ndarray
    vertices: np.ndarray


def outlines_of(shapes: Sequence[Shape]) -> Outlines:
    """Return the Outlines of some shapes, one body each."""
    points = [core_points(shape) for shape in shapes]
    return Outlines(
        first=np.concatenate([[0], np.cumsum([*map(len, points)])]).astype(np.int64),
        vertices=CorePoint.joined(points),
    )
