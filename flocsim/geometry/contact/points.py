"""Where bodies touch: how far two lie apart, and where and how listed vertex–edge pairs of them do,
in kernels; and of placed shapes, where they touch, and whether they overlap too deeply to start.

A contact pair is a vertex of one core and an edge of the other (MODEL: Alonso-Marroquín's
vertex–edge method); two spheres are one pair of points.

``geometry[state, row]`` is a VertexAtEdge of flocsim.state. The normal n points from the foot on
the edge to the vertex, t = (−n_y, n_x). It turns by ``turning`` for every metre by which the vertex
is shifted along t: 0 where the foot lies inside the edge, which alone turns it then, 1/distance
where it is an end.

A run needs cosine and sine of angles some ten times a step, of angles that hardly differ, and a
library's functions for them take more time there than anything else. So they are asked for at
multiples of 1/64 alone, and from the nearest one, δ away,

    cos(φ + δ) = cos φ cos δ − sin φ sin δ,  sin(φ + δ) = sin φ cos δ + cos φ sin δ,

with the series of cos δ and sin δ, of which what is left out is below 1e-17. What is remembered
depends on the angle alone and not on the way there, so that a run that is gone on with, or is
turned back, finds the same.
"""

import math
from collections.abc import Callable, Sequence
from itertools import combinations, product

import numpy as np

from flocsim.compiler.linker import apart
from flocsim.constants import DEEPEST_OVERLAP
from flocsim.geometry.shapes.cores import Part, closest_share, edges_of, from_edges
from flocsim.geometry.shapes.outline import core_gap
from flocsim.geometry.shapes.shape import Shape
from flocsim.hooks import hook
from flocsim.state.bodies import ANGLE, X, Y
from flocsim.state.work import NOW

TINY = 1e-300
"""Keeps the reciprocal of a distance finite."""

PER_RADIAN = 64.0
"""Angles for which both are known lie this close."""

LARGEST = 1e6
"""Beyond that angle [rad] the library is asked every time."""

TOUCHING = 1e-12
"""Gap [m] below which outlines are shown as touching."""


def length_of(x, y):
    """The length of a vector: a root, where math.hypot calls a library's function, which costs more
    than most of what is done with it. Squares of what a run has in it neither overflow nor vanish.
    """
    return math.sqrt(x * x + y * y)


@hook
def separation(scene, work, state, a, b):
    """(x, y) of body a as seen from body b, in a state [m]."""
    return work.place[state, a, X] - work.place[state, b, X], work.place[state, a, Y] - work.place[
        state, b, Y
    ]


def nearest_way(length, period):
    """A way along an axis, by the nearest image [m]."""
    if period < math.inf:
        return length - period * math.floor(length / period + 0.5)
    return length


def nearest_image(scene, work, state, a, b):
    """The same where space repeats itself: of a's image that is nearest to b."""
    width, height = scene.box
    x = nearest_way(work.place[state, a, X] - work.place[state, b, X], width)
    return x, nearest_way(work.place[state, a, Y] - work.place[state, b, Y], height)


PERIODIC: dict[Callable, Callable] = {separation: nearest_image}
"""The replacement for scenes that repeat themselves."""


def cosine_and_sine(work, body, angle):
    """(cos, sin) of an angle of a body [rad], each within 3e-16."""
    if not abs(angle) < LARGEST:
        return math.cos(angle), math.sin(angle)
    nearest = math.floor(PER_RADIAN * angle + 0.5) / PER_RADIAN
    pose = work.poses[body]
    # No cosine of a multiple of 1/64 is 0.
    if nearest != pose.known_angle or pose.known_cosine == 0.0:
        pose.known_angle = nearest
        pose.known_cosine = math.cos(nearest)
        pose.known_sine = math.sin(nearest)
    rest = angle - nearest
    square = rest * rest
    c = 1.0 - square * (0.5 - square * (1.0 / 24.0 - square / 720.0))
    s = rest * (1.0 - square * (1.0 / 6.0 - square / 120.0))
    cosine, sine = pose.known_cosine, pose.known_sine
    return cosine * c - sine * s, sine * c + cosine * s


@hook
def turn_body(work, state, body):
    """Cosine and sine of a body's angle in a state, into ``work.poses``."""
    pose = work.poses[body]
    cosine, sine = cosine_and_sine(work, body, work.place[state, body, ANGLE])
    pose.cosine, pose.sine = cosine, sine


def turn_bodies(work, state):
    """The same of all bodies."""
    for body in range(work.poses.shape[0]):
        turn_body(work, state, body)


def turned(scene, work, body, point):
    """A core point relative to its body's centroid, in the frame of the scene."""
    pose = work.poses[body]
    x = scene.vertices[point, X]
    y = scene.vertices[point, Y]
    c = pose.cosine
    s = pose.sine
    return c * x - s * y, s * x + c * y


def store_row(work, state, row, nx, ny, gap, ax, ay, bx, by, turning, foot, side):
    """Write one geometry row from the normal and the two arms of the contact point."""
    geometry = work.geometry
    geometry[state, row].normal_x = nx
    geometry[state, row].normal_y = ny
    geometry[state, row].gap = gap - work.contacts[row].gap_offset
    geometry[state, row].vertex_arm_n = ax * ny - ay * nx
    geometry[state, row].vertex_arm_t = ax * nx + ay * ny
    geometry[state, row].edge_arm_n = bx * ny - by * nx
    geometry[state, row].edge_arm_t = bx * nx + by * ny
    geometry[state, row].turning = turning
    geometry[state, row].foot = foot
    geometry[state, row].side = side


@hook
def row_radii(scene, work, row):
    """(of the vertex, of the edge) of a pair: the radii of the disks that sweep them [m]."""
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    return scene.bodies[a].radius, scene.bodies[b].radius


@hook
def locate_polygons(scene, work, state, row):
    """Geometry of one vertex–edge pair; a vertex right on the edge gets an arbitrary normal."""
    candidate = work.candidates[row]
    a, point = candidate.vertex_body, candidate.vertex
    b, start, end = (
        candidate.edge_body,
        candidate.edge_start,
        candidate.edge_end,
    )
    px, py = turned(scene, work, a, point)
    sx, sy = turned(scene, work, b, start)
    ex, ey = turned(scene, work, b, end)
    ox, oy = separation(scene, work, state, a, b)
    share = closest_share(px + ox, py + oy, sx, sy, ex, ey)
    fx = sx + share * (ex - sx)
    fy = sy + share * (ey - sy)
    dx = px + ox - fx
    dy = py + oy - fy
    distance = length_of(dx, dy)
    nx, ny = 0.0, 1.0
    if distance > 0.0:
        nx, ny = dx / distance, dy / distance
    radius_a, radius_b = row_radii(scene, work, row)
    middle = 0.5 * (distance + radius_b - radius_a)
    bx = fx + middle * nx
    by = fy + middle * ny
    gap = distance - radius_a - radius_b
    turning = 0.0 if 0.0 < share < 1.0 else 1.0 / max(distance, TINY)
    foot = share * length_of(ex - sx, ey - sy)
    side = 1.0 if (ey - sy) * nx - (ex - sx) * ny >= 0.0 else -1.0
    store_row(work, state, row, nx, ny, gap, bx - ox, by - oy, bx, by, turning, foot, side)


def locate_spheres(scene, work, state, row):
    """Geometry of two spheres: nothing to turn."""
    candidate = work.candidates[row]
    a = candidate.vertex_body
    b = candidate.edge_body
    ox, oy = separation(scene, work, state, a, b)
    distance = length_of(ox, oy)
    nx, ny = 0.0, 1.0
    if distance > 0.0:
        nx, ny = ox / distance, oy / distance
    middle = 0.5 * (distance + scene.bodies[b].radius - scene.bodies[a].radius)
    gap = distance - scene.bodies[a].radius - scene.bodies[b].radius
    bx, by = middle * nx, middle * ny
    turning = 1.0 / max(distance, TINY)
    store_row(work, state, row, nx, ny, gap, bx - ox, by - oy, bx, by, turning, 0.0, 1.0)


@apart
def locate_contacts(scene, work, state):
    """Geometry of all listed pairs in a state; the smallest gap (inf without pairs)."""
    turn_bodies(work, state)
    least = math.inf
    for row in range(work.tally.candidates):
        locate_polygons(scene, work, state, row)
        least = min(least, work.geometry[state, row].gap)
    return least


@hook
def locate_acting(scene, work, state):
    """Geometry, in a state, of the listed pairs through which forces act in this step."""
    turn_bodies(work, state)
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        if candidate.closed + candidate.near > 0:
            locate_polygons(scene, work, state, row)


def least_listed_gap(work):
    """The smallest gap among the listed pairs now (inf where none is listed)."""
    least = math.inf
    for row in range(work.tally.candidates):
        least = min(least, work.geometry[NOW, row].gap)
    return least


def contact_point(work, row, body):
    """The middle of a pair's overlap, relative to the centroid of one of its bodies."""
    geometry = work.geometry[NOW]
    nx, ny = geometry[row].normal_x, geometry[row].normal_y
    if work.candidates[row].vertex_body == body:
        across, along = geometry[row].vertex_arm_n, geometry[row].vertex_arm_t
    else:
        across, along = geometry[row].edge_arm_n, geometry[row].edge_arm_t
    return along * nx + across * ny, along * ny - across * nx


def overlap_fault(
    a: Sequence[Part], b: Sequence[Part], along_outlines: float = math.inf
) -> str | None:
    """What is wrong with two placed bodies, by their parts, in words; None if nothing is.

    ``along_outlines``: the overlap [m] up to which what acts all along them is known.
    """
    gaps = [(core_gap(one, other), one.radius + other.radius) for one, other in product(a, b)]
    if min(gaps)[0] == 0.0:
        return "with one core inside or across the other"
    for gap, contact in gaps:
        overlap = contact - gap
        if overlap > DEEPEST_OVERLAP * contact:
            return f"overlapping by {overlap:.3g} m, more than half of r_i + r_j"
        if overlap > along_outlines:
            return (
                f"overlapping by {overlap:.3g} m, beyond d_min = {along_outlines:.3g} m of the "
                "force along their outlines"
            )
    return None


def touching_points(a: np.ndarray, radius_a: float, b: np.ndarray, radius_b: float) -> np.ndarray:
    """Middles (c, 2) [m] of the overlaps of two placed rings (N, 2) with their radii.

    A gap of less than TOUCHING counts: a step that ends at a first touch ends on either side of it.
    """
    found = []
    for points, radius, core, other in ((a, radius_a, b, radius_b), (b, radius_b, a, radius_a)):
        if len(core) == 1 < len(points):
            continue  # A sphere has no edge for the vertices of a polygon to touch.
        away = points[:, None] - core if len(core) == 1 else from_edges(points, *edges_of(core))
        distance = np.hypot(away[..., 0], away[..., 1])
        normal = away / np.maximum(distance, 1e-300)[..., None]
        feet = points[:, None] - away
        middle = feet + normal * (0.5 * (distance + other - radius))[..., None]
        found.append(middle[distance < radius + other + TOUCHING])
    return np.concatenate(found)


def placed_contacts(shapes: Sequence[Shape], places: np.ndarray) -> np.ndarray:
    """Where any two of the bodies at these places (n, 3) touch: (c, 2) [m]."""
    bodies = [shape.placed_parts(*place) for shape, place in zip(shapes, places, strict=True)]
    found = [
        touching_points(ring, one.radius, core, other.radius)
        for a, b in combinations(bodies, 2)
        for one, other in product(a, b)
        for ring, core in product(one.rings, other.rings)
    ]
    return np.concatenate([np.empty((0, 2)), *(np.reshape(each, (-1, 2)) for each in found)])
