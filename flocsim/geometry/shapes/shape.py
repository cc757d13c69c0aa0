"""Shape: what every body outline has, core points swept by a disk."""

from abc import ABC, abstractmethod

import numpy as np

from flocsim.geometry.shapes.outline import swept_rings


class Shape(ABC):
    """Core points (N, 2) [m] around the centroid, swept by a disk of ``radius`` [m].

    All shapes are one family: a sphere is one core point. Shapes are frozen; the centroid of the
    swept area is the origin of the shape's frame.
    """

    vertices: np.ndarray
    radius: float

    @property
    @abstractmethod
    def area(self):
        """Area A of the swept outline [m²]."""

    @property
    @abstractmethod
    def second_moment(self):
        """Second moment of area J = ∫ρ² dA about the centroid [m⁴]."""

    @abstractmethod
    def scaled(self, factor):
        """The same shape, ``factor`` times as large."""

    @property
    def equivalent_radius(self):
        """r_eq = √(A/π) [m]."""
        return float(np.sqrt(self.area / np.pi))

    @property
    def bounding_radius(self):
        """R, the largest distance from the centroid to the outline [m]."""
        return float(np.hypot(*self.vertices.T).max() + self.radius)

    def placed_vertices(self, x=0.0, y=0.0, angle=0.0):
        """Core points (N, 2) [m] of the body at (x, y), turned by ``angle`` [rad]."""
        c, s = np.cos(angle), np.sin(angle)
        return self.vertices @ np.array([[c, s], [-s, c]]) + (x, y)

    def outline(self, x=0.0, y=0.0, angle=0.0, points_per_quadrant=16):
        """Closed rings [(k, 2), …] of the placed outline, for drawing; the outer one first."""
        return swept_rings(self.placed_vertices(x, y, angle), self.radius, points_per_quadrant)
