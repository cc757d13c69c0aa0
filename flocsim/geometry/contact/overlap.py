"""Whether two placed cores overlap too deeply to start from, and where they touch."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from flocsim.constants import DEEPEST_OVERLAP
from flocsim.geometry.shapes.cores import (
    cores_cross,
    distance_to_edges,
    edges_of,
    from_edges,
    inside_polygon,
)
from flocsim.geometry.shapes.shape import Shape

TOUCHING = 1e-12
"""Gap [m] below which outlines are shown as touching."""


def distance_between(a: np.ndarray, b: np.ndarray) -> float:
    """Smallest distance [m] between a core point of one and the core of the other."""
    distances = [np.hypot(*(a[0] - b[0]))]
    for points, core in ((a, b), (b, a)):
        starts, ends = edges_of(core)
        if len(starts):
            distances.append(distance_to_edges(points, starts, ends).min())
    return min(distances)


def overlap_fault(a: np.ndarray, radius_a: float, b: np.ndarray, radius_b: float) -> str | None:
    """What is wrong with two placed cores (N, 2) and their radii, in words; None if nothing is."""
    if inside_polygon(a, b).any() or inside_polygon(b, a).any() or cores_cross(a, b):
        return "with one core inside or across the other"
    overlap = radius_a + radius_b - distance_between(a, b)
    if overlap > DEEPEST_OVERLAP * (radius_a + radius_b):
        return f"overlapping by {overlap:.3g} m, more than half of r_i + r_j"
    return None


def touching_points(a: np.ndarray, radius_a: float, b: np.ndarray, radius_b: float) -> np.ndarray:
    """Middles (c, 2) [m] of the overlaps of two placed cores (N, 2) with their radii.

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
    cores = [shape.placed_vertices(*place) for shape, place in zip(shapes, places, strict=True)]
    found = [
        touching_points(cores[a], shapes[a].radius, cores[b], shapes[b].radius)
        for a, b in combinations(range(len(shapes)), 2)
    ]
    return np.concatenate([np.empty((0, 2)), *(np.reshape(each, (-1, 2)) for each in found)])
