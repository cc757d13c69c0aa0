"""Sphere: one core point and a radius."""

import attrs
import numpy as np

from flocsim.errors import ShapeError
from flocsim.fields import is_number
from flocsim.geometry.shapes.shape import Shape


def positive_radius(radius):
    """``radius`` as a float; ShapeError unless it is a finite number above 0."""
    if isinstance(radius, np.generic):
        radius = radius.item()
    if not is_number(radius) or radius <= 0.0:
        raise ShapeError(f"the radius must be a finite number above 0 (metres), found {radius!r}")
    return float(radius)


@attrs.frozen(eq=False)
class Sphere(Shape):
    """A disk of ``radius`` [m] in the plane of motion, one core point at its centre."""

    radius: float = attrs.field(converter=positive_radius)

    @property
    def vertices(self):
        """The one core point (1, 2): the centre."""
        return np.zeros((1, 2))

    @property
    def area(self):
        """A = π r² [m²]."""
        return float(np.pi * self.radius**2)

    @property
    def second_moment(self):
        """J = π r⁴/2 [m⁴]."""
        return float(0.5 * np.pi * self.radius**4)

    def scaled(self, factor):
        """A sphere ``factor`` times as large."""
        return Sphere(self.radius * factor)
