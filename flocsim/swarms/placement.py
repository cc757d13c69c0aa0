"""Where the bodies of a swarm begin in a box, its walls, and what becomes of those that leave it.

Random sequential placement, the largest first: a body gets a random place and angle, again and
again until it fits between those that are there. Discs of one size can fill .547 of a plane so,
after endless trials; far less is reached in practice, and less by shapes that reach out.

Walls and floors are fixed bodies made from a segment.

Bodies leave a box through a side at which it does not repeat itself. Looked at between two windows:
a cluster leaves, as a whole, when the circles around all its bodies are outside. It is removed, or
moved back in over the opposite side (the top, where it left through a wall at the side), as it is
and with all its contacts, at a random place across which keeps clear of others.
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
from flocsim.state.bodies import ANGLE, VY, X, Y
from flocsim.swarms.arrays import Swarm, with_links
from flocsim.swarms.together.clusters import Gauge, placed_together

MOST_TRIALS = 5_000
"""Places tried for a body before it is said that none is left."""


def nearest(ways: np.ndarray, area: tuple[float, float], repeats: tuple[bool, bool]) -> np.ndarray:
    """Ways (…, 2) [m] between places of an area that repeats itself along the axes flagged, by the
    nearest images."""
    return ways - np.where(repeats, area * np.floor(ways / area + 0.5), 0.0)


class Placement:
    """Bodies placed so far in an area that repeats itself along the axes flagged.

    Those within a ``width`` [m] of a place lie in the nine ``cells`` of a grid around it, which are
    as wide, or a little wider.
    """

    def __init__(
        self, shapes: Sequence[Shape], area: tuple[float, float], repeats: tuple[bool, bool],
        gap: float, width: float,
    ) -> None:  # fmt: skip
        self.shapes, self.area, self.repeats, self.gap = shapes, area, repeats, gap
        self.reach = np.array([shape.bounding_radius for shape in shapes])
        self.places = np.zeros((len(shapes), 3))
        self.counts = [max(1, int(side / width)) for side in area]
        self.cells: dict[tuple[int, int], list[int]] = {}

    def cells_around(self, place: np.ndarray, rings: int) -> set[tuple[int, int]]:
        """The cell of a place, and so many ``rings`` around it, across the seams."""
        (wide, high), (many, more) = self.area, self.counts
        column, row = int(place[0] / wide * many), int(place[1] / high * more)
        steps = range(-rings, rings + 1)
        return {((column + i) % many, (row + j) % more) for i in steps for j in steps}

    def add(self, body: int, place: np.ndarray) -> None:
        self.places[body] = place
        [cell] = self.cells_around(place, 0)
        self.cells.setdefault(cell, []).append(body)

    def fits(self, body: int, place: np.ndarray) -> bool:
        """Whether a body keeps its distance from all that are there."""
        shape, reach = self.shapes[body], self.reach[body]
        for axis, side, again in zip(place[:2], self.area, self.repeats, strict=True):
            if not again and not reach <= axis <= side - reach:
                return False
        near = [each for cell in self.cells_around(place, 1) for each in self.cells.get(cell, ())]
        ways = nearest(place[:2] - self.places[near, :2], self.area, self.repeats)
        apart = np.hypot(*ways.T) - reach - self.reach[near]
        return all(
            self.clear_of(shape, (*ways[k].tolist(), place[2]), near[k])
            for k in np.flatnonzero(apart < self.gap)
        )

    def clear_of(self, shape: Shape, place: Sequence[float], other: int) -> bool:
        """Whether a shape, at a place seen from another body, keeps its distance from that."""
        there = self.shapes[other]
        if len(shape.vertices) == 1 and len(there.vertices) == 1:
            return False
        a, b = shape.placed_parts(*place), there.placed_parts(0.0, 0.0, self.places[other, 2])
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
    placement = Placement(shapes, area, repeats, gap, widest)
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
                f"{count} of {len(shapes)} bodies were placed at random, on {filled / whole:.3f} "
                f"of the area, and {MOST_TRIALS} trials found no room for the next one; all would "
                f"fill {total:.3f}: ask for a smaller fraction"
            )
        placement.add(body, place)
        filled += shapes[body].area
    return placement.places


THIN = 1e-3
"""Half the thickness of a wall whose own is not given, in lengths."""


def wall(start: Any, end: Any, radius: float | str | None = None) -> Body:
    """Return a fixed body: a segment between two points, swept by a disk.

    Parameters
    ----------
    start, end : (float, float)
        Ends of the segment [m], or texts such as "5 um".
    radius : float or str, optional
        Radius of the disk [m]; a thousandth of the length by default.

    Returns
    -------
    Body

    Raises
    ------
    UsageError
        If both points are the same.
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
    """Return a level wall from x = 0 to ``width``.

    Parameters
    ----------
    width : float or str
        Length [m].
    y : float or str
        Height of the upper side [m].
    radius : float or str, optional
        Half its thickness [m]; a thousandth of ``width`` by default.
    beyond : float
        Length [m] by which it extends at both ends; in a periodic box, at least the size of the
        largest body.

    Returns
    -------
    Body
    """
    wide, top = float(in_unit(width, "m", "width")), float(in_unit(y, "m", "y"))
    thickness = THIN * wide if radius is None else float(in_unit(radius, "m", "radius"))
    level = top - thickness
    return wall((-beyond, level), (wide + beyond, level), thickness)


KEEP, REMOVE, REENTER = "keep", "remove", "reenter"

FEW_TRIALS = 200
"""Places tried for what comes back, before it is put further out."""

CLEAR = 0.05
"""What comes back keeps clear of others by this share of its own size."""

PARKED = 10.0
"""Bodies that are gone lie outside, so many times the largest apart."""


@attrs.frozen(eq=False)
class Leaving:
    """A rule for a swarm in the area (0, 0) to ``area`` [m], which repeats itself along the axes
    flagged in ``repeats``; nothing leaves through a ``floor``.

    ``key``: whole numbers that say, with the body and how often it has come back, where it comes
    back. ``gauge`` tells which bodies touch.
    """

    rule: str
    area: tuple[float, float]
    repeats: tuple[bool, bool]
    floor: bool
    key: Sequence[int]
    gauge: Gauge

    def outside(self, swarm: Swarm, present: np.ndarray) -> np.ndarray:
        """Which bodies are outside, with all of their circles, and will not come back themselves:
        through the top only what rises."""
        x, y = swarm.motion[:, X], swarm.motion[:, Y]
        reach = swarm.bodies["bounding_radius"]
        found = np.zeros(len(x), bool)
        if not self.repeats[0]:
            found |= (x < -reach) | (x > self.area[0] + reach)
        if not self.repeats[1]:
            found |= (y > self.area[1] + reach) & (swarm.motion[:, VY] > 0.0)
            if not self.floor:
                found |= y < -reach
        return found & present

    def leaving(self, swarm: Swarm, present: np.ndarray) -> list[np.ndarray]:
        """The clusters that leave, each as its bodies, in the order of their first ones."""
        out = self.outside(swarm, present)
        if not out.any():
            return []
        near = self.gauge.neighbours(swarm.motion[:, : ANGLE + 1]).among(present)
        labels, _ = placed_together(len(out), near)
        clusters = [np.flatnonzero(labels == label) for label in np.unique(labels[out])]
        whole = [members for members in clusters if out[members].all()]
        return sorted(whole, key=lambda members: int(members[0]))

    def removed(self, swarm: Swarm, gone: np.ndarray) -> Swarm:
        """The swarm without some bodies (n,) bool, which lie outside from now on."""
        swarm.motion[gone] = 0.0
        apart = PARKED * max(float(swarm.bodies["bounding_radius"].max()), *self.area)
        axis = X if not self.repeats[0] else Y
        swarm.motion[gone, axis] = -apart * (2.0 + np.arange(len(gone)))[gone]
        for array in (swarm.stated, swarm.strayed, swarm.carried, swarm.errors):
            array[gone] = 0.0
        kept = ~(gone[swarm.links["later"]] | gone[swarm.links["earlier"]])
        return with_links(swarm, swarm.links[kept])

    def returned(self, swarm: Swarm, members: np.ndarray, present: np.ndarray, count: int) -> None:
        """Move a cluster back in, for the ``count``-th time."""
        rng = np.random.Generator(np.random.Philox(np.random.SeedSequence(
            tuple(self.key), spawn_key=(int(members[0]), count)
        )))  # fmt: skip
        place, reach = swarm.motion[members, :2], swarm.bodies[members]["bounding_radius"]
        low = (place - reach[:, None]).min(axis=0)
        high = (place + reach[:, None]).max(axis=0)
        wide, tall = high - low
        rises = not self.repeats[1] and low[1] > self.area[1]
        others = present.copy()
        others[members] = False
        there, radii = swarm.motion[others, :2], swarm.bodies[others]["bounding_radius"]
        out, clear = 0.0, CLEAR * max(wide, tall)
        while True:
            for _ in range(FEW_TRIALS):
                across = rng.random() * (self.area[0] if self.repeats[0] else
                                         max(self.area[0] - wide, 0.0))  # fmt: skip
                up = -tall - out if rises else self.area[1] + out
                if self.repeats[1]:
                    # Left through a side of a box that repeats itself upwards.
                    up = rng.random() * self.area[1]
                shift = np.array([across, up]) - low
                apart = (nearest(there - each, self.area, self.repeats) for each in place + shift)
                if all(
                    np.all(np.hypot(*ways.T) >= radii + radius)
                    for ways, radius in zip(apart, reach + clear, strict=True)
                ):
                    swarm.motion[members, :2] = place + shift
                    return
            out += tall
