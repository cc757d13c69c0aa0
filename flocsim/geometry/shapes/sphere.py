"""Sphere: one core point and a radius."""

import attrs
import numpy as np

from flocsim.geometry.shapes.shape import Shape, positive_radius


@attrs.frozen(eq=False)
class Sphere(Shape):
    """A disk of ``radius`` [m] in the plane of motion, one core point at its centre."""

    radius: float = attrs.field(converter=positive_radius)

    @property
    def core(self) -> np.ndarray:
        return np.zeros((1, 2))
