"""A shape of one's own: a rod, of which flocsim knows no more than its two core points."""

import attrs
import numpy as np

from flocsim.fields import quantity
from flocsim.geometry.shapes.shape import Shape


@attrs.frozen(eq=False)
class Rod(Shape):
    """A segment swept by a disk. In an ensemble only length/radius counts: it is scaled to size.

    Parameters: ``length`` L [m] of the segment; ``radius`` r [m] of the disk.
    """

    length: float = quantity("m", above=0.0)
    radius: float = quantity("m", above=0.0)

    @property
    def vertices(self):
        """Core points (2, 2) [m] around the centroid."""
        return np.array([[-0.5 * self.length, 0.0], [0.5 * self.length, 0.0]])

    @property
    def area(self):
        """A = 2 L r + π r² [m²]: a rectangle and two half disks."""
        return 2.0 * self.length * self.radius + np.pi * self.radius**2

    @property
    def second_moment(self):
        """J = ∫ρ² dA about the centroid [m⁴]."""
        L, r = self.length, self.radius
        rectangle = L * r * (L**2 + 4.0 * r**2) / 6.0
        return rectangle + np.pi * r**2 * (L**2 / 4.0 + r**2 / 2.0) + 4.0 * L * r**3 / 3.0

    def scaled(self, factor):
        """The same rod, ``factor`` times as large."""
        return Rod(self.length * factor, self.radius * factor)
