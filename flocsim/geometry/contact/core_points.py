"""Cores as arrays of points, and the trees of circles around them.

A core consists of rings, segments and lone points, each with the spheroradius of its part. The tree
halves a body's core points, each with the edge that begins at it, by number until LEAF to 2 LEAF
points remain: a full tree whose node i has the children 2i and 2i + 1. Every node has a circle
around its run of points and edges, swept by what their spheroradii exceed the smallest by.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from flocsim.geometry.shapes.shape import Shape
from flocsim.state.outlines import EDGE, LONE, NOTHING, Circle, CorePoint

LEAF = 2
"""Core points in a leaf: from this to twice as many."""

ROUNDING = 1e-13
"""Circles are enlarged by this share of the outline's size to cover rounding of distances."""


def leaves_of(points):
    """Return the number of leaves for that many core points: a power of two."""
    leaves = 1
    while 2 * leaves * LEAF <= points:
        leaves *= 2
    return leaves


def ring_points(ring: np.ndarray, excess: float) -> Any:
    """Return the CorePoints of a ring (N, 2) [m]; ``excess`` of its spheroradius [m]."""
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


@lru_cache(maxsize=256)
def circles_of(shape: Shape) -> Any:
    """Return the tree of a shape of N core points: 2N Circles, zeros where there is no node."""
    points = core_points(shape)
    count = len(points)
    places = np.column_stack([points["x"], points["y"]])
    swell, ends = points["excess_radius"], np.arange(count) + points["edge_offset"]
    tree, nodes = Circle.rows(2 * count), 1
    margin = ROUNDING * np.abs(places).max()
    while nodes <= leaves_of(count):
        # The points of each run on one level, short ones with their last point repeated, then the
        # ends of their edges, which may lie elsewhere.
        bounds = np.arange(nodes + 1) * count // nodes
        steps = np.arange(np.diff(bounds).max())
        starts = np.minimum(bounds[:-1, None] + steps, bounds[1:, None] - 1)
        members = np.concatenate([starts, ends[starts]], axis=1)
        runs, wide = places[members], swell[members][:, :, None]
        middle = (runs - wide).min(axis=1) + (runs + wide).max(axis=1)
        # Two candidate centres, the middle of the bounding box and of the chord: keep the smaller
        # circle.
        choices = []
        for centre in (0.5 * middle, 0.5 * (runs[:, 0] + runs[:, -1])):
            reach = np.hypot(*np.moveaxis(runs - centre[:, None], -1, 0)) + swell[members]
            choices.append(np.column_stack([centre, reach.max(axis=1) + margin]))
        box, chord = choices
        circles = np.where(box[:, 2:] <= chord[:, 2:], box, chord)
        tree[nodes : 2 * nodes] = Circle.of(circles)
        nodes *= 2
    return tree


class Outlines(NamedTuple):
    """Cores of some bodies, as the kernels of near_pairs read them; a Scene has the same fields.

    Core points of body b are rows ``first[b]`` to ``first[b + 1]`` of ``vertices``, its circles the
    rows from ``2 * first[b]`` of ``tree``.
    """

    first: np.ndarray
    vertices: np.ndarray
    tree: np.ndarray


def outlines_of(shapes: Sequence[Shape]) -> Outlines:
    """Return the Outlines of some shapes, one body each."""
    points = [core_points(shape) for shape in shapes]
    return Outlines(
        first=np.concatenate([[0], np.cumsum([*map(len, points)])]).astype(np.int64),
        vertices=CorePoint.joined(points),
        tree=Circle.joined(circles_of(shape) for shape in shapes),
    )
