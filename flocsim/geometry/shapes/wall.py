"""WallShape: a segment swept by a disk, flat to what comes near it."""

import attrs
import numpy as np
from numpy.typing import ArrayLike

from flocsim.geometry.shapes.shape import Shape, positive_radius
from flocsim.geometry.shapes.spheropolygon import read_vertices

FLATNESS = 1e6
"""A wall counts as a sphere of so many times its length in forces between surfaces: a reduced
radius is then that of what comes near, to a millionth."""


@attrs.frozen(eq=False, slots=False)
class WallShape(Shape):
    """A segment between two points swept by a disk: half of the ``radius`` [m] is its thickness."""

    core: np.ndarray = attrs.field(converter=read_vertices, alias="vertices")
    radius: float = attrs.field(converter=positive_radius)

    @property
    def equivalent_radius(self) -> float:
        """What forces between surfaces take for its radius [m]: flat."""
        return FLATNESS * float(np.hypot(*(self.vertices[1] - self.vertices[0])))


def wall_between(start: ArrayLike, end: ArrayLike, radius: float) -> WallShape:
    """The shape of a wall; ShapeError unless the ends are two different points."""
    return WallShape(np.array([start, end]), radius)
