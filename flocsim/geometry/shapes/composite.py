"""Composite: several shapes fixed to each other, one rigid body; and what holds of cores of several
rings, holes included."""

from collections.abc import Iterable
from typing import Any

import attrs
import numpy as np

from flocsim.errors import ShapeError
from flocsim.geometry.shapes.parts import Part, Parts, moved_parts
from flocsim.geometry.shapes.shape import (
    Shape,
    Swept,
    positive_radius,
    read_points,
    swept_parts,
)


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
