"""A shape of one's own: a dumbbell, two round lobes joined by a neck."""

import attrs
import numpy as np

from flocsim import Shape
from flocsim.errors import ShapeError
from flocsim.fields import quantity


@attrs.frozen
class Dumbbell(Shape):
    """Two lobes, ``length`` [m] between their centres, on a straight neck.

    Parameters: ``lobe`` and ``neck`` [m], the radius of a lobe and half the width of the neck,
    both of the outline; ``radius`` [m] < ``neck``, the spheroradius.
    """

    length: float = quantity("m", above=0.0)
    lobe: float = quantity("m", above=0.0)
    neck: float = quantity("m", above=0.0)
    radius: float = quantity("m", above=0.0)

    def __attrs_post_init__(self):
        if not self.radius < self.neck < self.lobe < 0.5 * self.length:
            raise ShapeError("a dumbbell needs radius < neck < lobe < length/2")

    @property
    def core(self):
        """Core points (32, 2) [m]: all that a shape has to give beside its radius."""
        lobe, neck = self.lobe - self.radius, self.neck - self.radius
        opening = np.arcsin(neck / lobe)
        turn = np.linspace(opening, 2.0 * np.pi - opening, 16)
        left = lobe * np.column_stack([np.cos(turn), np.sin(turn)]) - (0.5 * self.length, 0.0)
        return np.concatenate([left, -left])
