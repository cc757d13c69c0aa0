"""Cores of several rings (holes, parts with different spheroradii): arrays, trees and hooks.

Rows of core points have three more columns. EXCESS_RADIUS: spheroradius of the point's part minus
the smallest of the body. EDGE_OFFSET: row offset to the end of the edge that begins here. FEATURE:
kind of the feature that begins here: NOTHING (second end of a segment), EDGE, or LONE point.
Circles of the trees enclose points swept by their EXCESS_RADIUS, so the statements about cores in
near_pairs.py hold for cores swept like this.

A lone point touches edges as a vertex, and other lone points. Two lone points form one pair, in
which the later body provides the vertex.
"""

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from flocsim.geometry.contact import candidates, near_pairs
from flocsim.geometry.contact import points as contacts
from flocsim.geometry.contact.near_pairs import (
    ROUNDING,
    add_pair,
    edge_distance2,
    in_other_frame,
    leaf_points,
    leaves_of,
    tree_of,
)
from flocsim.geometry.shapes.shape import Shape
from flocsim.state.bodies import X, Y

EXCESS_RADIUS, EDGE_OFFSET, FEATURE, POINT_COLUMNS = range(2, 6)
"""Columns of core points after X and Y: [m], rows, and one of NOTHING, EDGE and LONE."""

NOTHING, EDGE, LONE = 0.0, 1.0, 2.0


def point_columns(shape: Shape) -> np.ndarray:
    """Return the core points of a shape (N, 5)."""
    return np.concatenate([
        ring_columns(ring, part.radius - shape.radius) for part in shape.parts
        for ring in part.rings
    ])  # fmt: skip


def ring_columns(ring: np.ndarray, swell: float) -> np.ndarray:
    """Return the core points of a ring; ``swell``: excess of its spheroradius over the smallest
    [m]."""
    count = len(ring)
    rows = np.zeros((count, POINT_COLUMNS))
    rows[:, :2], rows[:, EXCESS_RADIUS] = ring, swell
    if count == 1:
        rows[0, FEATURE] = LONE
    else:
        rows[:, EDGE_OFFSET], rows[:, FEATURE] = 1.0, EDGE
        # The last edge closes the ring.
        rows[-1, EDGE_OFFSET] = 1.0 - count
    # A segment has one edge.
    if count == 2:
        rows[-1, EDGE_OFFSET], rows[-1, FEATURE] = 0.0, NOTHING
    return rows


def compound_tree(shape: Shape) -> np.ndarray:
    """Return the tree (2N, 3) of near_pairs.tree_of over the swollen core points of a shape."""
    rows = point_columns(shape)
    points = len(rows)
    tree = np.zeros((2 * points, 3))
    margin = ROUNDING * np.abs(rows[:, :2]).max()
    ends = np.arange(points) + rows[:, EDGE_OFFSET].astype(int)
    nodes = 1
    while nodes <= leaves_of(points):
        bounds = np.arange(nodes + 1) * points // nodes
        for node in range(nodes):
            members = np.arange(bounds[node], bounds[node + 1])
            # A run contains the far ends of its edges, which may lie elsewhere in the array.
            members = np.union1d(members, ends[members])
            run, swell = rows[members, :2], rows[members, EXCESS_RADIUS]
            # Circle around the bounding box of the swollen points.
            low, high = (run - swell[:, None]).min(axis=0), (run + swell[:, None]).max(axis=0)
            centre = 0.5 * (low + high)
            reach = (np.hypot(*(run - centre).T) + swell).max()
            tree[nodes + node] = [*centre, reach + margin]
        nodes *= 2
    return tree


class Outlines(NamedTuple):
    """Cores of some bodies, as the kernels here read them; a Scene has the same fields.

    Core points of body b are rows ``first[b]`` to ``first[b + 1]`` of ``vertices``, its circles the
    rows from ``2 * first[b]`` of ``tree``. If any body has a core of several rings, every row of
    ``vertices`` has the columns EXCESS_RADIUS, EDGE_OFFSET and FEATURE.
    """

    first: np.ndarray
    vertices: np.ndarray
    tree: np.ndarray


@lru_cache(maxsize=256)
def tree_of_shape(shape):
    return compound_tree(shape) if shape.is_compound else tree_of(shape.vertices)


def outlines_of(shapes: Sequence[Shape]) -> Outlines:
    """Return the Outlines of some shapes, one body each."""
    sizes = [len(shape.vertices) for shape in shapes]
    compound = any(shape.is_compound for shape in shapes)
    rows = [point_columns(shape) if compound else shape.vertices for shape in shapes]
    return Outlines(
        first=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
        # C order for all shapes: another memory order would compile the engine again.
        vertices=np.ascontiguousarray(np.concatenate(rows)),
        tree=np.concatenate([tree_of_shape(shape) for shape in shapes]),
    )


def begins_pair(vertices, point, start, is_later):
    """Return True if a core point and the feature that begins at another one form a pair."""
    begins = vertices[start, FEATURE]
    # Two lone points form one pair only: the later body has the vertex.
    if begins == LONE:
        return is_later and vertices[point, FEATURE] == LONE
    return begins == EDGE


def feature_distance2(vertices, pose, point, start):
    """Return the squared distance of a core point and the feature that begins at another one
    [m²]."""
    x, y = in_other_frame(pose, vertices[point, X], vertices[point, Y])
    return edge_distance2(vertices, x, y, start, start + int(vertices[start, EDGE_OFFSET]))


def list_one_way(scene, work, pair, pose, a, b, side_a, leaf_a, side_b, leaf_b, reach):
    """Replace near_pairs.list_one_way for rings and lone points, swollen."""
    vertices = scene.vertices
    start_a, end_a = leaf_points(side_a, leaf_a)
    start_b, end_b = leaf_points(side_b, leaf_b)
    room = True
    for point in range(start_a, end_a):
        for start in range(start_b, end_b):
            if begins_pair(vertices, point, start, a == work.pairs[pair].later):
                limit = reach + vertices[point, EXCESS_RADIUS] + vertices[start, EXCESS_RADIUS]
                if feature_distance2(vertices, pose, point, start) < limit * limit:
                    end = start + int(vertices[start, EDGE_OFFSET])
                    room = add_pair(work, pair, a, point, b, start, end) and room
    return room


def swollen_run_distance(vertices, pose, side_a, leaf_a, side_b, leaf_b, least):
    """Replace near_pairs.leaf_distance_one_way for points and edges swept by EXCESS_RADIUS."""
    start_a, end_a = leaf_points(side_a, leaf_a)
    start_b, end_b = leaf_points(side_b, leaf_b)
    for point in range(start_a, end_a):
        for start in range(start_b, end_b):
            apart = math.sqrt(feature_distance2(vertices, pose, point, start))
            least = min(
                least, apart - vertices[point, EXCESS_RADIUS] - vertices[start, EXCESS_RADIUS]
            )
    return least


def swollen_radii(scene, work, row):
    """Replace points.contact_radii: the spheroradii of the parts of the vertex and the edge [m]."""
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    point, start = candidate.vertex, candidate.edge_start
    return (
        scene.bodies[a].radius + scene.vertices[point, EXCESS_RADIUS],
        scene.bodies[b].radius + scene.vertices[start, EXCESS_RADIUS],
    )


def are_adjacent(scene, body, point, other):
    """Return True if two core points of a body coincide or are the ends of one edge."""
    apart = other - point
    if apart == 0 or apart == int(scene.vertices[point, EDGE_OFFSET]):
        return True
    return apart == -int(scene.vertices[other, EDGE_OFFSET])


FILLINGS: dict[Callable, Callable] = {
    near_pairs.list_one_way: list_one_way,
    near_pairs.leaf_distance_one_way: swollen_run_distance,
    contacts.contact_radii: swollen_radii,
    candidates.are_adjacent: are_adjacent,
}
"""{hook: its replacement in scenes with such cores}."""
