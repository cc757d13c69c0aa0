"""Walls and floors: fixed bodies made from a segment."""

from typing import Any

import numpy as np

from flocsim.body import Body, read_position
from flocsim.errors import UsageError
from flocsim.fields import in_unit
from flocsim.geometry.shapes.wall import wall_between

THIN = 1e-3
"""Half the thickness of a wall whose own is not given, in lengths."""


def wall(start: Any, end: Any, radius: float | str | None = None) -> Body:
    """A fixed Body: the segment between two points [m], swept by a disk of a ``radius`` [m].

    UsageError where the points are the same.
    """
    ends = np.array([read_position(start), read_position(end)])
    length = float(np.hypot(*(ends[1] - ends[0])))
    if length == 0.0:
        raise UsageError(f"a wall leads from one point to another, found {ends[0].tolist()} twice")
    thickness = THIN * length if radius is None else float(in_unit(radius, "m", "radius"))
    middle = ends.mean(axis=0)
    shape = wall_between(ends[0] - middle, ends[1] - middle, thickness)
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
