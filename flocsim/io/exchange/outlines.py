"""Outlines of bodies at many instants, found once and then moved."""

from collections.abc import Sequence

import numpy as np

from flocsim.geometry.shapes.shape import Shape

MOST_FRAMES = 400
"""Instants that are drawn; a file's own arrays have all of them."""


def frames_of(count: int) -> np.ndarray:
    """The rows of a motion of so many instants that are drawn: all, or 400 spread evenly."""
    return np.unique(np.linspace(0, count - 1, min(count, MOST_FRAMES)).round().astype(int))


def rings_of(shape: Shape) -> list[np.ndarray]:
    """The rings (k, 2) [m] of an outline about its centroid, outer ones first, then holes.

    Open (the first point is not said twice), outer ones counter-clockwise, holes clockwise. Most
    outlines have one outer ring; parts that touch in a point have several.
    """
    rings = [np.asarray(ring, dtype=float) for ring in shape.outline(0.0, 0.0, 0.0)]
    rings = [ring[:-1] if np.array_equal(ring[0], ring[-1]) else ring for ring in rings]
    if not shape.is_compound:
        outer, *holes = sorted(rings, key=lambda ring: -abs(area_of(ring)))
        return [oriented(outer, 1.0), *(oriented(hole, -1.0) for hole in holes)]
    # shapely's outer rings go round in one sense, those of holes in the other.
    sense = 1.0 if area_of(rings[0]) > 0.0 else -1.0
    return [ring if sense > 0.0 else ring[::-1] for ring in rings]


def oriented(ring: np.ndarray, sense: float) -> np.ndarray:
    """A ring that goes round counter-clockwise for a sense above 0, else clockwise."""
    return ring if area_of(ring) * sense > 0.0 else ring[::-1]


def is_hole(ring: np.ndarray) -> bool:
    """Whether a ring of `rings_of` is that of a hole, where it is not the first."""
    return area_of(ring) <= 0.0


def area_of(ring: np.ndarray) -> float:
    """The area [m²] that a ring encloses, above 0 where it goes round counter-clockwise."""
    x, y = ring.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def placed(points: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Points (p, 2) of a body about its centroid at its places (f, 3): (f, p, 2)."""
    cos, sin = np.cos(places[:, 2, None]), np.sin(places[:, 2, None])
    x, y = points.T
    turned = np.stack([cos * x - sin * y, sin * x + cos * y], axis=2)
    return turned + places[:, None, :2]


def spread(shapes: Sequence[Shape], position: np.ndarray) -> float:
    """Half the width [m] of a box about the origin that all bodies stay inside of."""
    reach = np.array([shape.bounding_radius for shape in shapes])
    return float((np.abs(position[:, :, :2]) + reach[None, :, None]).max())
