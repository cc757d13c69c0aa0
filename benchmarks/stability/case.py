"""What a case of the stability table is, what it is drawn from, what a reference says of it."""

from collections.abc import Callable

import attrs
import numpy as np

from flocsim import System
from flocsim.body import Fluid
from flocsim.integrators import Implicit

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


STEP_BUDGET = 20_000
"""Steps after which a run must end."""

ROUND_OFF = 1e3 * np.finfo(float).eps
"""What sums of floats may lose, as a share of the largest place or path."""


class ReferenceGaveUpError(Exception):
    """The reference has no answer within its budget; the invariants alone decide."""


@attrs.frozen
class Answer:
    """What a reference says of the end of a run.

    ``position`` (n, 3); ``uncertainty`` [m] of the reference itself; ``amplification``, by how much
    a change of the start has grown at the end; ``span`` [m], the largest coordinate or path, for
    round-off; ``deepest``, the greatest overlap on the way as a share of r_i + r_j.
    """

    position: np.ndarray
    uncertainty: float = 0.0
    amplification: float = 1.0
    span: float = 0.0
    deepest: float = 0.0


@attrs.frozen(eq=False)
class Case:
    """Bodies, forces and a fluid to run to a time [s] at a tolerance [m].

    ``answer`` computes the reference's Answer, or is None where invariants alone decide;
    ``refused``: whether the start overlaps too deeply and must be refused.
    """

    bodies: list
    forces: list
    tolerance: float
    until: float
    answer: Callable | None = None
    fluid: Fluid = attrs.field(factory=Fluid)
    refused: bool = False
    conserves: bool = False

    def system(self, integrator=None, bodies=None):
        """The System of the case, by default with the method under test."""
        method = integrator or Implicit(tolerance=self.tolerance)
        return System(bodies or self.bodies, self.forces, method, self.fluid)

    def run(self, integrator=None, bodies=None, max_steps=STEP_BUDGET, record=True):
        """The Trajectory of the case."""
        return self.system(integrator, bodies).run(self.until, max_steps=max_steps, record=record)


def moved_by(bodies, shift):
    """(n,) shifts [m] of the bodies' places and turned outlines from (n, 3) changes."""
    arms = [body.shape.bounding_radius for body in bodies]
    return np.maximum(np.hypot(shift[:, 0], shift[:, 1]), np.abs(shift[:, 2]) * arms)


def distance_of(bodies, position, other):
    """The largest distance [m] by which an outline point of two end positions (n, 3) differs."""
    return float(moved_by(bodies, np.asarray(position) - np.asarray(other)).max())
