"""Where the bodies of a swarm begin: at random, one after another, without overlaps.

Random sequential placement, the largest first: a body gets a random place and angle, again and
again until it fits between those that are there. Discs of one size can fill .547 of a plane so,
after endless trials; far less is reached in practice, and less by shapes that reach out.
"""

import math
from collections.abc import Sequence
from itertools import product

import attrs
import numpy as np

from flocsim.errors import UsageError
from flocsim.geometry.shapes.parts import core_gap, cores_overlap
from flocsim.geometry.shapes.shape import Shape

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
        pairs = list(product(a, b))
        if any(cores_overlap(one, two) for one, two in pairs):
            return False
        return all(core_gap(one, two) - one.radius - two.radius >= self.gap for one, two in pairs)


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
                f"the area is {side:.3g} m {name}, too little for bodies of up to {widest:.3g} m"
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
                f"{count} of {len(shapes)} bodies, {filled / whole:.3f} of the area, found a place "
                f"at random, and {MOST_TRIALS} trials none for the next: they would fill "
                f"{total:.3f}; ask for a smaller fraction"
            )
        placement.places[body] = place
        cells.add(body, place)
        filled += shapes[body].area
    return placement.places
