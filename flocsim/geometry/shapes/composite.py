"""Composite: several shapes fixed to each other, one rigid body; and what holds of cores of several
rings, holes included."""

from collections.abc import Iterable, Sequence
from typing import Any

import attrs
import numpy as np

from flocsim.errors import ShapeError
from flocsim.geometry.shapes.cores import signed_area
from flocsim.geometry.shapes.moments import all_moments
from flocsim.geometry.shapes.outline import simplicity_fault
from flocsim.geometry.shapes.parts import (
    Part,
    Parts,
    core_gap,
    cores_overlap,
    moved_parts,
    scaled_parts,
)
from flocsim.geometry.shapes.shape import (
    Shape,
    Swept,
    positive_radius,
    read_only,
    read_points,
    require_distinct,
    stretched,
)

TOUCHING = 1e-6
"""Parts nearer to each other than this share of the smaller radius are fixed to each other."""


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
    def core(self) -> np.ndarray:
        return np.concatenate([part.points for part in self.given])

    @property
    def radius(self) -> float:
        """The smallest spheroradius of its parts [m]."""
        return min(part.radius for part in self.given)

    @property
    def is_compound(self) -> bool:
        return True


def swept_parts(parts: Sequence[Part]) -> Swept:
    """The Swept of some parts fixed to each other; ShapeError where they make no body."""
    parts = tuple(checked_part(part) for part in parts)
    require_joined(parts)
    points = np.concatenate([part.points for part in parts])
    # As in swept_by.
    extent = float(np.ptp(points, axis=0).max() + max(part.radius for part in parts))
    area, centroid, moment, stretch = all_moments(scaled_parts(parts, 1.0 / extent))
    centroid = centroid * extent
    around = tuple(
        Part(tuple(read_only(ring - centroid) for ring in part.rings), part.radius)
        for part in parts
    )
    vertices = read_only(points - centroid)
    return Swept(
        vertices, centroid, float(area * extent**2), float(moment * extent**4),
        *stretched(stretch, moment), around,
    )  # fmt: skip


def checked_part(part: Part) -> Part:
    """A part with its outer ring counter-clockwise and its holes clockwise; ShapeError where it is
    none."""
    outer, *holes = part.rings
    for ring in part.rings:
        if len(ring) > 1:
            require_distinct(ring)
    if len(outer) < 3:
        if holes:
            raise ShapeError("a point or a segment has no holes")
        return part
    fault = simplicity_fault(outer, holes)
    if fault is not None and not holes:
        raise ShapeError(f"the polygon of {len(outer)} vertices is not simple ({fault})")
    if fault is not None:
        raise ShapeError(
            f"a polygon with {len(holes)} holes is not simple ({fault}): holes must lie inside of "
            "it and apart from each other, and no edges may cross"
        )
    return Part((facing(outer, 1.0), *(facing(ring, -1.0) for ring in holes)), part.radius)


def facing(ring: np.ndarray, sense: float) -> np.ndarray:
    """The ring counter-clockwise (1) or clockwise (−1), the first point kept."""
    if sense * signed_area(ring - ring.mean(axis=0)) > 0.0:
        return ring
    return np.roll(ring[::-1], 1, axis=0)


def require_joined(parts: Sequence[Part]) -> None:
    """ShapeError where a part lies apart from all others that hang together."""
    centres = [part.points.mean(axis=0) for part in parts]
    reach = [
        float(np.hypot(*(part.points - centre).T).max() + part.radius)
        for part, centre in zip(parts, centres, strict=True)
    ]
    left, joined = set(range(1, len(parts))), [0]
    for one in joined:
        near = [other for other in sorted(left) if touch(parts, centres, reach, one, other)]
        left.difference_update(near)
        joined += near
    if left:
        raise ShapeError(
            f"part {min(left)} of {len(parts)} touches none of those that hang together with the "
            "first: move it nearer"
        )


def touch(parts, centres, reach, one, other):
    """Whether two parts touch or overlap."""
    a, b = parts[one], parts[other]
    slack = TOUCHING * min(a.radius, b.radius)
    if np.hypot(*(centres[one] - centres[other])) > reach[one] + reach[other] + slack:
        return False
    return core_gap(a, b) <= a.radius + b.radius + slack or cores_overlap(a, b)
