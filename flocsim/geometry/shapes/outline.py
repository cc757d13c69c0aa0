"""Outlines as point lists, and whether a polygon is simple. The only room that imports shapely."""

import numpy as np

from flocsim.errors import ShapeError


def simplicity_fault(vertices: np.ndarray) -> str | None:
    """None where the closed polygon (N ≥ 3, 2) is simple, else where it fails, in words."""
    import shapely

    polygon = shapely.Polygon(vertices)
    return None if polygon.is_valid else shapely.is_valid_reason(polygon)


def require_simple(vertices: np.ndarray) -> None:
    """Raise ShapeError where edges of the closed polygon cross or touch."""
    fault = simplicity_fault(vertices)
    if fault is not None:
        raise ShapeError(
            f"the polygon of {len(vertices)} vertices is not simple ({fault}); "
            "its edges must not cross or touch: reorder or move the vertices"
        )


def swept_rings(
    vertices: np.ndarray, radius: float, points_per_quadrant: int = 16
) -> list[np.ndarray]:
    """The outline of core ⊕ disk as closed rings [(k, 2), …] in metres, the outer one first."""
    import shapely

    makers = {1: shapely.Point, 2: shapely.LineString}
    core = makers.get(len(vertices), shapely.Polygon)(np.asarray(vertices))
    swept = core.buffer(radius, quad_segs=points_per_quadrant)
    return [np.asarray(ring.coords) for ring in (swept.exterior, *swept.interiors)]
