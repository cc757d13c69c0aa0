"""Near vertex–edge pairs of two outlines, and their smallest distance, by trees of circles.

Two trees (core_points.py) are traversed against each other without a stack: which of the two is
split next follows from the sizes of their pieces alone, so the way back up is known as well.

Distances are computed in the frame of one body. A *pose* (c, s, x, y) rotates and shifts points of
the other body into it, for visited nodes only. Inner functions receive scalars and single arrays
instead of the whole scene, which would cost more to pass than they do to run.

A lone point touches edges as a vertex, and other lone points. Two lone points form one pair, in
which the later body provides the vertex.
"""

import math
from collections.abc import Callable

from flocsim.geometry.contact import points as contacts
from flocsim.geometry.contact.core_points import leaves_of
from flocsim.geometry.contact.points import length_of, separation
from flocsim.geometry.shapes.cores import segment_distance2
from flocsim.hooks import hook
from flocsim.state.bodies import ANGLE
from flocsim.state.clock import CANDIDATES_FULL
from flocsim.state.outlines import EDGE, LONE
from flocsim.state.work import NOW


def tree_side(outlines, body):
    """Return (first core point, number, first row of the tree, leaves) of a body's outline."""
    first = outlines.first[body]
    points = outlines.first[body + 1] - first
    return first, points, 2 * first, leaves_of(points)


def leaf_points(side, leaf):
    """Return (first, end) of the core points of a leaf."""
    first, points, _, leaves = side
    # The same integer bounds as in `circles_of`: exact, since the divisor is a power of two.
    share = points / leaves
    place = leaf - leaves
    return first + int(place * share), first + int((place + 1) * share)


def reversed_pose(pose):
    """Return the inverse pose, which maps the other body's points into the frame of this one."""
    c, s, x, y = pose
    return c, -s, -c * x - s * y, s * x - c * y


def in_other_frame(pose, x, y):
    """Return a point of one body in the frame of the other [m]."""
    c, s, shift_x, shift_y = pose
    return c * x - s * y + shift_x, s * x + c * y + shift_y


def edge_distance2(vertices, x, y, start, end):
    """Return the squared distance of a point from the edge between two core points [m²]."""
    return segment_distance2(
        x, y, vertices[start].x, vertices[start].y, vertices[end].x, vertices[end].y
    )


def traversal_plan(tree, side_a, side_b):
    """Return the constants of a traversal: first rows, leaves and root radii of both trees."""
    _, _, row_a, leaves_a = side_a
    _, _, row_b, leaves_b = side_b
    size_a, size_b = tree[row_a + 1].radius, tree[row_b + 1].radius
    return row_a, row_b, leaves_a, leaves_b, size_a, size_b


START = (1, 1, 1, 1)
"""The traversal at both roots: node of a, node of b, number of nodes on a's level, on b's level.

A traversal has ended when its first number is 0.
"""


def has_nodes(walk):
    i, _, _, _ = walk
    return i > 0


def circle_distance(tree, pose, plan, walk):
    """Return (squared distance of centres, sum of radii) of the circles of the two nodes."""
    i, j, _, _ = walk
    row_a, row_b, _, _, _, _ = plan
    one, other = row_a + i, row_b + j
    # Only the centre of a's circle is transformed, and only here.
    x, y = in_other_frame(pose, tree[one].x, tree[one].y)
    dx, dy = x - tree[other].x, y - tree[other].y
    return dx * dx + dy * dy, tree[one].radius + tree[other].radius


def may_be_closer(tree, pose, plan, walk, distance):
    """Return True if the runs of the two nodes may be closer to each other than a distance [m].

    The distance is negative where cores of different spheroradii overlap.
    """
    distance2, radii = circle_distance(tree, pose, plan, walk)
    reach = radii + distance
    return reach > 0.0 and distance2 < reach * reach


def at_leaves(plan, walk):
    _, _, level_a, level_b = walk
    _, _, leaves_a, leaves_b, _, _ = plan
    return level_a == leaves_a and level_b == leaves_b


def descend(plan, walk):
    """Return the traversal at the first child of the larger piece, a's if they are equal."""
    i, j, level_a, level_b = walk
    _, _, leaves_a, leaves_b, size_a, size_b = plan
    # A piece on a level of n nodes is about 1/n of its outline.
    larger = size_a * level_b >= size_b * level_a
    if level_a < leaves_a and (larger or level_b == leaves_b):
        return 2 * i, j, 2 * level_a, level_b
    return i, 2 * j, level_a, 2 * level_b


def skip_subtree(plan, walk):
    """Return the traversal at the successor of the two nodes, skipping everything below them."""
    i, j, level_a, level_b = walk
    _, _, _, _, size_a, size_b = plan
    while level_a * level_b > 1:
        # Pieces are split in the order of their sizes, so the smaller piece was split last. Move to
        # its sibling, or go up if it is the second child (odd number).
        if level_b == 1 or (level_a > 1 and size_a * level_b < size_b * level_a):
            if i & 1 == 0:
                return i + 1, j, level_a, level_b
            i, level_a = i >> 1, level_a >> 1
        else:
            if j & 1 == 0:
                return i, j + 1, level_a, level_b
            j, level_b = j >> 1, level_b >> 1
    return 0, 0, 1, 1


def leaf_distance_one_way(vertices, pose, side_a, leaf_a, side_b, leaf_b, least):
    """Return the smaller of ``least`` and the distances from a's points to b's edges [m], less what
    their spheroradii exceed the smallest by."""
    start_a, end_a = leaf_points(side_a, leaf_a)
    start_b, end_b = leaf_points(side_b, leaf_b)
    for point in range(start_a, end_a):
        x, y = in_other_frame(pose, vertices[point].x, vertices[point].y)
        for start in range(start_b, end_b):
            end = start + vertices[start].edge_offset
            apart = math.sqrt(edge_distance2(vertices, x, y, start, end))
            excess = vertices[point].excess_radius + vertices[start].excess_radius
            least = min(least, apart - excess)
    return least


def leaf_distance(vertices, pose, side_a, side_b, walk, least):
    """Return the smaller of ``least`` and the distance of the runs of two leaves [m]."""
    i, j, _, _ = walk
    least = leaf_distance_one_way(vertices, pose, side_a, i, side_b, j, least)
    return leaf_distance_one_way(vertices, reversed_pose(pose), side_b, j, side_a, i, least)


def nearer_child(tree, pose, plan, walk):
    """Return the traversal at the child of the larger piece whose circle is closer to the other
    piece."""
    _, _, level_a, level_b = walk
    child = descend(plan, walk)
    i, j, child_a, child_b = child
    sibling = i + (child_a > level_a), j + (child_b > level_b), child_a, child_b
    near, radii = circle_distance(tree, pose, plan, child)
    far, other_radii = circle_distance(tree, pose, plan, sibling)
    if math.sqrt(near) - radii <= math.sqrt(far) - other_radii:
        return child
    return sibling


def core_distance(outlines, a, b, pose):
    """Return the smallest distance [m] between the cores of two bodies, from core points to edges.

    ``pose`` maps a's points into b's frame. For cores of several spheroradii it is negative where
    they overlap. Branch and bound: descend directly to two close leaves for a first bound, then
    visit only pairs of nodes that can be closer.
    """
    vertices, tree = outlines.vertices, outlines.tree
    side_a, side_b = tree_side(outlines, a), tree_side(outlines, b)
    plan = traversal_plan(tree, side_a, side_b)
    # First bound: greedy descent.
    walk = START
    while not at_leaves(plan, walk):
        walk = nearer_child(tree, pose, plan, walk)
    least = leaf_distance(vertices, pose, side_a, side_b, walk, math.inf)
    # Full traversal, pruned with the best distance so far.
    walk = START
    while has_nodes(walk):
        if not may_be_closer(tree, pose, plan, walk, least):
            walk = skip_subtree(plan, walk)
        elif at_leaves(plan, walk):
            least = leaf_distance(vertices, pose, side_a, side_b, walk, least)
            walk = skip_subtree(plan, walk)
        else:
            walk = descend(plan, walk)
    return least


def pose_of(scene, work, a, b):
    """Return the present pose (c, s, x, y) that maps a's points into b's frame."""
    x, y = separation(scene, work, NOW, a, b)
    turn = work.place[NOW, a, ANGLE] - work.place[NOW, b, ANGLE]
    c, s = math.cos(work.place[NOW, b, ANGLE]), math.sin(work.place[NOW, b, ANGLE])
    return math.cos(turn), math.sin(turn), c * x + s * y, c * y - s * x


def add_pair(scene, work, pair, a, point, b, start, end):
    """Append a pair of features to the list; return False if there is no room."""
    row = work.tally.candidates
    if row == work.candidates.shape[0]:
        work.tally.full = CANDIDATES_FULL
        return False
    new, points = work.candidates[row], scene.vertices
    new.vertex_body, new.vertex = a, point
    new.edge_body, new.edge_start, new.edge_end = b, start, end
    new.contact_mode = new.surface_active = new.slide_direction = 0
    new.pair = pair
    new.vertex_radius = scene.bodies[a].radius + points[point].excess_radius
    new.edge_radius = scene.bodies[b].radius + points[start].excess_radius
    work.tally.candidates = row + 1
    return True


def begins_pair(vertices, point, start, is_later):
    """Return True if a core point and the feature that begins at another one form a pair."""
    # Two lone points form one pair only: the later body has the vertex.
    if vertices[start].feature == LONE:
        return is_later and vertices[point].feature == LONE
    return vertices[start].feature == EDGE


def list_one_way(scene, work, pair, pose, a, b, side_a, leaf_a, side_b, leaf_b, reach):
    """List pairs of one leaf's points and another leaf's edges closer than the reach; False if
    full."""
    vertices, is_later = scene.vertices, a == work.pairs[pair].later
    start_a, end_a = leaf_points(side_a, leaf_a)
    start_b, end_b = leaf_points(side_b, leaf_b)
    room = True
    for point in range(start_a, end_a):
        x, y = in_other_frame(pose, vertices[point].x, vertices[point].y)
        for start in range(start_b, end_b):
            end = start + vertices[start].edge_offset
            limit = reach + vertices[point].excess_radius + vertices[start].excess_radius
            near = edge_distance2(vertices, x, y, start, end) < limit * limit
            if near and begins_pair(vertices, point, start, is_later):
                room = add_pair(scene, work, pair, a, point, b, start, end) and room
    return room


@hook
def list_polygons(scene, work, pair, cutoff):
    """List the pairs of features of two bodies in both roles; return False if the list is full."""
    a, b = work.pairs[pair].later, work.pairs[pair].earlier
    side_a, side_b = tree_side(scene, a), tree_side(scene, b)
    _, points_a, _, _ = side_a
    _, points_b, _, _ = side_b
    if points_a == 1 and points_b == 1:
        return list_spheres(scene, work, pair, cutoff)
    reach = scene.bodies[a].radius + scene.bodies[b].radius + cutoff
    pose = pose_of(scene, work, a, b)
    back = reversed_pose(pose)
    plan = traversal_plan(scene.tree, side_a, side_b)
    walk = START
    room = True
    while has_nodes(walk) and room:
        if not may_be_closer(scene.tree, pose, plan, walk, reach):
            walk = skip_subtree(plan, walk)
        elif at_leaves(plan, walk):
            i, j, _, _ = walk
            # Vertices of a against edges of b, then the reverse.
            room = list_one_way(scene, work, pair, pose, a, b, side_a, i, side_b, j, reach)
            room = room and list_one_way(scene, work, pair, back, b, a, side_b, j, side_a, i, reach)
            walk = skip_subtree(plan, walk)
        else:
            walk = descend(plan, walk)
    return room


def list_spheres(scene, work, pair, cutoff):
    """List the one pair of two spheres if its gap is below the cut-off; return False if full."""
    a, b = work.pairs[pair].later, work.pairs[pair].earlier
    if sphere_gap(scene, work, a, b) >= cutoff:
        return True
    point = scene.first[b]
    return add_pair(scene, work, pair, a, scene.first[a], b, point, point)


def sphere_gap(scene, work, a, b):
    """Return the present gap of two spheres [m]."""
    ox, oy = separation(scene, work, NOW, a, b)
    return length_of(ox, oy) - scene.bodies[a].radius - scene.bodies[b].radius


@hook
def gap_between(scene, work, a, b):
    """Return the present distance between two outlines [m], negative where they overlap."""
    contact = scene.bodies[a].radius + scene.bodies[b].radius
    return core_distance(scene, a, b, pose_of(scene, work, a, b)) - contact


def skip_rotation(work, state, body):
    """Do nothing: spheres look the same at every angle."""


SPHERES_ONLY: dict[Callable, Callable] = {
    contacts.update_rotation: skip_rotation,
    list_polygons: list_spheres,
    gap_between: sphere_gap,
    contacts.locate_polygons: contacts.locate_spheres,
}
"""{hook: its replacement in scenes of spheres}, where two bodies form one pair."""
