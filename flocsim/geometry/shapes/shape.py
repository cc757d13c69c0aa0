"""Shape: base class of body outlines, core points swept by a disk; and the simplest one, Sphere."""

from collections.abc import Sequence
from functools import cached_property
from inspect import getattr_static
from typing import TYPE_CHECKING, Any, NamedTuple

import attrs
import numpy as np
from numpy.typing import ArrayLike

from flocsim.errors import RangeError, ShapeError
from flocsim.fields import in_unit, is_number
from flocsim.geometry.shapes.cores import Part, Parts, is_compound, moved_parts, signed_area
from flocsim.geometry.shapes.moments import all_moments
from flocsim.geometry.shapes.outline import (
    ShapeMeasures,
    loose_parts,
    measures_of,
    require_simple,
    swept_rings,
)

LEAST_ELONGATION = 1e-12
"""Elongation below which a shape has no long axis."""

TOO_CLOSE = 1e-12
"""Core points closer than this share of the core's extent count as repeated."""

TOUCHING = 1e-6
"""Parts closer than this share of the smaller radius are connected."""


def read_only(array: np.ndarray) -> np.ndarray:
    array.flags.writeable = False
    return array


SMALLEST, LARGEST = 1e-30, 1e30
"""Lengths [m] between which moments, which grow as the fourth power, are finite and above 0."""


def positive_radius(radius: Any) -> float:
    """Return ``radius``, a number or a text such as "5 um", as a float.

    Raises ShapeError unless it is between SMALLEST and LARGEST.
    """
    if isinstance(radius, np.generic):
        radius = radius.item()
    try:
        radius = in_unit(radius, "m", "the radius")
    except RangeError as error:
        raise ShapeError(str(error)) from None
    if not is_number(radius) or radius <= 0.0:
        raise ShapeError(f"the radius must be a finite number above 0 (metres), found {radius!r}")
    if not SMALLEST <= radius <= LARGEST:
        raise ShapeError(
            f"the radius must be between {SMALLEST:g} and {LARGEST:g} m, found {radius!r}"
        )
    return float(radius)


def read_points(name: str, points: ArrayLike, fewest: int = 1) -> np.ndarray:
    """Return ``points`` as a new (N, 2) float array; raise ShapeError for another form or
    non-finite."""
    try:
        array = np.array(points, dtype=float)
    except (TypeError, ValueError) as error:
        raise ShapeError(f"{name} must be numbers of shape (N, 2): {error}") from None
    if array.ndim != 2 or array.shape[1] != 2 or len(array) < fewest:
        advice = "; for one point use Sphere" if fewest == 2 else ""
        raise ShapeError(
            f"{name} must have shape (N, 2) with N ≥ {fewest}, found {array.shape}{advice}"
        )
    if not np.isfinite(array).all():
        row = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
        raise ShapeError(f"vertex {row} is not finite: {tuple(array[row].tolist())}")
    if len(array) and np.abs(array).max() > LARGEST:
        raise ShapeError(f"vertices must lie within {LARGEST:g} m of the origin")
    return array


def require_distinct(vertices):
    extent = np.ptp(vertices, axis=0).max()
    # Distances of successive vertices, around the ring.
    steps = np.hypot(*(np.roll(vertices, -1, axis=0) - vertices).T)
    repeated = np.flatnonzero(steps <= TOO_CLOSE * extent)
    if len(repeated):
        k = int(repeated[0])
        raise ShapeError(
            f"vertices {k} and {(k + 1) % len(vertices)} repeat the same point "
            f"{tuple(vertices[k].tolist())}; leave one out"
        )


class Swept(NamedTuple):
    """Properties that follow from a core and a radius.

    Core points (N, 2) [m], counter-clockwise around the centroid of the swept area; that centroid
    in the frame of the given core (2,) [m]; A [m²]; J = ∫ρ² dA about it [m⁴]; B = (M₁ − M₂)/(M₁ +
    M₂) of the principal second moments; the angle of the long axis [rad]; ``parts``, around the
    centroid as well.
    """

    vertices: np.ndarray
    centroid: np.ndarray
    area: float
    second_moment: float
    elongation: float
    long_axis: float
    parts: Parts


class Shape:
    """Core points swept by a disk (Minkowski sum of the core and the disk).

    All shapes are one family: a sphere is one core point. A core may have holes, and a shape may
    have several parts (Composite). ``vertices`` lists the core points of all parts, ``parts`` their
    grouping.

    Notes
    -----
    A user's shape is a frozen subclass with two fields or properties (examples/own_shape.py):

    - ``core``: (N, 2) [m], one point, the two ends of a segment, or the corners of a simple
      polygon, convex or not, in any frame and either direction;
    - ``radius`` [m] > 0, the spheroradius.

    Everything else follows, is computed once, and depends only on the core: ``vertices``, the core
    points around the centroid of the swept area (the origin of the shape's frame), ``area`` and
    ``second_moment``. Raises ShapeError if the core is no such polygon.
    """

    if TYPE_CHECKING:

        @property
        def core(self) -> np.ndarray: ...

        @property
        def radius(self) -> float: ...

    def __new__(cls, *values: object, **named: object) -> "Shape":
        """Raise TypeError for Shape itself, which has no outline."""
        if cls is Shape:
            raise TypeError("Shape is abstract: subclass it, and give `core` and `radius`")
        return super().__new__(cls)

    @cached_property
    def swept(self) -> Swept:
        for name in ("core", "radius"):
            if getattr_static(self, name, None) is None:
                raise ShapeError(f"the shape {type(self).__name__} gives no {name}")
        # A user's shape gives any core: check it once, at first use.
        core, radius = read_points("core", self.core), positive_radius(self.radius)
        return swept_parts([Part((core,), radius)])

    @property
    def vertices(self) -> np.ndarray:
        """Core points (N, 2) [m] around the centroid, counter-clockwise, read-only."""
        return self.swept.vertices

    @property
    def centroid(self) -> np.ndarray:
        """Centroid of the swept area in the frame of the given core (2,) [m]."""
        return self.swept.centroid

    @property
    def parts(self) -> Parts:
        """Parts of one or more rings each, around the centroid of the whole."""
        return self.swept.parts

    @cached_property
    def is_compound(self) -> bool:
        """True if the core has more than one ring: holes, or parts."""
        return is_compound(self.parts)

    @property
    def area(self) -> float:
        """Area A of the swept outline [m²]; overlaps of parts count once, holes do not count."""
        return self.swept.area

    @property
    def second_moment(self) -> float:
        """Second moment of area J = ∫ρ² dA about the centroid [m⁴]."""
        return self.swept.second_moment

    @property
    def elongation(self) -> float:
        """B = (M₁ − M₂)/(M₁ + M₂) of the principal second moments of area M₁ ≥ M₂ [-].

        0 for a sphere, (a² − b²)/(a² + b²) for an ellipse with the half axes a ≥ b.
        """
        return self.swept.elongation

    @property
    def long_axis(self) -> float:
        """Angle of the axis of the largest extent (of M₁) in the shape's frame, in (−π/2, π/2]
        [rad]; 0 where no axis is longer."""
        return self.swept.long_axis

    @property
    def equivalent_radius(self) -> float:
        """r_eq = √(A/π) [m]."""
        return float(np.sqrt(self.area / np.pi))

    @cached_property
    def bounding_radius(self) -> float:
        """R, the largest distance from the centroid to the outline [m]."""
        # The farthest core point of each part, plus the radius of its disk.
        return max(float(np.hypot(*each.points.T).max() + each.radius) for each in self.parts)

    @cached_property
    def measures(self) -> ShapeMeasures:
        """Perimeter and Feret diameters [m], aspect ratio, circularity and solidity [-] of the
        outline."""
        return measures_of(self.parts, self.elongation)

    def scaled(self, factor: float) -> "Shape":
        """Return the same outline scaled by ``factor``: a Sphere, a SpheroPolygon or a
        Composite."""
        from flocsim.geometry.shapes.spheropolygon import scaled_outline

        return scaled_outline(self, factor)

    def placed_vertices(self, x: float = 0.0, y: float = 0.0, angle: float = 0.0) -> np.ndarray:
        """Return the core points (N, 2) [m] of the body at (x, y), rotated by ``angle`` [rad]."""
        c, s = np.cos(angle), np.sin(angle)
        return self.vertices @ np.array([[c, s], [-s, c]]) + (x, y)

    def placed_parts(self, x: float = 0.0, y: float = 0.0, angle: float = 0.0) -> Parts:
        """Return the parts of the body at (x, y), rotated by ``angle`` [rad]."""
        return moved_parts(self.parts, x, y, angle)

    def outline(
        self, x: float = 0.0, y: float = 0.0, angle: float = 0.0, points_per_quadrant: int = 16
    ) -> list[np.ndarray]:
        """Return closed rings [(k, 2), …] of the placed outline [m], for drawing.

        Outer rings (several if parts touch in a point), then holes.
        """
        return swept_rings(self.placed_parts(x, y, angle), points_per_quadrant)


@attrs.frozen(eq=False)
class Sphere(Shape):
    """A disk in the plane of motion: one core point at its centre.

    Parameters
    ----------
    radius : float
        [m]

    Raises
    ------
    ShapeError
        If the radius is not finite and above 0.
    """

    radius: float = attrs.field(converter=positive_radius)

    @property
    def core(self) -> np.ndarray:
        return np.zeros((1, 2))


def swept_parts(parts: Sequence[Part]) -> Swept:
    """Return the Swept of some parts fixed to each other; raise ShapeError if they are not
    connected."""
    parts = tuple(checked_part(part) for part in parts)
    if len(parts) > 1 and len(loose := loose_parts(parts, TOUCHING)):
        raise ShapeError(
            f"part {loose[0]} of {len(parts)} is not connected to the first part: move it nearer"
        )
    points = parts[0].points if len(parts) == 1 else np.concatenate([p.points for p in parts])
    # A unit-sized copy keeps fourth powers of micrometres far from underflow.
    extent = np.ptp(points, axis=0).max() + max(part.radius for part in parts)
    unit = [Part(tuple(ring / extent for ring in p.rings), p.radius / extent) for p in parts]
    area, centroid, moment, stretch = all_moments(unit)
    centroid = centroid * extent
    # Move the centroid to the origin.
    around = tuple(
        Part(tuple(read_only(ring - centroid) for ring in part.rings), part.radius)
        for part in parts
    )
    return Swept(
        read_only(points - centroid), centroid, float(area * extent**2),
        float(moment * extent**4), *stretched(stretch, moment), around,
    )  # fmt: skip


def checked_part(part: Part) -> Part:
    """Return a part with its outer ring counter-clockwise and its holes clockwise.

    Raises ShapeError for an invalid core.
    """
    outer, *holes = part.rings
    for ring in part.rings:
        if len(ring) > 1:
            require_distinct(ring)
    if len(outer) < 3:
        if holes:
            raise ShapeError("a point or a segment has no holes")
        return part
    # Only after this is the signed area meaningful.
    require_simple(outer, holes)
    return Part((facing(outer, 1.0), *(facing(ring, -1.0) for ring in holes)), part.radius)


def facing(ring: np.ndarray, sense: float) -> np.ndarray:
    """Return the ring counter-clockwise (1) or clockwise (−1), beginning at the same point."""
    if sense * signed_area(ring - ring.mean(axis=0)) > 0.0:
        return ring
    return np.roll(ring[::-1], 1, axis=0)


def stretched(stretch: np.ndarray, moment: float) -> tuple[float, float]:
    """Return (elongation, long axis) from the deviatoric second moments (2,) and the polar one."""
    elongation = float(np.hypot(*stretch)) / moment
    if elongation <= LEAST_ELONGATION:
        return 0.0, 0.0
    # (cos 2ψ, sin 2ψ) is the direction of the deviatoric moments.
    return elongation, 0.5 * float(np.arctan2(stretch[1], stretch[0]))
