"""SpheroPolygon: a simple polygon swept by a disk (paper section 2.2, eq. 1)."""

import attrs
import numpy as np

from flocsim.errors import ShapeError
from flocsim.geometry.shapes.cores import signed_area
from flocsim.geometry.shapes.moments import swept_moments
from flocsim.geometry.shapes.outline import require_simple
from flocsim.geometry.shapes.shape import Shape
from flocsim.geometry.shapes.sphere import positive_radius

TOO_CLOSE = 1e-12
"""Vertices nearer than this share of the polygon's extent count as repeated."""


def read_vertices(vertices):
    """``vertices`` as a fresh (N, 2) float array; ShapeError for another form or non-finite."""
    try:
        array = np.array(vertices, dtype=float)
    except (TypeError, ValueError) as error:
        raise ShapeError(f"vertices must be numbers of shape (N, 2): {error}") from None
    if array.ndim != 2 or array.shape[1] != 2 or len(array) < 2:
        raise ShapeError(
            f"vertices must have shape (N, 2) with N ≥ 2, found {array.shape}; "
            "for one point use Sphere"
        )
    if not np.isfinite(array).all():
        row = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
        raise ShapeError(f"vertex {row} is not finite: {tuple(array[row].tolist())}")
    return array


def require_distinct(vertices):
    """Raise ShapeError where two neighbouring vertices coincide."""
    extent = np.ptp(vertices, axis=0).max()
    steps = np.hypot(*(np.roll(vertices, -1, axis=0) - vertices).T)
    repeated = np.flatnonzero(steps <= TOO_CLOSE * extent)
    if len(repeated):
        k = int(repeated[0])
        raise ShapeError(
            f"vertices {k} and {(k + 1) % len(vertices)} repeat the same point "
            f"{tuple(vertices[k].tolist())}; leave one out"
        )


def counter_clockwise(vertices):
    """The polygon's vertices in counter-clockwise order, the first one kept."""
    if len(vertices) > 2 and signed_area(vertices - vertices.mean(axis=0)) < 0.0:
        return np.roll(vertices[::-1], 1, axis=0)
    return vertices


def positive_factor(factor):
    """``factor`` as a float; ShapeError unless it is a finite number above 0."""
    if not np.isfinite(factor) or factor <= 0.0:
        raise ShapeError(f"a shape can be scaled by a finite factor above 0, found {factor!r}")
    return float(factor)


@attrs.frozen(eq=False)
class SpheroPolygon(Shape):
    """Minkowski sum of a simple polygon, convex or not, and a disk.

    Parameters: ``vertices`` (N, 2) [m], N ≥ 2 (two make a segment), in any frame and sense;
    ``radius`` [m] > 0, the spheroradius. The stored vertices run counter-clockwise around the
    centroid of the swept area at the origin; ``centroid`` keeps where that was.

    Raises ShapeError for repeated or non-finite vertices, crossing edges, a non-positive radius.
    """

    vertices: np.ndarray = attrs.field(converter=read_vertices)
    radius: float = attrs.field(converter=positive_radius)
    centroid: np.ndarray = attrs.field(init=False, repr=False)
    area: float = attrs.field(init=False, repr=False)
    second_moment: float = attrs.field(init=False, repr=False)

    def __attrs_post_init__(self):
        require_distinct(self.vertices)
        if len(self.vertices) > 2:
            require_simple(self.vertices)
        vertices = counter_clockwise(self.vertices)
        # A unit-sized copy keeps fourth powers of micrometres far from underflow.
        extent = np.ptp(vertices, axis=0).max() + self.radius
        area, centroid, moment = swept_moments(vertices / extent, self.radius / extent)
        centred = vertices - centroid * extent
        centred.flags.writeable = False
        for name, value in (
            ("vertices", centred),
            ("centroid", centroid * extent),
            ("area", float(area * extent**2)),
            ("second_moment", float(moment * extent**4)),
        ):
            object.__setattr__(self, name, value)

    def scaled(self, factor):
        """The same outline, ``factor`` times as large: vertices and spheroradius."""
        factor = positive_factor(factor)
        copy = object.__new__(SpheroPolygon)
        vertices = self.vertices * factor
        vertices.flags.writeable = False
        # Nothing has to be computed again: areas go with factor², second moments with factor⁴.
        for name, value in (
            ("vertices", vertices),
            ("radius", self.radius * factor),
            ("centroid", self.centroid * factor),
            ("area", self.area * factor**2),
            ("second_moment", self.second_moment * factor**4),
        ):
            object.__setattr__(copy, name, value)
        return copy
