"""Parts: what a shape is made of. A part is a core of one or several rings, swept by one disk.

A sphere, a segment and a polygon are one part of one ring; a polygon with holes is one part with a
ring more for each of them; several parts fixed to each other are a composite.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


class Part(NamedTuple):
    """``rings``: (k, 2) [m] each, a point, the ends of a segment or the corners of a polygon, the
    outer one counter-clockwise, those of holes behind it clockwise; ``radius`` [m] of the disk."""

    rings: tuple[np.ndarray, ...]
    radius: float

    @property
    def points(self) -> np.ndarray:
        """The core points of all rings (N, 2) [m]."""
        return self.rings[0] if len(self.rings) == 1 else np.concatenate(self.rings)


Parts = tuple[Part, ...]


def is_compound(parts: Sequence[Part]) -> bool:
    """Whether there is more than one ring."""
    return len(parts) > 1 or len(parts[0].rings) > 1


def moved_parts(parts: Sequence[Part], x: float, y: float, angle: float) -> Parts:
    """Parts turned by an angle [rad] about the origin, then shifted."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, s], [-s, c]])
    return tuple(
        Part(tuple(ring @ turn + (x, y) for ring in part.rings), part.radius) for part in parts
    )


def scaled_parts(parts: Sequence[Part], factor: float, radii: float | None = None) -> Parts:
    """Parts ``factor`` times as large, their radii ``radii`` times (as well unless given)."""
    wider = factor if radii is None else radii
    return tuple(
        Part(tuple(ring * factor for ring in part.rings), part.radius * wider) for part in parts
    )


class PointTable(NamedTuple):
    """Parts as columns, for files: of every core point its ``place`` (N, 2) [m], the numbers of its
    ``part`` and of its ``ring`` in there (N,), and the ``radius`` (N,) [m] of its part."""

    place: np.ndarray
    part: np.ndarray
    ring: np.ndarray
    radius: np.ndarray


def table_of(parts: Sequence[Part]) -> PointTable:
    """The PointTable of some parts."""
    rows = [
        (ring, np.full(len(ring), number), np.full(len(ring), place),
         np.full(len(ring), part.radius))
        for number, part in enumerate(parts) for place, ring in enumerate(part.rings)
    ]  # fmt: skip
    return PointTable(*(np.concatenate(column) for column in zip(*rows, strict=True)))


def parts_in(table: PointTable) -> Parts:
    """The parts of a PointTable, as it was read; ValueError where its numbers do not count up from
    0, or points of a part have several radii."""
    place, part, ring, radius = (np.asarray(column) for column in table)
    found: list[Part] = []
    names = np.column_stack([part, ring])
    breaks = np.flatnonzero(np.any(np.diff(names, axis=0) != 0, axis=1)) + 1
    for rows in np.split(np.arange(len(place)), breaks):
        number, hole = names[rows[0]].tolist()
        if np.any(radius[rows] != radius[rows[0]]):
            raise ValueError("core points of a part have several radii")
        if hole == 0 and number == len(found):
            found.append(Part((place[rows],), float(radius[rows[0]])))
        elif number == len(found) - 1 and hole == len(found[-1].rings):
            if radius[rows[0]] != found[-1].radius:
                raise ValueError("core points of a part have several radii")
            found[-1] = Part((*found[-1].rings, place[rows]), found[-1].radius)
        else:
            raise ValueError("numbers of parts and rings do not count up from 0")
    return tuple(found)
