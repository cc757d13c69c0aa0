"""Which vertex–edge pairs of two bodies are near each other, and how near the two outlines are.

A hierarchy of circles lies over each outline, and two of them are walked down against each other. A
body's core points, each with the edge that starts at it, are halved by their number until few are
left: a full binary tree, whose node i has the children 2i and 2i + 1. Every node keeps a circle
around its run of core points and edges, in the body's frame. Two trees are walked without a stack:
which of them is split next follows from the sizes of their pieces alone, so that the way back up
is known as well.

Distances are taken in the frame of one body: a *pose* (c, s, x, y) turns and shifts the other's
points into it, and only those of the nodes that are met. Inner functions are handed scalars and
single arrays instead of the whole scene, which would cost more to pass than they do.
"""

import math
from collections.abc import Callable

import numpy as np

from flocsim.geometry.contact import points as contacts
from flocsim.geometry.contact.points import length_of, separation
from flocsim.geometry.shapes.cores import edge_count, edge_end, segment_distance2
from flocsim.hooks import hook
from flocsim.state.bodies import ANGLE, X, Y
from flocsim.state.clock import CANDIDATES_FULL
from flocsim.state.work import NOW

LEAF = 2
"""Core points in a run that is not split any more: from this to twice as many."""

ROUNDING = 1e-13
"""Circles are drawn larger by this share of the outline's size, for the rounding of distances."""


CIRCLE_X, CIRCLE_Y, CIRCLE_RADIUS = range(3)
"""Columns of a tree."""


def leaves_of(points):
    """How many runs that many core points are halved into: a power of two."""
    leaves = 1
    while 2 * leaves * LEAF <= points:
        leaves *= 2
    return leaves


def level_runs(points, nodes):
    """Core points (nodes, most) of the runs of a level; short rows repeat their last point.

    Each run includes the end of its last edge.
    """
    bounds = np.arange(nodes + 1) * points // nodes
    steps = np.arange(np.diff(bounds).max() + 1)
    return np.minimum(bounds[:-1, None] + steps, bounds[1:, None]) % points


def tree_of(vertices: np.ndarray) -> np.ndarray:
    """The tree (2N, 3) over core points (N, 2) [m]: row i is node i's circle (x, y, radius).

    Rows that the tree does not fill, row 0 among them, are 0.
    """
    points = len(vertices)
    tree = np.zeros((2 * points, 3))
    margin = ROUNDING * np.abs(vertices).max()
    nodes = 1
    while nodes <= leaves_of(points):
        runs = vertices[level_runs(points, nodes)]
        middle, ends = runs.min(axis=1) + runs.max(axis=1), runs[:, 0] + runs[:, -1]
        choices = []
        for centre in (0.5 * middle, 0.5 * ends):
            reach = np.hypot(*np.moveaxis(runs - centre[:, None], -1, 0)).max(axis=1)
            choices.append(np.column_stack([centre, reach + margin]))
        box, chord = choices
        tree[nodes : 2 * nodes] = np.where(box[:, 2:] <= chord[:, 2:], box, chord)
        nodes *= 2
    return tree


def side_of(outlines, body):
    """(first core point, their number, first row of the tree, leaves) of a body's outline."""
    first = outlines.first[body]
    points = outlines.first[body + 1] - first
    return first, points, 2 * first, leaves_of(points)


def run_of(side, leaf):
    """(first, end) of the core points of a leaf."""
    first, points, _, leaves = side
    # Exact: the divisor is a power of two.
    share = points / leaves
    place = leaf - leaves
    return first + int(place * share), first + int((place + 1) * share)


def reversed_pose(pose):
    """The pose that takes the other body's points into the frame of this one."""
    c, s, x, y = pose
    return c, -s, -c * x - s * y, s * x - c * y


def posed(pose, x, y):
    """A point of one body in the frame of the other."""
    c, s, shift_x, shift_y = pose
    return c * x - s * y + shift_x, s * x + c * y + shift_y


def edge_distance2(vertices, x, y, start, end):
    """Squared distance of a point from the edge between two core points [m²]."""
    return segment_distance2(
        x, y, vertices[start, X], vertices[start, Y], vertices[end, X], vertices[end, Y]
    )


def plan_of(tree, side_a, side_b):
    """What steers a walk: first rows and leaves of both trees, radii of their largest circles."""
    _, _, row_a, leaves_a = side_a
    _, _, row_b, leaves_b = side_b
    size_a, size_b = tree[row_a + 1, CIRCLE_RADIUS], tree[row_b + 1, CIRCLE_RADIUS]
    return row_a, row_b, leaves_a, leaves_b, size_a, size_b


START = (1, 1, 1, 1)
"""The walk at both roots: node of a, node of b, nodes on a's level, on b's level.

A walk is over when its first number is 0.
"""


def goes_on(walk):
    i, _, _, _ = walk
    return i > 0


def circles_met(tree, pose, plan, walk):
    """(squared distance of centres, sum of radii) of the circles of the two nodes."""
    i, j, _, _ = walk
    row_a, row_b, _, _, _, _ = plan
    one, other = row_a + i, row_b + j
    x, y = posed(pose, tree[one, CIRCLE_X], tree[one, CIRCLE_Y])
    dx, dy = x - tree[other, CIRCLE_X], y - tree[other, CIRCLE_Y]
    return dx * dx + dy * dy, tree[one, CIRCLE_RADIUS] + tree[other, CIRCLE_RADIUS]


def within(tree, pose, plan, walk, distance):
    """Whether the runs of the two nodes can be nearer to each other than a distance, which is below
    0 where swollen cores overlap (compounds.py)."""
    distance2, radii = circles_met(tree, pose, plan, walk)
    reach = radii + distance
    return reach > 0.0 and distance2 < reach * reach


def at_leaves(plan, walk):
    _, _, level_a, level_b = walk
    _, _, leaves_a, leaves_b, _, _ = plan
    return level_a == leaves_a and level_b == leaves_b


def descended(plan, walk):
    """The walk at the first child of the larger piece, a's where they are alike."""
    i, j, level_a, level_b = walk
    _, _, leaves_a, leaves_b, size_a, size_b = plan
    larger = size_a * level_b >= size_b * level_a
    if level_a < leaves_a and (larger or level_b == leaves_b):
        return 2 * i, j, 2 * level_a, level_b
    return i, 2 * j, level_a, 2 * level_b


def passed(plan, walk):
    """The walk at what comes after the two nodes and all below them."""
    i, j, level_a, level_b = walk
    _, _, _, _, size_a, size_b = plan
    while level_a * level_b > 1:
        # Pieces are split in the order of their sizes, so the smaller piece was split last.
        if level_b == 1 or (level_a > 1 and size_a * level_b < size_b * level_a):
            if i & 1 == 0:
                return i + 1, j, level_a, level_b
            i, level_a = i >> 1, level_a >> 1
        else:
            if j & 1 == 0:
                return i, j + 1, level_a, level_b
            j, level_b = j >> 1, level_b >> 1
    return 0, 0, 1, 1


@hook
def run_distance(vertices, pose, side_a, leaf_a, side_b, leaf_b, least):
    """The smaller of ``least`` and the distances from a's points to b's edges [m]."""
    first_b, points_b, _, _ = side_b
    edges = first_b + max(edge_count(points_b), 1)
    start_a, end_a = run_of(side_a, leaf_a)
    start_b, end_b = run_of(side_b, leaf_b)
    least2 = math.inf
    for point in range(start_a, end_a):
        x, y = posed(pose, vertices[point, X], vertices[point, Y])
        for start in range(start_b, min(end_b, edges)):
            end = edge_end(first_b, points_b, start)
            least2 = min(least2, edge_distance2(vertices, x, y, start, end))
    return min(least, math.sqrt(least2))


def leaf_distance(vertices, pose, side_a, side_b, walk, least):
    """The smaller of ``least`` and the distance of the runs of two leaves [m]."""
    i, j, _, _ = walk
    least = run_distance(vertices, pose, side_a, i, side_b, j, least)
    return run_distance(vertices, reversed_pose(pose), side_b, j, side_a, i, least)


def nearer_child(tree, pose, plan, walk):
    """The walk at that child of the larger piece which seems to be nearer to the other piece."""
    _, _, level_a, level_b = walk
    child = descended(plan, walk)
    i, j, child_a, child_b = child
    sibling = i + (child_a > level_a), j + (child_b > level_b), child_a, child_b
    near, radii = circles_met(tree, pose, plan, child)
    far, other_radii = circles_met(tree, pose, plan, sibling)
    if math.sqrt(near) - radii <= math.sqrt(far) - other_radii:
        return child
    return sibling


def core_distance(outlines, a, b, pose):
    """Smallest distance [m] between a core point of one body and the core of the other; of swollen
    cores below 0 where they overlap.

    ``pose`` takes a's points into b's frame. Branch and bound: straight down to two runs that are
    near, then through all that can be nearer.
    """
    vertices, tree = outlines.vertices, outlines.tree
    side_a, side_b = side_of(outlines, a), side_of(outlines, b)
    plan = plan_of(tree, side_a, side_b)
    walk = START
    while not at_leaves(plan, walk):
        walk = nearer_child(tree, pose, plan, walk)
    least = leaf_distance(vertices, pose, side_a, side_b, walk, math.inf)
    walk = START
    while goes_on(walk):
        if not within(tree, pose, plan, walk, least):
            walk = passed(plan, walk)
        elif at_leaves(plan, walk):
            least = leaf_distance(vertices, pose, side_a, side_b, walk, least)
            walk = passed(plan, walk)
        else:
            walk = descended(plan, walk)
    return least


def pose_of(scene, work, a, b):
    """(c, s, x, y): the turn and the shift that take a's points into b's frame now."""
    x, y = separation(scene, work, NOW, a, b)
    turn = work.place[NOW, a, ANGLE] - work.place[NOW, b, ANGLE]
    c, s = math.cos(work.place[NOW, b, ANGLE]), math.sin(work.place[NOW, b, ANGLE])
    return math.cos(turn), math.sin(turn), c * x + s * y, c * y - s * x


def add_pair(work, pair, a, point, b, start, end):
    """Append a pair of features to the list; False where no room is left."""
    row = work.tally.candidates
    if row == work.candidates.shape[0]:
        work.tally.full = CANDIDATES_FULL
        return False
    new = work.candidates
    new[row].vertex_body, new[row].vertex = a, point
    new[row].edge_body, new[row].edge_start, new[row].edge_end = b, start, end
    new[row].closed, new[row].near = 0, 0
    new[row].sliding, new[row].pair = 0, pair
    work.tally.candidates = row + 1
    return True


@hook
def list_one_way(scene, work, pair, pose, a, b, side_a, leaf_a, side_b, leaf_b, reach):
    """List pairs of a leaf's points and another's edges nearer than the reach; False if full."""
    vertices = scene.vertices
    first_b, points_b, _, _ = side_b
    edges = first_b + edge_count(points_b)
    start_a, end_a = run_of(side_a, leaf_a)
    start_b, end_b = run_of(side_b, leaf_b)
    room = True
    for point in range(start_a, end_a):
        x, y = posed(pose, vertices[point, X], vertices[point, Y])
        for start in range(start_b, min(end_b, edges)):
            end = edge_end(first_b, points_b, start)
            if edge_distance2(vertices, x, y, start, end) < reach * reach:
                room = add_pair(work, pair, a, point, b, start, end) and room
    return room


@hook
def list_polygons(scene, work, pair, cutoff):
    """List the pairs of features of two bodies, both ways round; False for a full list."""
    a, b = work.pairs[pair].later, work.pairs[pair].earlier
    side_a, side_b = side_of(scene, a), side_of(scene, b)
    _, points_a, _, _ = side_a
    _, points_b, _, _ = side_b
    if points_a == 1 and points_b == 1:
        return list_spheres(scene, work, pair, cutoff)
    reach = scene.bodies[a].radius + scene.bodies[b].radius + cutoff
    pose = pose_of(scene, work, a, b)
    back = reversed_pose(pose)
    plan = plan_of(scene.tree, side_a, side_b)
    walk = START
    room = True
    while goes_on(walk) and room:
        if not within(scene.tree, pose, plan, walk, reach):
            walk = passed(plan, walk)
        elif at_leaves(plan, walk):
            i, j, _, _ = walk
            room = list_one_way(scene, work, pair, pose, a, b, side_a, i, side_b, j, reach)
            room = room and list_one_way(scene, work, pair, back, b, a, side_b, j, side_a, i, reach)
            walk = passed(plan, walk)
        else:
            walk = descended(plan, walk)
    return room


def list_spheres(scene, work, pair, cutoff):
    """List the one pair of two spheres where its gap is below the cut-off; False if full."""
    a, b = work.pairs[pair].later, work.pairs[pair].earlier
    if sphere_gap(scene, work, a, b) >= cutoff:
        return True
    point = scene.first[b]
    return add_pair(work, pair, a, scene.first[a], b, point, point)


def sphere_gap(scene, work, a, b):
    """The gap of two spheres now [m]."""
    ox, oy = separation(scene, work, NOW, a, b)
    return length_of(ox, oy) - scene.bodies[a].radius - scene.bodies[b].radius


@hook
def gap_between(scene, work, a, b):
    """The distance between two outlines now [m], negative where they overlap."""
    contact = scene.bodies[a].radius + scene.bodies[b].radius
    return core_distance(scene, a, b, pose_of(scene, work, a, b)) - contact


def turn_nothing(work, state, body):
    """Spheres look the same at every angle."""


SPHERES_ONLY: dict[Callable, Callable] = {
    contacts.turn_body: turn_nothing,
    list_polygons: list_spheres,
    gap_between: sphere_gap,
    contacts.locate_polygons: contacts.locate_spheres,
}
"""What replaces the polygon code in a scene of spheres, for flocsim.compiler.composer.compose: one
pair per two bodies."""
