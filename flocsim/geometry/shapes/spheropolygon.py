"""SpheroPolygon: a simple polygon swept by a disk (paper section 2.2, eq. 1)."""

import attrs
import numpy as np
from numpy.typing import ArrayLike

from flocsim.errors import ShapeError
from flocsim.geometry.shapes.shape import (
    Shape,
    Swept,
    positive_radius,
    read_only,
    read_points,
    swept_by,
)
from flocsim.geometry.shapes.sphere import Sphere


def read_vertices(vertices: ArrayLike) -> np.ndarray:
    return read_points("vertices", vertices, fewest=2)


# A dictionary, not slots: a copy keeps what has been computed.
@attrs.frozen(eq=False, slots=False)
class SpheroPolygon(Shape):
    """Minkowski sum of a simple polygon, convex or not, and a disk.

    Parameters: ``vertices`` (N, 2) [m], N ≥ 2 (two make a segment), in any frame and sense;
    ``radius`` [m] > 0, the spheroradius. The stored vertices run counter-clockwise around the
    centroid of the swept area at the origin; ``centroid`` keeps where that was.

    Raises ShapeError for repeated or non-finite vertices, crossing edges, a non-positive radius.
    """

    core: np.ndarray = attrs.field(converter=read_vertices, alias="vertices")
    radius: float = attrs.field(converter=positive_radius)

    def __attrs_post_init__(self):
        # What is wrong with a polygon is said when it is made, not when it is used.
        self.__dict__["swept"] = swept_by(self.core, self.radius)


def scaled_outline(shape: Shape, factor: float) -> Shape:
    """A Sphere or SpheroPolygon ``factor`` times as large; ShapeError unless finite, above 0."""
    if not np.isfinite(factor) or factor <= 0.0:
        raise ShapeError(f"a shape can be scaled by a finite factor above 0, found {factor!r}")
    factor = float(factor)
    if len(shape.vertices) == 1:
        return Sphere(shape.radius * factor)
    vertices = read_only(shape.vertices * factor)
    copy = object.__new__(SpheroPolygon)
    # Nothing has to be computed again: areas go with factor², second moments with factor⁴.
    copy.__dict__.update(
        core=vertices,
        radius=shape.radius * factor,
        swept=Swept(
            vertices,
            shape.centroid * factor,
            shape.area * factor**2,
            shape.second_moment * factor**4,
            shape.elongation,
            shape.long_axis,
        ),
    )
    return copy
