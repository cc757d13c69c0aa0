"""Which vertex–edge pairs of two bodies are near each other, and how near the two outlines are.

Both trees of circles are walked against each other (see circle_tree.py), in the frame of one body.
"""

import math
from collections.abc import Callable

import flocsim.arrays as at
from flocsim.geometry.contact import circle_tree as trees
from flocsim.geometry.contact import points
from flocsim.geometry.contact.separation import length_of, separation
from flocsim.geometry.shapes.cores import edge_count, edge_end
from flocsim.hooks import hook


def pose_of(scene, work, a, b):
    """(c, s, x, y): the turn and the shift that take a's points into b's frame now."""
    x, y = separation(scene, work, at.NOW, a, b)
    turn = work.motion[at.NOW, a, at.ANGLE] - work.motion[at.NOW, b, at.ANGLE]
    c, s = math.cos(work.motion[at.NOW, b, at.ANGLE]), math.sin(work.motion[at.NOW, b, at.ANGLE])
    return math.cos(turn), math.sin(turn), c * x + s * y, c * y - s * x


def add_pair(work, pair, a, point, b, start, end):
    """Append a pair of features to the list; False where no room is left."""
    row = work.tally[at.CANDIDATES]
    if row == work.candidates.shape[0]:
        work.tally[at.FULL] = at.CANDIDATES_FULL
        return False
    new = work.candidates
    new[row, at.VERTEX_BODY], new[row, at.VERTEX] = a, point
    new[row, at.EDGE_BODY], new[row, at.EDGE_START], new[row, at.EDGE_END] = b, start, end
    new[row, at.CLOSED], new[row, at.NEAR] = 0, 0
    new[row, at.SLIDING], new[row, at.PAIR] = 0, pair
    work.tally[at.CANDIDATES] = row + 1
    return True


@hook
def list_one_way(scene, work, pair, pose, a, b, side_a, leaf_a, side_b, leaf_b, reach):
    """List pairs of a leaf's points and another's edges nearer than the reach; False if full."""
    vertices = scene.vertices
    first_b, points_b, _, _ = side_b
    edges = first_b + edge_count(points_b)
    start_a, end_a = trees.run_of(side_a, leaf_a)
    start_b, end_b = trees.run_of(side_b, leaf_b)
    room = True
    for point in range(start_a, end_a):
        x, y = trees.posed(pose, vertices[point, at.X], vertices[point, at.Y])
        for start in range(start_b, min(end_b, edges)):
            end = edge_end(first_b, points_b, start)
            if trees.edge_distance2(vertices, x, y, start, end) < reach * reach:
                room = add_pair(work, pair, a, point, b, start, end) and room
    return room


@hook
def list_polygons(scene, work, pair, cutoff):
    """List the pairs of features of two bodies, both ways round; False for a full list."""
    a, b = work.pairs[pair, at.LATER], work.pairs[pair, at.EARLIER]
    side_a, side_b = trees.side_of(scene, a), trees.side_of(scene, b)
    _, points_a, _, _ = side_a
    _, points_b, _, _ = side_b
    if points_a == 1 and points_b == 1:
        return list_spheres(scene, work, pair, cutoff)
    reach = scene.bodies[a, at.RADIUS] + scene.bodies[b, at.RADIUS] + cutoff
    pose = pose_of(scene, work, a, b)
    back = trees.reversed_pose(pose)
    plan = trees.plan_of(scene.tree, side_a, side_b)
    walk = trees.START
    room = True
    while trees.goes_on(walk) and room:
        if not trees.within(scene.tree, pose, plan, walk, reach):
            walk = trees.passed(plan, walk)
        elif trees.at_leaves(plan, walk):
            i, j, _, _ = walk
            room = list_one_way(scene, work, pair, pose, a, b, side_a, i, side_b, j, reach)
            room = room and list_one_way(scene, work, pair, back, b, a, side_b, j, side_a, i, reach)
            walk = trees.passed(plan, walk)
        else:
            walk = trees.descended(plan, walk)
    return room


def list_spheres(scene, work, pair, cutoff):
    """List the one pair of two spheres where its gap is below the cut-off; False if full."""
    a, b = work.pairs[pair, at.LATER], work.pairs[pair, at.EARLIER]
    if sphere_gap(scene, work, a, b) >= cutoff:
        return True
    point = scene.first[b]
    return add_pair(work, pair, a, scene.first[a], b, point, point)


def sphere_gap(scene, work, a, b):
    """The gap of two spheres now [m]."""
    ox, oy = separation(scene, work, at.NOW, a, b)
    return length_of(ox, oy) - scene.bodies[a, at.RADIUS] - scene.bodies[b, at.RADIUS]


@hook
def gap_between(scene, work, a, b):
    """The distance between two outlines now [m], negative where they overlap."""
    contact = scene.bodies[a, at.RADIUS] + scene.bodies[b, at.RADIUS]
    return trees.core_distance(scene, a, b, pose_of(scene, work, a, b)) - contact


def turn_nothing(work, state, body):
    """Spheres look the same at every angle."""


SPHERES_ONLY: dict[Callable, Callable] = {
    points.turn_body: turn_nothing,
    list_polygons: list_spheres,
    gap_between: sphere_gap,
    points.locate_polygons: points.locate_spheres,
}
"""What replaces the polygon code in a scene of spheres, for flocsim.compiler.composer.compose: one
pair per two bodies."""
