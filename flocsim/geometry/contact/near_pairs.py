"""Near vertex–edge pairs of two outlines, and their smallest distance.

A feature is a core point with the edge that begins there. Only features near the other body's
centroid can be near its outline: these are found first, then compared with each other.

Distances are computed in the frame of one body. A *pose* (c, s, x, y) rotates and shifts points of
the other body into it. Inner functions receive scalars and single arrays instead of the whole
scene, which would cost more to pass than they do to run.

A lone point touches edges as a vertex, and other lone points. Two lone points form one pair, in
which the later body provides the vertex.
"""

import math
from collections.abc import Callable

from flocsim.compiler.linker import apart
from flocsim.geometry.contact import points as contacts
from flocsim.geometry.contact.points import length_of, separation
from flocsim.geometry.shapes.cores import segment_distance2
from flocsim.hooks import hook
from flocsim.state.bodies import ANGLE
from flocsim.state.clock import CANDIDATES_FULL
from flocsim.state.outlines import EDGE, LONE
from flocsim.state.work import NOW


def reversed_pose(pose):
    """Return the inverse pose, which maps the other body's points into the frame of this one."""
    c, s, x, y = pose
    return c, -s, -c * x - s * y, s * x - c * y


def in_other_frame(pose, vertices, point):
    """Return a core point of one body in the frame of the other [m]."""
    c, s, shift_x, shift_y = pose
    x, y = vertices[point].x, vertices[point].y
    return c * x - s * y + shift_x, s * x + c * y + shift_y


def edge_distance2(vertices, x, y, point):
    """Return the squared distance of a position from the feature that begins at a core point
    [m²]."""
    # A point without an edge has the offset 0: its feature is the point itself.
    end = point + vertices[point].edge_offset
    return segment_distance2(
        x, y, vertices[point].x, vertices[point].y, vertices[end].x, vertices[end].y
    )


def extent_of(outlines, body):
    """Return the largest distance of a body's core from its centroid, the excess of spheroradii
    included [m]."""
    largest, vertices = 0.0, outlines.vertices
    for point in range(outlines.first[body], outlines.first[body + 1]):
        away = length_of(vertices[point].x, vertices[point].y)
        largest = max(largest, away + vertices[point].excess_radius)
    return largest


def feature_distance(outlines, b, pose, point, least):
    """Return the smaller of ``least`` and the distance of one feature of a body from the core of
    body b [m], less the excess of both spheroradii over the smallest of each body."""
    vertices = outlines.vertices
    x, y = in_other_frame(pose, vertices, point)
    end_x, end_y = in_other_frame(pose, vertices, point + vertices[point].edge_offset)
    for other in range(outlines.first[b], outlines.first[b + 1]):
        # The vertex from the other's edge, and the other's vertex from the edge.
        apart2 = edge_distance2(vertices, x, y, other)
        beyond2 = segment_distance2(vertices[other].x, vertices[other].y, x, y, end_x, end_y)
        excess = vertices[point].excess_radius + vertices[other].excess_radius
        least = min(least, math.sqrt(min(apart2, beyond2)) - excess)
    return least


@apart
def core_distance(outlines, a, b, pose):
    """Return the smallest distance [m] between the cores of two bodies, from core points to edges.

    ``pose`` maps a's points into b's frame. For cores of several spheroradii it is negative where
    they overlap.
    """
    vertices, reach = outlines.vertices, extent_of(outlines, b)
    # First bound: from the feature of a that begins nearest to b's centroid.
    nearest, least2 = outlines.first[a], math.inf
    for point in range(outlines.first[a], outlines.first[a + 1]):
        x, y = in_other_frame(pose, vertices, point)
        if x * x + y * y < least2:
            nearest, least2 = point, x * x + y * y
    least = feature_distance(outlines, b, pose, nearest, math.inf)
    # Then all features that may be nearer.
    back = reversed_pose(pose)
    for point in range(outlines.first[a], outlines.first[a + 1]):
        # Triangle inequality: what is nearer than ``least`` to b's core is nearer to b's
        # centroid than ``least`` plus b's extent.
        most = reach + least + vertices[point].excess_radius
        if most > 0.0 and edge_distance2(vertices, back[2], back[3], point) < most * most:
            least = feature_distance(outlines, b, pose, point, least)
    return least


def pose_of(scene, work, a, b):
    """Return the present pose (c, s, x, y) that maps a's points into b's frame."""
    # In b's frame: a's angle relative to b, and the separation turned back by b's angle.
    x, y = separation(scene, work, NOW, a, b)
    turn = work.place[NOW, a, ANGLE] - work.place[NOW, b, ANGLE]
    c, s = math.cos(work.place[NOW, b, ANGLE]), math.sin(work.place[NOW, b, ANGLE])
    return math.cos(turn), math.sin(turn), c * x + s * y, c * y - s * x


def add_pair(scene, work, pair, a, point, b, start):
    """Append a pair of features to the list; return False if there is no room."""
    row = work.tally.candidates
    if row == work.candidates.shape[0]:
        work.tally.full = CANDIDATES_FULL
        return False
    new, points = work.candidates[row], scene.vertices
    new.vertex_body, new.vertex = a, point
    new.edge_body, new.edge_start = b, start
    new.edge_end = start + points[start].edge_offset
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


def list_features(scene, body, x, y, reach, features):
    """List the features of a body nearer to a position in its frame than ``reach`` [m]; the first
    element is their number."""
    count, vertices = 0, scene.vertices
    for point in range(scene.first[body], scene.first[body + 1]):
        most = reach + vertices[point].excess_radius
        if edge_distance2(vertices, x, y, point) < most * most:
            count += 1
            features[count] = point
    features[0] = count


@hook
def list_polygons(scene, work, pair, cutoff):
    """List the pairs of features of two bodies in both roles; return False if the list is full."""
    a, b = work.pairs[pair].later, work.pairs[pair].earlier
    vertices, near = scene.vertices, work.near_features
    pose = pose_of(scene, work, a, b)
    back = reversed_pose(pose)
    reach = scene.bodies[a].radius + scene.bodies[b].radius + cutoff
    # First the features near the other body, in linear time; then all pairs of these few.
    list_features(scene, a, back[2], back[3], extent_of(scene, b) + reach, near.later)
    list_features(scene, b, pose[2], pose[3], extent_of(scene, a) + reach, near.earlier)
    room = True
    for i in range(1, near.later[0] + 1):
        point = near.later[i]
        end = point + vertices[point].edge_offset
        x, y = in_other_frame(pose, vertices, point)
        end_x, end_y = in_other_frame(pose, vertices, end)
        for j in range(1, near.earlier[0] + 1):
            other = near.earlier[j]
            limit = reach + vertices[point].excess_radius + vertices[other].excess_radius
            limit *= limit
            # The vertex of a and the edge of b, then the reverse.
            apart2 = edge_distance2(vertices, x, y, other)
            if apart2 < limit and begins_pair(vertices, point, other, True):
                room = add_pair(scene, work, pair, a, point, b, other) and room
            apart2 = segment_distance2(vertices[other].x, vertices[other].y, x, y, end_x, end_y)
            if apart2 < limit and begins_pair(vertices, other, point, False):
                room = add_pair(scene, work, pair, b, other, a, point) and room
    return room


def list_spheres(scene, work, pair, cutoff):
    """List the one pair of two spheres if its gap is below the cut-off; return False if full."""
    a, b = work.pairs[pair].later, work.pairs[pair].earlier
    if sphere_gap(scene, work, a, b) >= cutoff:
        return True
    return add_pair(scene, work, pair, a, scene.first[a], b, scene.first[b])


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
