"""Spheropolygons, walls and composites; and outlines of another size or spheroradius.

A spheropolygon is the Minkowski sum of a simple polygon, with or without holes, and a disk (Tang et
al. 2014, section 2.2, eq. 1). A wall is a segment. A Composite is one rigid body of several shapes.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import attrs
import numpy as np
from numpy.typing import ArrayLike

from flocsim.errors import ShapeError
from flocsim.geometry.shapes.cores import Part, Parts, moved_parts, scaled_parts
from flocsim.geometry.shapes.moments import area_and_growth
from flocsim.geometry.shapes.shape import (
    Shape,
    Sphere,
    Swept,
    positive_radius,
    read_only,
    read_points,
    swept_parts,
)

AREA_TOLERANCE = 3e-5
"""Relative error of the area at which the last iteration of `parts_factor` leaves less than
1e-9."""

FLATNESS = 1e6
"""Equivalent radius of a wall over its length: forces between surfaces then use the reduced radius
of the other body, to a millionth."""


def read_vertices(vertices: ArrayLike) -> np.ndarray:
    return read_points("vertices", vertices, fewest=2)


def read_holes(holes: Iterable[ArrayLike]) -> tuple[np.ndarray, ...]:
    try:
        listed = list(holes)
    except TypeError:
        raise ShapeError(f"holes must be a list of rings (N, 2), found {holes!r}") from None
    return tuple(read_points("a hole", ring, fewest=3) for ring in listed)


# A __dict__ instead of slots: a copy keeps cached properties.
@attrs.frozen(eq=False, slots=False)
class SpheroPolygon(Shape):
    """Minkowski sum of a simple polygon, convex or not, and a disk.

    Parameters
    ----------
    vertices : (N, 2) array
        Corners [m], N ≥ 2 (two make a segment), in any frame and direction.
    radius : float
        Spheroradius [m].
    holes : sequence of (k, 2) arrays, optional
        Rings of 3 corners or more inside the polygon; the disk makes them smaller by its radius.

    Raises
    ------
    ShapeError
        For repeated or non-finite vertices, crossing edges, a non-positive radius, or a hole that
        is not inside.

    Notes
    -----
    The stored ``vertices`` run counter-clockwise around the centroid of the swept area at the
    origin, followed by those of holes, clockwise; ``centroid`` is its position in the given frame.
    """

    core: np.ndarray = attrs.field(converter=read_vertices, alias="vertices")
    radius: float = attrs.field(converter=positive_radius)
    holes: tuple[np.ndarray, ...] = attrs.field(converter=read_holes, default=(), kw_only=True)

    def __attrs_post_init__(self):
        # Faults of a polygon are reported when it is made, not when it is used.
        self.__dict__["swept"] = swept_parts([Part((self.core, *self.holes), self.radius)])


@attrs.frozen(eq=False, slots=False)
class WallShape(Shape):
    """A segment between two points swept by a disk of ``radius`` [m], half of the wall's
    thickness."""

    core: np.ndarray = attrs.field(converter=read_vertices, alias="vertices")
    radius: float = attrs.field(converter=positive_radius)

    @property
    def equivalent_radius(self) -> float:
        """Radius [m] that forces between surfaces use: practically flat."""
        return FLATNESS * float(np.hypot(*(self.vertices[1] - self.vertices[0])))


def read_parts(parts: Iterable[Any]) -> Parts:
    """Return the Parts given to a Composite: (shape, (x, y)) or (shape, (x, y), angle) each."""
    try:
        listed = list(parts)
    except TypeError:
        listed = []
    if not listed:
        raise ShapeError(
            "a Composite needs parts, a list of (shape, (x, y)) or (shape, (x, y), angle)"
        )
    return tuple(part for number, each in enumerate(listed) for part in placed(number, each))


def placed(number: int, given: Any) -> Parts:
    """Return the Parts of one of a Composite's shapes in its place."""
    if isinstance(given, Part):
        rings = tuple(read_points("a ring", ring) for ring in given.rings)
        return (Part(rings, positive_radius(given.radius)),)
    if not isinstance(given, tuple | list) or len(given) not in (2, 3):
        raise ShapeError(
            f"part {number} must be (shape, (x, y)) or (shape, (x, y), angle), found {given!r}"
        )
    shape, position, *turn = given
    if not isinstance(shape, Shape):
        raise ShapeError(f"part {number} must begin with a shape, found {shape!r}")
    try:
        x, y, angle = (float(each) for each in (*position, *(turn or [0.0])))
    except (TypeError, ValueError):
        x = y = angle = np.nan
    if not np.isfinite([x, y, angle]).all():
        raise ShapeError(f"part {number} must lie at a finite (x, y) and angle, found {given[1:]}")
    return moved_parts(shape.parts, x, y, angle)


@attrs.frozen(eq=False, slots=False)
class Composite(Shape):
    """A rigid body of several shapes fixed to each other.

    Parameters
    ----------
    parts : list of (shape, (x, y)) or (shape, (x, y), angle)
        Position of each shape's centroid [m], and its angle [rad], in any frame. Parts may overlap;
        overlaps count once in area and second moment. Each keeps its own spheroradius.

    Raises
    ------
    ShapeError
        If a part lies apart from all others.

    Examples
    --------
    >>> from flocsim import Composite, Sphere
    >>> pair = Composite([(Sphere(1e-6), (0.0, 0.0)), (Sphere(2e-6), (3e-6, 0.0))])
    >>> len(pair.parts), pair.radius
    (2, 1e-06)
    """

    given: Parts = attrs.field(converter=read_parts, alias="parts")

    def __attrs_post_init__(self):
        self.__dict__["swept"] = swept_parts(self.given)

    @classmethod
    def known(cls, swept: Swept) -> "Composite":
        """Return a Composite that has already been swept."""
        made = object.__new__(cls)
        made.__dict__.update(given=swept.parts, swept=swept)
        return made

    @property
    def core(self) -> np.ndarray:
        return np.concatenate([part.points for part in self.given])

    @property
    def radius(self) -> float:
        """Smallest spheroradius of its parts [m]."""
        return min(part.radius for part in self.given)


def scaled_outline(shape: Shape, factor: float) -> Shape:
    """Return a Sphere, SpheroPolygon or Composite scaled by ``factor``.

    Raises ShapeError unless the factor is finite and positive.
    """
    if not np.isfinite(factor) or factor <= 0.0:
        raise ShapeError(f"a shape can be scaled by a finite factor above 0, found {factor!r}")
    factor = float(factor)
    if len(shape.vertices) == 1:
        return Sphere(shape.radius * factor)
    vertices = read_only(shape.vertices * factor)
    # Areas scale with factor², second moments with factor⁴: nothing is computed again.
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
    """Return the simplest shape of these parts; raise ShapeError if they make no body."""
    if len(parts) > 1:
        return Composite(parts)
    (outer, *holes), radius = parts[0]
    if len(outer) == 1:
        return Sphere(radius)
    return SpheroPolygon(outer, radius, holes=holes)


def parts_factor(parts: Sequence[Part], area: float) -> float:
    """Return the factor that scales cores of one radius such that the swept outline has an area.

    The radius itself is not scaled. As long as the outline keeps its topology the area is disc +
    b·factor + c·factor², and each trial gives b and c: the area of the whole scales with the
    square, and its derivative with respect to the radius is the length of the outline.
    """
    [radius] = {part.radius for part in parts}
    room = area - np.pi * radius**2

    factor = 1.0
    for _ in range(60):
        # c and b from the area and its derivative: see the docstring; room = b·factor + c·factor².
        found, growth = area_and_growth(scaled_parts(parts, factor, 1.0))
        slope = (2.0 * found - radius * growth) / factor
        above = found - area + room
        c = (slope * factor - above) / factor**2
        b = slope - 2.0 * c * factor
        # Positive root of the quadratic model, in the form without cancellation.
        root = b * b + 4.0 * c * room
        step = 2.0 * room / (b + np.sqrt(root)) if root > 0.0 else 0.0
        # Far from the model's validity the area still scales roughly with the square.
        factor = step if 0.2 * factor < step < 5.0 * factor else factor * np.sqrt(area / found)
        if abs(found - area) <= AREA_TOLERANCE * area:
            break
    return factor


def resized(shape: Shape, equivalent_radius: float, radius: float) -> Shape:
    """Return the shape with its core scaled so that r_eq is exact when swept by ``radius`` [m].

    A Composite, whose parts would come apart, is scaled as a whole, radii included. Raises
    ShapeError if the disk alone is already as large as the wanted body.
    """
    if len(shape.parts) > 1:
        return shape.scaled(equivalent_radius / shape.equivalent_radius)
    if radius >= equivalent_radius:
        raise ShapeError(
            f"a spheroradius of {radius:g} m leaves no room for a core in a body of "
            f"r_eq = {equivalent_radius:g} m: choose a smaller spheroradius"
        )
    # In units of the wanted body, far from underflow.
    extent = shape.equivalent_radius
    unit = Part(tuple(ring / extent for ring in shape.parts[0].rings), radius / equivalent_radius)
    factor = parts_factor([unit], np.pi) * equivalent_radius
    # The factor is right to 1e-9; scaling the whole shape makes r_eq exact.
    sized = shape_of_parts([Part(tuple(ring * factor for ring in unit.rings), radius)])
    return sized.scaled(equivalent_radius / sized.equivalent_radius)
