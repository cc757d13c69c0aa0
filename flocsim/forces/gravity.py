"""Weight."""

import attrs

from flocsim.constants import STANDARD_GRAVITY
from flocsim.fields import quantity
from flocsim.forces.base import BodyForce


@attrs.frozen
class Gravity(BodyForce):
    """Weight F = m g towards −y, times (1 − ρ_f/ρ) with the fluid's buoyancy on.

    Parameters: ``g`` [m/s²].  Source: Tang et al. (2014), eq. 3; the paper has no buoyancy.
    """

    g: float = quantity("m/s^2", at_least=0.0, default=STANDARD_GRAVITY)

    @property
    def absent(self) -> str:
        return "g is zero" if self.g == 0.0 else ""

    @staticmethod
    def kernel(body, g):
        """(0, −m_b g, 0), m_b the mass less the displaced fluid's where buoyancy is on."""
        return 0.0, -body.buoyant_mass * g, 0.0
