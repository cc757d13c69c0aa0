"""What a case of the stability table is, and what its reference answers."""

from collections.abc import Callable

import attrs
import numpy as np

from flocsim import System
from flocsim.body import Fluid
from flocsim.integrators import Implicit

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
