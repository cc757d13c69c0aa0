"""Shape measures of an outline, as they are published of flocs: perimeter, aspect ratio,
circularity, solidity, Feret diameters."""

from collections.abc import Sequence

import attrs
import numpy as np

from flocsim.geometry.shapes.outline import outline_sizes
from flocsim.geometry.shapes.parts import Part


@attrs.frozen
class ShapeMeasures:
    """Measures of an outline; lengths in the unit of the outline.

    - ``perimeter``: length of the outline, that of holes included;
    - ``aspect_ratio`` ≥ 1: long over short axis of the ellipse with the same second moments;
    - ``circularity``: 4πA/P², 1 for a disc (the form factor of ISO 9276-6);
    - ``solidity``: area over that of the convex hull;
    - ``feret_max``, ``feret_min``: largest and smallest distance of two parallel tangents.
    """

    perimeter: float
    aspect_ratio: float
    circularity: float
    solidity: float
    feret_max: float
    feret_min: float


def measures_of(parts: Sequence[Part], elongation: float) -> ShapeMeasures:
    """The ShapeMeasures of all parts, each core ⊕ disk [m], of an area of this ``elongation``
    B = (M₁ − M₂)/(M₁ + M₂): the ellipse of these moments has the axes (a/b)² = (1 + B)/(1 − B).

    Arcs are replaced by chords of 1.4°: lengths and areas are right to 1e-4.
    """
    aspect = float(np.sqrt((1.0 + elongation) / (1.0 - elongation)))
    if len(parts) == 1 and len(parts[0].points) == 1:
        width = 2.0 * parts[0].radius
        return ShapeMeasures(np.pi * width, 1.0, 1.0, 1.0, width, width)
    area, perimeter, hull_area, hull = outline_sizes(parts)
    circularity = 4.0 * np.pi * area / perimeter**2
    return ShapeMeasures(perimeter, aspect, circularity, area / hull_area, *feret_diameters(hull))


def feret_diameters(hull: np.ndarray) -> tuple[float, float]:
    """(largest, smallest) distance of two parallel tangents of a convex ring (k, 2).

    The largest is that of two corners; the smallest has one tangent along an edge.
    """
    points = hull[:, 0] + 1j * hull[:, 1]
    largest = np.abs(points[:, np.newaxis] - points).max()
    edges = np.roll(points, -1) - points
    edges = edges[np.abs(edges) > 0.0]
    across = (points[:, np.newaxis] * np.conj(edges / np.abs(edges))).imag
    return float(largest), float(np.ptp(across, axis=0).min())
