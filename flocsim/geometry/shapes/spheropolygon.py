"""SpheroPolygon: a simple polygon, with or without holes, swept by a disk (paper section 2.2,
eq. 1); a wall, which is a segment; Composite, several shapes fixed to each other, one rigid body;
and any outline in another size, or of a wanted spheroradius."""

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

SETTLED = 3e-5
"""Relative error of the area from which one more step of the model below leaves less than 1e-9."""

FLATNESS = 1e6
"""A wall counts as a sphere of so many times its length in forces between surfaces: a reduced
radius is then that of what comes near, to a millionth."""


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

    @property
    def parts(self) -> Parts:
        return self.swept.parts


@attrs.frozen(eq=False, slots=False)
class WallShape(Shape):
    """A segment between two points swept by a disk: half of the ``radius`` [m] is its thickness."""

    core: np.ndarray = attrs.field(converter=read_vertices, alias="vertices")
    radius: float = attrs.field(converter=positive_radius)

    @property
    def equivalent_radius(self) -> float:
        """What forces between surfaces take for its radius [m]: flat."""
        return FLATNESS * float(np.hypot(*(self.vertices[1] - self.vertices[0])))


def read_parts(parts: Iterable[Any]) -> Parts:
    """The Parts that a Composite is given: (shape, (x, y)) or (shape, (x, y), angle) each."""
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
    """The Parts of one of a Composite's shapes at its place."""
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

    Parameters: ``parts``, a list of (shape, (x, y)) or (shape, (x, y), angle): where the centroid
    of each lies [m], and its turn [rad], in any frame. Parts may overlap; what they share counts
    once in area and second moment. Each keeps its own spheroradius; ``radius`` is the smallest.

    Raises ShapeError where a part lies apart from all others.

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
        """The one that has already been swept."""
        made = object.__new__(cls)
        made.__dict__.update(given=swept.parts, swept=swept)
        return made

    @property
    def parts(self) -> Parts:
        return self.swept.parts

    @property
    def core(self) -> np.ndarray:
        return np.concatenate([part.points for part in self.given])

    @property
    def radius(self) -> float:
        """The smallest spheroradius of its parts [m]."""
        return min(part.radius for part in self.given)


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


def parts_factor(parts: Sequence[Part], area: float) -> float:
    """The factor by which cores of one radius must be scaled for the swept outline to have an area;
    the radius stays what it is.

    While the outline keeps its form, the area is disc + b·factor + c·factor², of which each trial
    gives b and c: scaled as a whole, radius and all, the area goes with the square, and with the
    radius alone it grows by the length of the outline.
    """
    [radius] = {part.radius for part in parts}
    room = area - np.pi * radius**2

    factor = 1.0
    for _ in range(60):
        found, growth = area_and_growth(scaled_parts(parts, factor, 1.0))
        slope = (2.0 * found - radius * growth) / factor
        above = found - area + room
        c = (slope * factor - above) / factor**2
        b = slope - 2.0 * c * factor
        root = b * b + 4.0 * c * room
        step = 2.0 * room / (b + np.sqrt(root)) if root > 0.0 else 0.0
        # Far from the model's reach the area still goes roughly with the square.
        factor = step if 0.2 * factor < step < 5.0 * factor else factor * np.sqrt(area / found)
        if abs(found - area) <= SETTLED * area:
            break
    return factor


def resized(shape: Shape, equivalent_radius: float, radius: float) -> Shape:
    """The shape's core scaled so that, swept by ``radius`` [m], r_eq is exact [m]; a
    Composite, whose parts would come apart, is scaled as a whole, its radii with it.

    Raises ShapeError where the disk alone is already as large as the wanted body.
    """
    if len(shape.parts) > 1:
        return shape.scaled(equivalent_radius / shape.equivalent_radius)
    if radius >= equivalent_radius:
        raise ShapeError(
            f"a spheroradius of {radius:g} m leaves no room for a core in a body of "
            f"r_eq = {equivalent_radius:g} m: choose a smaller spheroradius"
        )
    # Solved in units of the wanted body, far from underflow.
    extent = shape.equivalent_radius
    unit = Part(tuple(ring / extent for ring in shape.parts[0].rings), radius / equivalent_radius)
    factor = parts_factor([unit], np.pi) * equivalent_radius
    sized = shape_of_parts([Part(tuple(ring * factor for ring in unit.rings), radius)])
    return sized.scaled(equivalent_radius / sized.equivalent_radius)
