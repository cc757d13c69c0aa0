"""Where the bodies of a swarm begin: at random, one after another, without overlaps.

Random sequential placement, the largest first: a body gets a random place and angle, again and
again until it fits between those that are there. Discs of one size can fill .547 of a plane so,
after endless trials; far less is reached in practice, and less by shapes that reach out.

Walls and floors are fixed bodies made from a segment.
"""

import math
from collections.abc import Sequence
from itertools import product
from typing import Any

import attrs
import numpy as np

from flocsim.body import Body, read_position
from flocsim.errors import UsageError
from flocsim.fields import in_unit
from flocsim.geometry.shapes.outline import core_gap
from flocsim.geometry.shapes.shape import Shape
from flocsim.geometry.shapes.spheropolygon import WallShape

MOST_TRIALS = 5_000
"""Places tried for a body before it is said that none is left."""


@attrs.define
class Cells:
    """Bodies that are there, by the cells of a grid: those within its width of a place lie in the
    nine cells around."""

    width: float
    box: tuple[float, float]
    counts: tuple[int, int]
    found: dict[tuple[int, int], list[int]] = attrs.Factory(dict)

    @classmethod
    def of(cls, width: float, box: tuple[float, float]) -> "Cells":
        """Cells that are as wide as asked for, or a little wider."""
        wide, high = (max(1, int(side / width)) for side in box)
        return cls(width, box, (wide, high))

    def cell_of(self, place: np.ndarray) -> tuple[int, int]:
        column, row = (
            int(axis / side * count) % count
            for axis, side, count in zip(place[:2], self.box, self.counts, strict=True)
        )
        return column, row

    def add(self, body: int, place: np.ndarray) -> None:
        self.found.setdefault(self.cell_of(place), []).append(body)

    def around(self, place: np.ndarray) -> list[int]:
        """The bodies in the cells around a place, those across the seams included."""
        row, column = self.cell_of(place)
        cells = {
            ((row + i) % self.counts[0], (column + j) % self.counts[1])
            for i in (-1, 0, 1)
            for j in (-1, 0, 1)
        }
        return [body for cell in sorted(cells) for body in self.found.get(cell, ())]


@attrs.define
class Placement:
    """Bodies placed so far in an area that repeats itself along the axes flagged."""

    shapes: Sequence[Shape]
    area: tuple[float, float]
    repeats: tuple[bool, bool]
    gap: float
    places: np.ndarray
    cells: Cells

    def towards(self, place: np.ndarray, other: int) -> np.ndarray:
        """The way from another body to a place, by the nearest image [m]."""
        way = place[:2] - self.places[other, :2]
        for axis in range(2):
            if self.repeats[axis]:
                way[axis] -= self.area[axis] * round(way[axis] / self.area[axis])
        return way

    def fits(self, body: int, place: np.ndarray) -> bool:
        """Whether a body keeps its distance from all that are there."""
        shape = self.shapes[body]
        for axis in range(2):
            if not self.repeats[axis]:
                inside = shape.bounding_radius
                if not inside <= place[axis] <= self.area[axis] - inside:
                    return False
        return all(self.clear_of(shape, place, other) for other in self.cells.around(place))

    def clear_of(self, shape: Shape, place: np.ndarray, other: int) -> bool:
        """Whether a shape keeps its distance from another body."""
        way, there = self.towards(place, other), self.shapes[other]
        apart = math.hypot(*way) - shape.bounding_radius - there.bounding_radius
        if apart >= self.gap:
            return True
        if len(shape.vertices) == 1 and len(there.vertices) == 1:
            return False
        a = shape.placed_parts(float(way[0]), float(way[1]), float(place[2]))
        b = there.placed_parts(0.0, 0.0, self.places[other, 2])
        return all(
            core_gap(one, two) - one.radius - two.radius >= self.gap for one, two in product(a, b)
        )


def place_at_random(
    shapes: Sequence[Shape],
    area: tuple[float, float],
    rng: np.random.Generator,
    repeats: tuple[bool, bool] = (True, True),
    gap: float = 0.0,
) -> np.ndarray:
    """Places (n, 3) [m, m, rad] of bodies in an area (width, height) [m], none nearer to another
    one than a gap [m]; inside it along axes that do not repeat.

    UsageError where a body finds no place: it says what fraction of the area is filled by then.
    """
    widest = 2.0 * max(shape.bounding_radius for shape in shapes) + gap
    for side, again, name in zip(area, repeats, ("wide", "high"), strict=True):
        if side < (2.0 if again else 1.0) * widest:
            raise UsageError(
                f"the area is {side:.3g} m {name}, too small for bodies of up to {widest:.3g} m"
            )
    # Cells smaller than bodies reach would miss neighbours; one of a whole axis is all of it.
    cells = Cells.of(widest, area)
    placement = Placement(shapes, area, repeats, gap, np.zeros((len(shapes), 3)), cells)
    filled, whole = 0.0, area[0] * area[1]
    order = sorted(range(len(shapes)), key=lambda body: -shapes[body].bounding_radius)
    for count, body in enumerate(order):
        for _ in range(MOST_TRIALS):
            place = rng.random(3) * np.array([*area, 2.0 * math.pi])
            if placement.fits(body, place):
                break
        else:
            total = sum(shape.area for shape in shapes) / whole
            raise UsageError(
                f"{count} of {len(shapes)} bodies, {filled / whole:.3f} of the area, were placed "
                f"at random, and {MOST_TRIALS} trials found no room for the next: together they "
                f"would fill {total:.3f}; ask for a smaller fraction"
            )
        placement.places[body] = place
        cells.add(body, place)
        filled += shapes[body].area
    return placement.places


THIN = 1e-3
"""Half the thickness of a wall whose own is not given, in lengths."""


def wall(start: Any, end: Any, radius: float | str | None = None) -> Body:
    """A fixed Body: the segment between two points [m], swept by a disk of a ``radius`` [m].

    UsageError where the points are the same.
    """
    ends = np.array([read_position(start), read_position(end)])
    length = float(np.hypot(*(ends[1] - ends[0])))
    if length == 0.0:
        raise UsageError(f"a wall needs two different points, found {ends[0].tolist()} twice")
    thickness = THIN * length if radius is None else float(in_unit(radius, "m", "radius"))
    middle = ends.mean(axis=0)
    shape = WallShape(ends - middle, thickness)
    return Body(shape, (float(middle[0]), float(middle[1])), surface_density=1.0, fixed=True)


def floor(
    width: float | str, y: float | str = 0.0, radius: float | str | None = None, beyond: float = 0.0
) -> Body:
    """A level wall from x = 0 to ``width`` [m] whose upper side is at ``y`` [m]; it goes on for
    ``beyond`` [m] at both ends, as it must in a box that repeats itself, by the largest body."""
    wide, top = float(in_unit(width, "m", "width")), float(in_unit(y, "m", "y"))
    thickness = THIN * wide if radius is None else float(in_unit(radius, "m", "radius"))
    level = top - thickness
    return wall((-beyond, level), (wide + beyond, level), thickness)
