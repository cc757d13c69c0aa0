"""Outlines as point lists, tests of simple polygons, distances of cores, and shape measures.

The only file that imports shapely.
"""

import functools
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import attrs
import numpy as np

from flocsim.errors import ShapeError
from flocsim.geometry.shapes.cores import Part

MEASURED_QUADRANT = 64
"""Chords per quarter circle in measured outlines."""

LEAST_CELL = 1e-6
"""Share of the area of a cell below which a piece of it is left out."""


def simplicity_fault(vertices: np.ndarray, holes: Sequence[np.ndarray] = ()) -> str | None:
    """Return None if a closed polygon (N ≥ 3, 2) is simple, else a description of the fault.

    Holes must lie inside and apart from each other.
    """
    import shapely

    polygon = shapely.Polygon(vertices, holes)
    return None if polygon.is_valid else shapely.is_valid_reason(polygon)


def require_simple(vertices: np.ndarray, holes: Sequence[np.ndarray] = ()) -> None:
    """Raise ShapeError if edges of the closed polygon cross or touch, or a hole is invalid."""
    fault = simplicity_fault(vertices, holes)
    if fault is not None and holes:
        raise ShapeError(
            f"a polygon with {len(holes)} holes is not simple ({fault}): holes must lie inside of "
            "it and apart from each other, and no edges may cross"
        )
    if fault is not None:
        raise ShapeError(
            f"the polygon of {len(vertices)} vertices is not simple ({fault}); "
            "its edges must not cross or touch: reorder or move the vertices"
        )


def core_gap(a: Part, b: Part) -> float:
    """Return the smallest distance [m] between the cores of two parts, 0 if they overlap."""
    if len(a.points) == len(b.points) == 1:
        return float(np.hypot(*(a.points[0] - b.points[0])))
    return float(core_geometry(a.rings).distance(core_geometry(b.rings)))


def loose_parts(parts: Sequence[Part], slack: float) -> np.ndarray:
    """Return the numbers of the parts that are not connected with the first.

    Parts touch if their gap is below a share ``slack`` of the smaller radius.
    """
    import shapely
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    radius = np.array([part.radius for part in parts])
    cores = np.array([core_geometry(part.rings) for part in parts])
    farthest = (2.0 + slack) * radius.max()
    # Close pairs by a spatial index, then connected components of the graph of touching parts.
    one, other = shapely.STRtree(cores).query(cores, "dwithin", farthest)
    reach = radius[one] + radius[other] + slack * np.minimum(radius[one], radius[other])
    near = shapely.distance(cores[one], cores[other]) <= reach
    joins = coo_array((near[near], (one[near], other[near])), shape=(len(parts),) * 2)
    _, group = connected_components(joins)
    return np.flatnonzero(group != group[0])


def swept_rings(parts: Sequence[Part], points_per_quadrant: int = 16) -> list[np.ndarray]:
    """Return the outline of all parts, each core ⊕ disk, as closed rings [(k, 2), …] [m].

    Outer rings first, the largest before others, then holes.
    """
    return rings_of(swept_geometry(parts, points_per_quadrant))


def rings_of(whole: Any) -> list[np.ndarray]:
    """Return the closed rings of a shapely geometry: outer ones, the largest first, then holes."""
    pieces = sorted(getattr(whole, "geoms", [whole]), key=lambda piece: -piece.area)
    rings = [piece.exterior for piece in pieces]
    rings += [hole for piece in pieces for hole in piece.interiors]
    return [np.asarray(ring.coords) for ring in rings]


def oriented(rings: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return outlines counter-clockwise and holes clockwise, without repeated end points.

    A ring inside an odd number of others is a hole.
    """
    import shapely

    return [ring[:-1] for ring in rings_of(shapely.orient_polygons(even_odd(rings)))]


def even_odd(rings: Sequence[np.ndarray]) -> Any:
    """Return the area inside an odd number of rings as a shapely geometry."""
    import shapely

    return functools.reduce(shapely.symmetric_difference, map(shapely.Polygon, rings))


def swept_geometry(parts: Sequence[Part], points_per_quadrant: int) -> Any:
    """Return all parts, each core ⊕ disk, as a shapely geometry."""
    import shapely

    swept = [
        core_geometry(part.rings).buffer(part.radius, quad_segs=points_per_quadrant)
        for part in parts
    ]
    return swept[0] if len(swept) == 1 else shapely.union_all(swept)


def cells_of(
    rings: Sequence[np.ndarray], size: float, finer: int = 1
) -> list[tuple[np.ndarray, float, list[np.ndarray]]]:
    """Return the pieces of an area into which a grid cuts it: a point inside, area and outline.

    ``rings``: outlines and holes (k, 2). Cells of about ``size`` are divided by ``finer`` in both
    directions. The point is the centroid where that is inside. Outlines are counter-clockwise,
    their holes clockwise.
    """
    import shapely

    whole = even_odd(rings)
    columns, rows = (
        np.linspace(low, high, max(1, round((high - low) / size)) * finer + 1)
        for low, high in np.reshape(whole.bounds, (2, 2)).T
    )
    cells = [shapely.box(a, c, b, d) for a, b in pairwise(columns) for c, d in pairwise(rows)]
    cut = shapely.get_parts(shapely.intersection(whole, cells))
    pieces = []
    for piece in shapely.orient_polygons(cut[shapely.area(cut) > LEAST_CELL * cells[0].area]):
        middle = piece.centroid if piece.contains(piece.centroid) else piece.point_on_surface()
        edges = [ring[:-1] for ring in rings_of(piece)]
        pieces.append((np.asarray(middle.coords)[0], piece.area, edges))
    return pieces


def core_geometry(rings: Sequence[np.ndarray]) -> Any:
    """Return a core as a shapely geometry."""
    import shapely

    if len(rings[0]) < 3:
        return {1: shapely.Point, 2: shapely.LineString}[len(rings[0])](rings[0])
    return shapely.Polygon(rings[0], rings[1:])


@attrs.frozen
class ShapeMeasures:
    """Measures of an outline; lengths in the unit of the outline.

    - ``perimeter``: length of the outline, holes included;
    - ``aspect_ratio`` ≥ 1: long over short axis of the ellipse with the same second moments;
    - ``circularity``: 4πA/P², 1 for a disc (form factor of ISO 9276-6);
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
    """Return the ShapeMeasures of all parts, each core ⊕ disk [m].

    ``elongation`` B = (M₁ − M₂)/(M₁ + M₂): the ellipse with these moments has (a/b)² = (1 + B)/(1 −
    B). Arcs are replaced by chords of 1.4°; lengths and areas are right to 1e-4.
    """
    aspect = float(np.sqrt((1.0 + elongation) / (1.0 - elongation)))
    if len(parts) == 1 and len(parts[0].points) == 1:
        width = 2.0 * parts[0].radius
        return ShapeMeasures(np.pi * width, 1.0, 1.0, 1.0, width, width)
    # Perimeter and hull from chords.
    whole = swept_geometry(parts, MEASURED_QUADRANT)
    hull, perimeter = whole.convex_hull, whole.length
    return ShapeMeasures(
        perimeter, aspect, 4.0 * np.pi * whole.area / perimeter**2, whole.area / hull.area,
        *feret_diameters(np.asarray(hull.exterior.coords)[:-1]),
    )  # fmt: skip


def feret_diameters(hull: np.ndarray) -> tuple[float, float]:
    """Return the (largest, smallest) distance of two parallel tangents of a convex ring (k, 2).

    The largest is the distance of two corners; the smallest has one tangent along an edge.
    """
    points = hull[:, 0] + 1j * hull[:, 1]
    largest = np.abs(points[:, np.newaxis] - points).max()
    edges = np.roll(points, -1) - points
    edges = edges[np.abs(edges) > 0.0]
    # Distance of every corner from the line of every edge, with complex numbers as plane vectors.
    across = (points[:, np.newaxis] * np.conj(edges / np.abs(edges))).imag
    return float(largest), float(np.ptp(across, axis=0).min())
