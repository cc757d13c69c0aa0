"""Whether two placed cores overlap too deeply to start from."""

import numpy as np

from flocsim.constants import DEEPEST_OVERLAP
from flocsim.geometry.shapes.cores import cross, distance_to_edges, edges_of, inside_polygon


def edges_cross(a, b):
    """Whether any edge of core a properly crosses any edge of core b."""
    (p, q), (r, s) = edges_of(a), edges_of(b)
    if len(p) == 0 or len(r) == 0:
        return False
    p, q = p[:, None], q[:, None]

    def side(origin, end, point):
        return np.sign(cross(end - origin, point - origin))

    apart = side(p, q, r) * side(p, q, s) < 0
    return bool(np.any(apart & (side(r, s, p) * side(r, s, q) < 0)))


def core_distance(a, b):
    """Smallest distance [m] between a core point of one and the core of the other."""
    distances = []
    for points, core in ((a, b), (b, a)):
        starts, ends = edges_of(core)
        if len(starts):
            distances.append(distance_to_edges(points, starts, ends).min())
    if not distances:
        distances.append(np.hypot(*(a[0] - b[0])))
    return min(distances)


def overlap_fault(a, radius_a, b, radius_b):
    """What is wrong with two placed cores (N, 2) and their radii, in words; None if nothing is."""
    if inside_polygon(a, b).any() or inside_polygon(b, a).any() or edges_cross(a, b):
        return "with one core inside or across the other"
    overlap = radius_a + radius_b - core_distance(a, b)
    if overlap > DEEPEST_OVERLAP * (radius_a + radius_b):
        return f"overlapping by {overlap:.3g} m, more than half of r_i + r_j"
    return None


def nearest_on_edges(points, starts, ends):
    """Nearest points (k, edges, 2) on each edge to each of the points (k, 2)."""
    along = ends - starts
    share = np.einsum("kej,ej->ke", points[:, None] - starts[None], along)
    share = np.clip(share / np.einsum("ej,ej->e", along, along), 0.0, 1.0)
    return starts[None] + share[..., None] * along[None]


def touching_points(a, radius_a, b, radius_b):
    """Middles (c, 2) [m] of the overlaps of two placed cores (N, 2) with their radii."""
    found = []
    for points, radius, core, other in ((a, radius_a, b, radius_b), (b, radius_b, a, radius_a)):
        starts, ends = edges_of(core)
        if len(core) == 1 < len(points):
            continue  # A sphere has no edge for the vertices of a polygon to touch.
        if len(core) == 1:
            feet = np.broadcast_to(core, (len(points), 1, 2))
        else:
            feet = nearest_on_edges(points, starts, ends)
        away = points[:, None] - feet
        distance = np.hypot(away[..., 0], away[..., 1])
        normal = away / np.maximum(distance, 1e-300)[..., None]
        middle = feet + normal * (0.5 * (distance + other - radius))[..., None]
        found.append(middle[distance < radius + other])
    return np.concatenate(found)
