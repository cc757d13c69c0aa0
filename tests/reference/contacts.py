"""Every (vertex of one core, edge of another) pair of a scene, and its kinematics (MODEL 2)."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
import shapely

from tests.reference.outline import core_geometry
from tests.reference.shapes import world_vertices

DEEPEST_OVERLAP = 0.5


class OverlapTooDeepError(ValueError):
    """Cores that cross or hold one another's vertices, or Δ above half of the radii's sum."""


@dataclass(frozen=True)
class Contacts:
    """m vertex-edge pairs, as arrays with one row each.

    pair (m, 4): vertex's body, vertex, edge's body, edge (from vertex k to k + 1).
    overlap (m,) = r_i + r_j − distance. normal (m, 2): from the foot on the edge to the vertex.
    tangent (m, 2) = (−n_y, n_x). point (m, 2): middle of the overlap. normal_velocity and
    tangential_velocity (m,): of the vertex's body against the edge's body, at that point.
    """

    pair: np.ndarray
    distance: np.ndarray
    overlap: np.ndarray
    normal: np.ndarray
    tangent: np.ndarray
    point: np.ndarray
    normal_velocity: np.ndarray
    tangential_velocity: np.ndarray

    def select(self, rows):
        """The same record for some of the rows."""
        return Contacts(*(values[rows] for values in vars(self).values()))

    def pair_keys(self):
        """The pairs as tuples, to look up tangential displacements by."""
        return [tuple(int(part) for part in row) for row in self.pair]


def edge_count(body):
    """A sphere has no edge, a two-point core one, a polygon as many as vertices."""
    count = len(body.vertices)
    return {1: 0, 2: 1}.get(count, count)


def pairs_of(bodies, i, j):
    """All pairs (m, 4) of bodies i < j, both ways round; two spheres make one pair."""
    if len(bodies[i].vertices) == len(bodies[j].vertices) == 1:
        return np.array([[i, 0, j, 0]])
    rows = [
        (a, vertex, b, edge)
        for a, b in ((i, j), (j, i))
        for vertex in range(len(bodies[a].vertices))
        for edge in range(edge_count(bodies[b]))
    ]
    return np.array(rows)


def all_pairs(bodies):
    """The pairs (m, 4) of every two bodies, whether near or far; (0, 4) for a single body."""
    n = len(bodies)
    blocks = [pairs_of(bodies, i, j) for i in range(n) for j in range(i + 1, n)]
    return np.concatenate(blocks) if blocks else np.empty((0, 4), dtype=int)


def nearest_on_segment(point, start, end):
    """The point of the segment that is nearest to `point`; all (m, 2), ends included."""
    along = end - start
    length_squared = np.sum(along**2, axis=1)
    length_squared[length_squared == 0.0] = 1.0  # the sole vertex of a sphere, as an edge
    share = np.sum((point - start) * along, axis=1) / length_squared
    return start + np.clip(share, 0.0, 1.0)[:, None] * along


def velocity_at(position, velocity, point):
    """Velocity (m, 2) of the material point of a rigid body: v + ω × (point − centre)."""
    arm = point - position[:, :2]
    spin = velocity[:, 2]
    return velocity[:, :2] + np.stack([-spin * arm[:, 1], spin * arm[:, 0]], axis=1)


def measure(scene, pairs):
    """The kinematics of the given pairs (m, 4), touching or not, as Contacts."""
    body_v, vertex, body_e, edge = pairs.T
    world = [world_vertices(b, p) for b, p in zip(scene.bodies, scene.positions, strict=True)]
    counts = np.array([len(vertices) for vertices in world])
    stacked, first = np.concatenate(world), np.cumsum(counts) - counts
    corner = stacked[first[body_v] + vertex]
    start = stacked[first[body_e] + edge]
    end = stacked[first[body_e] + (edge + 1) % counts[body_e]]
    foot = nearest_on_segment(corner, start, end)
    distance = np.hypot(*(corner - foot).T)
    if np.any(distance == 0.0):
        raise OverlapTooDeepError("a vertex lies on an edge of another core: no normal")
    normal = (corner - foot) / distance[:, None]
    tangent = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
    radius = np.array([body.radius for body in scene.bodies])
    radius_v, radius_e = radius[body_v], radius[body_e]
    point = ((corner - radius_v[:, None] * normal) + (foot + radius_e[:, None] * normal)) / 2
    velocity_v = velocity_at(scene.positions[body_v], scene.velocities[body_v], point)
    velocity_e = velocity_at(scene.positions[body_e], scene.velocities[body_e], point)
    relative = velocity_v - velocity_e
    return Contacts(
        pair=pairs,
        distance=distance,
        overlap=radius_v + radius_e - distance,
        normal=normal,
        tangent=tangent,
        point=point,
        normal_velocity=np.sum(normal * relative, axis=1),
        tangential_velocity=np.sum(tangent * relative, axis=1),
    )


def contacts(scene):
    """The pairs in contact, i.e. of positive overlap. OverlapTooDeepError where the law ends."""
    check_overlaps(scene)
    every = measure(scene, all_pairs(scene.bodies))
    return every.select(every.overlap > 0)


def closest(scene, i, j):
    """The pair of bodies i, j of least distance: a Contacts of one row, touching or not.

    OverlapTooDeepError if the cores cross, where the least distance has no direction.
    """
    refuse_crossing_cores(scene, i, j)
    every = measure(scene, pairs_of(scene.bodies, min(i, j), max(i, j)))
    return every.select([np.argmin(every.distance)])


def surface_gap(scene, i, j):
    """Smallest distance between the two outlines [m]; minus the overlap where they overlap."""
    return -float(closest(scene, i, j).overlap[0])


def check_overlaps(scene):
    """Raise OverlapTooDeepError if two cores cross or a pair has Δ > ½(r_i + r_j)."""
    for i, j in combinations(range(len(scene.bodies)), 2):
        refuse_crossing_cores(scene, i, j)
    every = measure(scene, all_pairs(scene.bodies))
    if np.any(every.overlap > DEEPEST_OVERLAP * (every.overlap + every.distance)):
        raise OverlapTooDeepError("an overlap exceeds half of the sum of the radii")


def refuse_crossing_cores(scene, i, j):
    """Raise OverlapTooDeepError if the filled cores share a point: a vertex inside the other
    core, or edges that cross though no vertex is near."""
    cores = (core_geometry(world_vertices(scene.bodies[k], scene.positions[k])) for k in (i, j))
    if shapely.intersects(*cores):
        raise OverlapTooDeepError(f"the cores of bodies {i} and {j} cross, or one is inside")
