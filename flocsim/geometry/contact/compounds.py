"""The cores of bodies as arrays, with their trees of circles, and what replaces the polygon code in
a scene with cores of several rings: holes, and parts of several radii.

Rows of core points have more columns then: by how much the point's disk is wider than the narrowest
of its body (SWELL), which is the body's spheroradius; how far behind it the point lies at which its
edge ends (ONWARD); and what begins there (BEGINS): nothing at the second point of a segment, an
edge, or a lone point. Circles of the trees go round points that are swept by their SWELL, so that
all that is said of cores elsewhere holds of cores swept so.

A lone point touches edges as their vertex, and other lone points; two of those make one pair, that
of the later body being its vertex.
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
    leaves_of,
    posed,
    run_of,
    tree_of,
)
from flocsim.geometry.shapes.shape import Shape
from flocsim.state.bodies import X, Y

SWELL, ONWARD, BEGINS, POINT_COLUMNS = range(2, 6)
"""Columns of core points behind X and Y: [m], rows, and one of …"""

NOTHING, EDGE, LONE = 0.0, 1.0, 2.0


def point_columns(shape: Shape) -> np.ndarray:
    """The core points of a shape (N, 5)."""
    return np.concatenate([
        ring_columns(ring, part.radius - shape.radius) for part in shape.parts
        for ring in part.rings
    ])  # fmt: skip


def ring_columns(ring: np.ndarray, swell: float) -> np.ndarray:
    """The core points of a ring whose disk is so much wider than the body's narrowest [m]."""
    count = len(ring)
    rows = np.zeros((count, POINT_COLUMNS))
    rows[:, :2], rows[:, SWELL] = ring, swell
    if count == 1:
        rows[0, BEGINS] = LONE
    else:
        rows[:, ONWARD], rows[:, BEGINS] = 1.0, EDGE
        rows[-1, ONWARD] = 1.0 - count
    if count == 2:
        rows[-1, ONWARD], rows[-1, BEGINS] = 0.0, NOTHING
    return rows


def compound_tree(shape: Shape) -> np.ndarray:
    """The tree (2N, 3) of near_pairs.tree_of over the swollen core points of a shape."""
    rows = point_columns(shape)
    points = len(rows)
    tree = np.zeros((2 * points, 3))
    margin = ROUNDING * np.abs(rows[:, :2]).max()
    ends = np.arange(points) + rows[:, ONWARD].astype(int)
    nodes = 1
    while nodes <= leaves_of(points):
        bounds = np.arange(nodes + 1) * points // nodes
        for node in range(nodes):
            members = np.arange(bounds[node], bounds[node + 1])
            members = np.union1d(members, ends[members])
            run, swell = rows[members, :2], rows[members, SWELL]
            low, high = (run - swell[:, None]).min(axis=0), (run + swell[:, None]).max(axis=0)
            centre = 0.5 * (low + high)
            reach = (np.hypot(*(run - centre).T) + swell).max()
            tree[nodes + node] = [*centre, reach + margin]
        nodes *= 2
    return tree


class Outlines(NamedTuple):
    """The cores of some bodies, as the kernels here read them; a Scene has the same fields.

    Core points of body b are rows ``first[b]`` to ``first[b + 1]`` of ``vertices``, its circles the
    rows from ``2 * first[b]`` on of ``tree``. Where a body has a core of several rings, every row
    of ``vertices`` has more columns behind x and y.
    """

    first: np.ndarray
    vertices: np.ndarray
    tree: np.ndarray


@lru_cache(maxsize=256)
def tree_of_shape(shape):
    return compound_tree(shape) if shape.is_compound else tree_of(shape.vertices)


def outlines_of(shapes: Sequence[Shape]) -> Outlines:
    """The Outlines of some shapes, one body each."""
    sizes = [len(shape.vertices) for shape in shapes]
    compound = any(shape.is_compound for shape in shapes)
    rows = [point_columns(shape) if compound else shape.vertices for shape in shapes]
    return Outlines(
        first=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
        # C order whatever the shapes have: another order would be compiled anew.
        vertices=np.ascontiguousarray(np.concatenate(rows)),
        tree=np.concatenate([tree_of_shape(shape) for shape in shapes]),
    )


def begins_pair(vertices, point, start, is_later):
    """Whether a core point and what begins at one of the other body make a pair of features."""
    begins = vertices[start, BEGINS]
    if begins == LONE:
        return is_later and vertices[point, BEGINS] == LONE
    return begins == EDGE


def feature_distance2(vertices, pose, point, start):
    """Squared distance of the cores of a point and of what begins at another body's point [m²]."""
    x, y = posed(pose, vertices[point, X], vertices[point, Y])
    return edge_distance2(vertices, x, y, start, start + int(vertices[start, ONWARD]))


def list_one_way(scene, work, pair, pose, a, b, side_a, leaf_a, side_b, leaf_b, reach):
    """near_pairs.list_one_way of rings and lone points, swollen."""
    vertices = scene.vertices
    start_a, end_a = run_of(side_a, leaf_a)
    start_b, end_b = run_of(side_b, leaf_b)
    room = True
    for point in range(start_a, end_a):
        for start in range(start_b, end_b):
            if begins_pair(vertices, point, start, a == work.pairs[pair].later):
                limit = reach + vertices[point, SWELL] + vertices[start, SWELL]
                if feature_distance2(vertices, pose, point, start) < limit * limit:
                    end = start + int(vertices[start, ONWARD])
                    room = add_pair(work, pair, a, point, b, start, end) and room
    return room


def swollen_run_distance(vertices, pose, side_a, leaf_a, side_b, leaf_b, least):
    """near_pairs.run_distance of points and edges swept by the SWELL of their points."""
    start_a, end_a = run_of(side_a, leaf_a)
    start_b, end_b = run_of(side_b, leaf_b)
    for point in range(start_a, end_a):
        for start in range(start_b, end_b):
            apart = math.sqrt(feature_distance2(vertices, pose, point, start))
            least = min(least, apart - vertices[point, SWELL] - vertices[start, SWELL])
    return least


def swollen_radii(scene, work, row):
    """points.row_radii, of the parts that the vertex and the edge belong to [m]."""
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    point, start = candidate.vertex, candidate.edge_start
    return (
        scene.bodies[a].radius + scene.vertices[point, SWELL],
        scene.bodies[b].radius + scene.vertices[start, SWELL],
    )


def same_corner(scene, body, point, other):
    """Whether two core points of a body are the same one or ends of one edge."""
    apart = other - point
    if apart == 0 or apart == int(scene.vertices[point, ONWARD]):
        return True
    return apart == -int(scene.vertices[other, ONWARD])


FILLINGS: dict[Callable, Callable] = {
    near_pairs.list_one_way: list_one_way,
    near_pairs.run_distance: swollen_run_distance,
    contacts.row_radii: swollen_radii,
    candidates.same_corner: same_corner,
}
"""The replacements, for flocsim.compiler.composer.compose."""
