"""A repulsion that keeps outlines apart: attraction holds them in a well above the touch."""

import math

import attrs

from flocsim.fields import quantity
from flocsim.forces import SurfaceForce


@attrs.frozen
class Hydration(SurfaceForce):
    """F = 2π P r* exp(−gap/λ), a layer of water that keeps outlines apart."""

    pressure: float = quantity("N/m", above=0.0, default=3e-3)
    length: float = quantity("m", above=0.0, default=6e-10)

    @property
    def reach(self):
        return 30.0 * self.length

    @staticmethod
    def kernel(pair, pressure, length):
        layer = math.exp(-max(pair.gap, 0.0) / length)
        return 2.0 * math.pi * pressure * pair.reduced_radius * layer
