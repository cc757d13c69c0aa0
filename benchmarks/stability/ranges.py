"""The ranges of the stability table, and numbers drawn over them that remember where they fell."""

import attrs
import numpy as np

RANGES = {
    "tolerance": (1e-13, 1e-4),
    "stiffness k_n": (1e-3, 1e6),
    "impact depth": (1e-8, 1.0),
    "start overlap": (1e-2, 0.7),
    "size ratio": (1.0, 1e3),
    "smaller radius": (1e-7, 2e-5),
    "density excess": (1e-4, 19.0),
    "viscosity": (1e-6, 1e2),
    "hamaker": (1e-22, 1e-16),
    "debye length": (1e-10, 1e-5),
    "d_min": (1e-10, 1e-8),
    "vertices": (3.0, 512.0),
    "spin": (1e-2, 1e6),
    "duration": (1e-4, 1e7),
    "start gap": (1e-11, 1e-5),
}
"""{name: (least, largest)}, all drawn evenly in the logarithm. SI units; the tolerance is relative
to the smaller radius, the density excess is ρ/ρ_f − 1, impact depth and start overlap are shares
of r_i + r_j, the duration is in seconds."""

WATER_DENSITY = 997.0
FASTEST = 100.0
"""No body approaches faster than this [m/s]."""


@attrs.define
class Draw:
    """Random numbers of one case; ``places`` {name: 0…1} says where in their ranges they fell."""

    rng: np.random.Generator
    places: dict = attrs.Factory(dict)

    def log(self, name, least=None, largest=None):
        """A number of the named range, or of a part of it."""
        low, high = np.log(RANGES[name])
        start = low if least is None else np.log(least)
        end = high if largest is None else np.log(largest)
        value = start + (end - start) * self.rng.random()
        self.places[name] = float((value - low) / (high - low))
        return float(np.exp(value))

    def pick(self, *options):
        """One of the options."""
        return options[self.rng.integers(len(options))]

    def uniform(self, least, largest):
        """A number between the two."""
        return float(self.rng.uniform(least, largest))

    def angle(self):
        """A direction [rad]."""
        return self.uniform(0.0, 2.0 * np.pi)

    def density(self):
        """A density in water [kg/m³]."""
        return WATER_DENSITY * (1.0 + self.log("density excess"))

    def vertices(self, most=512):
        """A number of vertices from 3."""
        return round(self.log("vertices", 3.0, most))

    def radii(self, ratio=None):
        """(smaller, larger) radius [m]."""
        small = self.log("smaller radius")
        return small, small * self.log("size ratio", 1.0, ratio)

    def tolerance(self, radius, least=None):
        """An absolute tolerance [m], relative to a radius."""
        return radius * self.log("tolerance", least)
