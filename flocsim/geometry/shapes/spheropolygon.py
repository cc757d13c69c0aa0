"""SpheroPolygon: a simple polygon, with or without holes, swept by a disk (paper section 2.2,
eq. 1)."""

from collections.abc import Iterable, Sequence

import attrs
import numpy as np
from numpy.typing import ArrayLike

from flocsim.errors import ShapeError
from flocsim.geometry.shapes.composite import Composite
from flocsim.geometry.shapes.parts import Part, scaled_parts
from flocsim.geometry.shapes.shape import (
    Shape,
    Swept,
    positive_radius,
    read_only,
    read_points,
    swept_parts,
)
from flocsim.geometry.shapes.sphere import Sphere


def read_vertices(vertices: ArrayLike) -> np.ndarray:
    return read_points("vertices", vertices, fewest=2)


def read_holes(holes: Iterable[ArrayLike]) -> tuple[np.ndarray, ...]:
    try:
        listed = list(holes)
    except TypeError:
        raise ShapeError(f"holes must be a list of rings (N, 2), found {holes!r}") from None
    return tuple(read_points("a hole", ring, fewest=3) for ring in listed)


# A dictionary, not slots: a copy keeps what has been computed.
@attrs.frozen(eq=False, slots=False)
class SpheroPolygon(Shape):
    """Minkowski sum of a simple polygon, convex or not, and a disk.

    Parameters: ``vertices`` (N, 2) [m], N ≥ 2 (two make a segment), in any frame and sense;
    ``radius`` [m] > 0, the spheroradius; ``holes``, rings of 3 corners or more inside the polygon,
    which the disk makes smaller by its radius. The stored vertices run counter-clockwise around the
    centroid of the swept area at the origin, those of holes behind them and clockwise; ``centroid``
    keeps where that was.

    Raises ShapeError for repeated or non-finite vertices, crossing edges, a non-positive radius, a
    hole that is not inside.
    """

    core: np.ndarray = attrs.field(converter=read_vertices, alias="vertices")
    radius: float = attrs.field(converter=positive_radius)
    holes: tuple[np.ndarray, ...] = attrs.field(converter=read_holes, default=(), kw_only=True)

    def __attrs_post_init__(self):
        # What is wrong with a polygon is said when it is made, not when it is used.
        self.__dict__["swept"] = swept_parts([Part((self.core, *self.holes), self.radius)])


def scaled_outline(shape: Shape, factor: float) -> Shape:
    """A Sphere, SpheroPolygon or Composite ``factor`` times as large; ShapeError unless finite,
    above 0."""
    if not np.isfinite(factor) or factor <= 0.0:
        raise ShapeError(f"a shape can be scaled by a finite factor above 0, found {factor!r}")
    factor = float(factor)
    if len(shape.vertices) == 1:
        return Sphere(shape.radius * factor)
    vertices = read_only(shape.vertices * factor)
    # Nothing has to be computed again: areas go with factor², second moments with factor⁴.
    swept = Swept(
        vertices,
        shape.centroid * factor,
        shape.area * factor**2,
        shape.second_moment * factor**4,
        shape.elongation,
        shape.long_axis,
        scaled_parts(shape.swept.parts, factor),
    )
    if shape.is_compound:
        return Composite.known(swept)
    copy = object.__new__(SpheroPolygon)
    copy.__dict__.update(core=vertices, radius=shape.radius * factor, holes=(), swept=swept)
    return copy


def shape_of_parts(parts: Sequence[Part]) -> Shape:
    """The plainest shape of these parts; ShapeError where they make no body."""
    if len(parts) > 1:
        return Composite(parts)
    (outer, *holes), radius = parts[0]
    if len(outer) == 1:
        return Sphere(radius)
    return SpheroPolygon(outer, radius, holes=holes)
