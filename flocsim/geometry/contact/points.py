"""Contact geometry: gap, normal and contact point of listed vertex–edge pairs, as kernels, and
overlaps of placed shapes.

A contact pair is a vertex of one core and an edge of the other (vertex–edge method,
Alonso-Marroquín 2008); two spheres form one pair of points. The result is a VertexAtEdge of
flocsim.state in ``geometry[state, row]``. The normal n points from the foot (the closest point of
the edge) to the vertex, and the tangent is t = (−n_y, n_x). The contact point is the middle of the
overlap.

n turns by ``turning`` [1/m] per displacement of the vertex along t: 0 where the foot lies inside
the edge, so that n turns with the edge only, and 1/distance where the foot is an end of the edge.

Cosines and sines are needed some ten times per step, for angles that hardly change, and library
calls would dominate the cost here. So they are evaluated at multiples of 1/64 rad only. From the
nearest multiple φ, at a distance δ,

    cos(φ + δ) = cos φ cos δ − sin φ sin δ,  sin(φ + δ) = sin φ cos δ + cos φ sin δ,

with truncated series for cos δ and sin δ, errors below 1e-17. The stored values depend on the angle
alone, not on its history, so a resumed or repeated step yields identical numbers.
"""

import math
from collections.abc import Callable, Sequence
from itertools import combinations, product

import numpy as np

from flocsim.compiler.linker import apart
from flocsim.constants import DEEPEST_OVERLAP, SHALLOWEST_TOUCH, TINY
from flocsim.geometry.shapes.cores import Part, closest_share, edges_of, from_edges
from flocsim.geometry.shapes.outline import core_gap
from flocsim.geometry.shapes.shape import Shape
from flocsim.hooks import hook
from flocsim.state.bodies import ANGLE, X, Y
from flocsim.state.work import NOW

ANGLES_PER_RADIAN = 64.0
"""Stored angles per radian: |δ| ≤ 1/128, for which the short series below suffice."""

LARGEST_ANGLE = 1e6
"""Angle [rad] beyond which the library functions are used."""


def length_of(x, y):
    """Return the length of a vector.

    A square root instead of math.hypot, a library call that would cost more than most of its
    callers. Squares of the lengths in a run neither overflow nor underflow.
    """
    return math.sqrt(x * x + y * y)


def unit_vector(x, y):
    """Return (n_x, n_y, length) of a vector; any direction will do for one of no length."""
    length = length_of(x, y)
    if length == 0.0:
        return 0.0, 1.0, length
    return x / length, y / length, length


def difference(vectors, state, a, b):
    """Return (x, y) of body a less that of body b, of positions or velocities in a state."""
    x = vectors[state, a, X] - vectors[state, b, X]
    return x, vectors[state, a, Y] - vectors[state, b, Y]


@hook
def separation(scene, work, state, a, b):
    """Return the vector (x, y) [m] from the centroid of body b to that of body a, in a state."""
    return difference(work.place, state, a, b)


def relative_velocity(work, state, a, b):
    """Return the velocity (x, y) [m/s] of the centroid of body a relative to that of body b."""
    return difference(work.velocity, state, a, b)


def nearest_displacement(displacement, period):
    """Return a displacement along one axis, reduced to the nearest periodic image [m]."""
    if period < math.inf:
        return displacement - period * math.floor(displacement / period + 0.5)
    return displacement


def nearest_image(scene, work, state, a, b):
    """Return `separation` in a periodic domain: to the image of a that is nearest to b."""
    width, height = scene.box
    x, y = difference(work.place, state, a, b)
    return nearest_displacement(x, width), nearest_displacement(y, height)


PERIODIC: dict[Callable, Callable] = {separation: nearest_image}
"""{hook: its replacement in periodic scenes}."""


def cosine_and_sine(work, body, angle):
    """Return (cos, sin) of an angle of a body [rad], each within 3e-16."""
    if not abs(angle) < LARGEST_ANGLE:
        return math.cos(angle), math.sin(angle)
    nearest = math.floor(ANGLES_PER_RADIAN * angle + 0.5) / ANGLES_PER_RADIAN
    pose = work.poses[body]
    # cos(k/64) is never exactly 0, so 0 marks values not yet computed.
    if nearest != pose.known_angle or pose.known_cosine == 0.0:
        pose.known_angle = nearest
        pose.known_cosine = math.cos(nearest)
        pose.known_sine = math.sin(nearest)
    rest = angle - nearest
    square = rest * rest
    # Taylor series in δ = rest, then the addition theorems.
    c = 1.0 - square * (0.5 - square * (1.0 / 24.0 - square / 720.0))
    s = rest * (1.0 - square * (1.0 / 6.0 - square / 120.0))
    cosine, sine = pose.known_cosine, pose.known_sine
    return cosine * c - sine * s, sine * c + cosine * s


@hook
def update_rotation(work, state, body):
    """Store cosine and sine of a body's angle in a state in ``work.poses``."""
    pose = work.poses[body]
    cosine, sine = cosine_and_sine(work, body, work.place[state, body, ANGLE])
    pose.cosine, pose.sine = cosine, sine


def update_rotations(work, state):
    """Store cosine and sine of the angles of all bodies."""
    for body in range(work.poses.shape[0]):
        update_rotation(work, state, body)


def rotated_point(scene, work, body, point):
    """Return a core point relative to its body's centroid, with the axes of the scene [m]."""
    pose = work.poses[body]
    x, y = scene.vertices[point].x, scene.vertices[point].y
    c = pose.cosine
    s = pose.sine
    return c * x - s * y, s * x + c * y


def store_geometry(work, state, row, nx, ny, gap, ax, ay, bx, by, turning, foot, side):
    """Store one geometry row from the normal and the contact point relative to both centroids.

    (ax, ay), (bx, by): contact point relative to the centroids of the vertex's and the edge's body.
    """
    geometry = work.geometry
    geometry[state, row].normal_x = nx
    geometry[state, row].normal_y = ny
    # A grazing contact counts as touching at the gap at which it has been pinned (friction.py).
    geometry[state, row].gap = gap - work.contacts[row].gap_offset
    # Arms: moments about the centroid of a unit force along n (r × n) and along t (r × t).
    geometry[state, row].vertex_arm_n = ax * ny - ay * nx
    geometry[state, row].vertex_arm_t = ax * nx + ay * ny
    geometry[state, row].edge_arm_n = bx * ny - by * nx
    geometry[state, row].edge_arm_t = bx * nx + by * ny
    geometry[state, row].turning = turning
    geometry[state, row].foot = foot
    geometry[state, row].side = side


@hook
def locate_polygons(scene, work, state, row):
    """Store the geometry of one vertex–edge pair.

    A vertex exactly on the edge gets an arbitrary normal.
    """
    candidate = work.candidates[row]
    a, point = candidate.vertex_body, candidate.vertex
    b, start, end = (
        candidate.edge_body,
        candidate.edge_start,
        candidate.edge_end,
    )
    # All points relative to b's centroid.
    px, py = rotated_point(scene, work, a, point)
    sx, sy = rotated_point(scene, work, b, start)
    ex, ey = rotated_point(scene, work, b, end)
    ox, oy = separation(scene, work, state, a, b)
    # Foot f: the closest point of the segment, share 0 and 1 being its ends.
    share = closest_share(px + ox, py + oy, sx, sy, ex, ey)
    fx = sx + share * (ex - sx)
    fy = sy + share * (ey - sy)
    dx = px + ox - fx
    dy = py + oy - fy
    nx, ny, distance = unit_vector(dx, dy)
    # The contact point lies on the normal, midway between the two outlines.
    radius_a, radius_b = candidate.vertex_radius, candidate.edge_radius
    contact_distance = 0.5 * (distance + radius_b - radius_a)
    bx = fx + contact_distance * nx
    by = fy + contact_distance * ny
    gap = distance - radius_a - radius_b
    # An interior foot moves along the edge with the vertex; an end stays, and the normal turns
    # about it.
    turning = 0.0 if 0.0 < share < 1.0 else 1.0 / max(distance, TINY)
    # Position along the edge, for the tangential displacement (rhs/friction.slip_of_motion).
    foot = share * length_of(ex - sx, ey - sy)
    side = 1.0 if (ey - sy) * nx - (ex - sx) * ny >= 0.0 else -1.0
    store_geometry(work, state, row, nx, ny, gap, bx - ox, by - oy, bx, by, turning, foot, side)


def locate_spheres(scene, work, state, row):
    """Store the geometry of two spheres, whose angles do not matter."""
    candidate = work.candidates[row]
    a = candidate.vertex_body
    b = candidate.edge_body
    ox, oy = separation(scene, work, state, a, b)
    nx, ny, distance = unit_vector(ox, oy)
    contact_distance = 0.5 * (distance + scene.bodies[b].radius - scene.bodies[a].radius)
    gap = distance - scene.bodies[a].radius - scene.bodies[b].radius
    bx, by = contact_distance * nx, contact_distance * ny
    turning = 1.0 / max(distance, TINY)
    store_geometry(work, state, row, nx, ny, gap, bx - ox, by - oy, bx, by, turning, 0.0, 1.0)


@apart
def locate_contacts(scene, work, state):
    """Store the geometry of all listed pairs in a state; return the smallest gap (inf without
    pairs)."""
    update_rotations(work, state)
    least = math.inf
    for row in range(work.tally.candidates):
        locate_polygons(scene, work, state, row)
        least = min(least, work.geometry[state, row].gap)
    return least


@hook
def locate_acting(scene, work, state):
    """Store the geometry, in a state, of the listed pairs that exert a force in this step."""
    update_rotations(work, state)
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        if candidate.contact_mode + candidate.surface_active > 0:
            locate_polygons(scene, work, state, row)


def least_listed_gap(work):
    """Return the smallest gap among the listed pairs in the present state (inf if none is listed)
    [m]."""
    least = math.inf
    for row in range(work.tally.candidates):
        least = min(least, work.geometry[NOW, row].gap)
    return least


def contact_point(work, row, body):
    """Return the contact point of a pair relative to the centroid of one of its bodies [m]."""
    geometry = work.geometry[NOW, row]
    nx, ny = geometry.normal_x, geometry.normal_y
    if work.candidates[row].vertex_body == body:
        across, along = geometry.vertex_arm_n, geometry.vertex_arm_t
    else:
        across, along = geometry.edge_arm_n, geometry.edge_arm_t
    # The point from its two arms: r = (r × t) n − (r × n) t.
    return along * nx + across * ny, along * ny - across * nx


def normal_component(work, row, vectors, state, at):
    """Return the relative displacement or velocity of a pair's contact point along its normal.

    ``vectors`` is work.place (result [m]) or work.velocity (result [m/s]), read at ``state``; the
    geometry is that of the state ``at``. The value is that of the vertex's body minus the edge's.
    """
    candidate, geometry = work.candidates[row], work.geometry[at, row]
    a, b = candidate.vertex_body, candidate.edge_body
    # Translation along n, then rotation with the arms of the contact point.
    change = geometry.normal_x * (vectors[state, a, X] - vectors[state, b, X])
    change += geometry.normal_y * (vectors[state, a, Y] - vectors[state, b, Y])
    change += geometry.vertex_arm_n * vectors[state, a, ANGLE]
    return change - geometry.edge_arm_n * vectors[state, b, ANGLE]


def tangential_component(work, row, vectors, state, at):
    """Return the same along the tangent t = (−n_y, n_x)."""
    candidate, geometry = work.candidates[row], work.geometry[at, row]
    a, b = candidate.vertex_body, candidate.edge_body
    change = geometry.normal_x * (vectors[state, a, Y] - vectors[state, b, Y])
    change -= geometry.normal_y * (vectors[state, a, X] - vectors[state, b, X])
    change += geometry.vertex_arm_t * vectors[state, a, ANGLE]
    return change - geometry.edge_arm_t * vectors[state, b, ANGLE]


def overlap_fault(
    a: Sequence[Part], b: Sequence[Part], along_outlines: float = math.inf,
    deepest: float = DEEPEST_OVERLAP,
) -> str | None:  # fmt: skip
    """Describe why two placed bodies may not start like this; return None if they may.

    ``along_outlines``: largest overlap [m] for which forces along outlines are defined;
    ``deepest``: largest overlap over r_i + r_j.
    """
    gaps = [(core_gap(one, other), one.radius + other.radius) for one, other in product(a, b)]
    if min(gaps)[0] == 0.0:
        return "with one core inside or across the other"
    for gap, contact in gaps:
        overlap = contact - gap
        if overlap > deepest * contact:
            share = "half" if deepest == DEEPEST_OVERLAP else f"{100.0 * deepest:g} %"
            return f"overlapping by {overlap:.3g} m, more than {share} of r_i + r_j"
        if overlap > along_outlines:
            return (
                f"overlapping by {overlap:.3g} m, more than d_min = {along_outlines:.3g} m of the "
                "force along their outlines"
            )
    return None


def touching_points(a: np.ndarray, radius_a: float, b: np.ndarray, radius_b: float) -> np.ndarray:
    """Return the contact points (c, 2) [m] of two placed rings (N, 2) with their spheroradii.

    Gaps below SHALLOWEST_TOUCH count: a step that ends at a first touch ends on either side of it.
    """
    points_found = []
    # Vertices of each ring against edges of the other, as in the vertex–edge method.
    for points, radius, core, other in ((a, radius_a, b, radius_b), (b, radius_b, a, radius_a)):
        if len(core) == 1 < len(points):
            continue  # A sphere has no edge for the vertices of a polygon to touch.
        offsets = points[:, None] - core if len(core) == 1 else from_edges(points, *edges_of(core))
        distance = np.hypot(offsets[..., 0], offsets[..., 1])
        normal = offsets / np.maximum(distance, 1e-300)[..., None]
        feet = points[:, None] - offsets
        middle = feet + normal * (0.5 * (distance + other - radius))[..., None]
        points_found.append(middle[distance < radius + other + SHALLOWEST_TOUCH])
    return np.concatenate(points_found)


def placed_contacts(shapes: Sequence[Shape], places: np.ndarray) -> np.ndarray:
    """Return the points (c, 2) [m] where any two bodies at these positions (n, 3) touch."""
    bodies = [shape.placed_parts(*place) for shape, place in zip(shapes, places, strict=True)]
    found = [
        touching_points(ring, one.radius, core, other.radius)
        for a, b in combinations(bodies, 2)
        for one, other in product(a, b)
        for ring, core in product(one.rings, other.rings)
    ]
    return np.concatenate([np.empty((0, 2)), *(np.reshape(each, (-1, 2)) for each in found)])
