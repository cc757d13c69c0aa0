"""Whether two placed cores overlap too deeply to start from, and where they touch."""

import math
from collections.abc import Sequence
from itertools import combinations, product

import numpy as np

from flocsim.constants import DEEPEST_OVERLAP
from flocsim.geometry.shapes.cores import edges_of, from_edges
from flocsim.geometry.shapes.outline import core_gap
from flocsim.geometry.shapes.parts import Part
from flocsim.geometry.shapes.shape import Shape

TOUCHING = 1e-12
"""Gap [m] below which outlines are shown as touching."""


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
