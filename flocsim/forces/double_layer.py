"""Electric double-layer repulsion."""

import math

import attrs

from flocsim.constants import NEGLIGIBLE_FORCE, VACUUM_PERMITTIVITY, WATER_PERMITTIVITY
from flocsim.fields import choice, quantity
from flocsim.forces.base import PairForce
from flocsim.forces.van_der_waals import CUT_HELP, GAPS, cut_at


@attrs.frozen
class DoubleLayer(PairForce):
    """Repulsion F = 4π ε0 ε_r κ φ² r* exp(−κ d), r* = r_i r_j/(r_i + r_j).

    Parameters: ``potential`` φ [V]; ``debye_length`` 1/κ [m]; ``permittivity`` ε_r [-]; ``gap`` and
    ``cut`` as for VanDerWaals. Bodies in contact count as d = 0.  Source: Tang et al. (2014), eq.
    6, whose minus sign means "against attraction".
    """

    potential: float = quantity("V", default=15e-3)
    debye_length: float = quantity("m", above=0.0, default=0.98e-6)
    permittivity: float = quantity("", above=0.0, default=WATER_PERMITTIVITY)
    gap: str = choice(*GAPS, default="equivalent_spheres")
    cut: float | None = quantity("m", above=0.0, default=None, help=CUT_HELP)

    @property
    def acts_on(self) -> str:
        return GAPS[self.gap]

    @property
    def kappa(self) -> float:
        """κ [1/m], the reciprocal Debye length."""
        return 1.0 / self.debye_length

    @property
    def strength(self) -> float:
        """4π ε0 ε_r κ φ² [N/m]: the repulsion at contact for unit reduced radius."""
        charge = 4.0 * math.pi * VACUUM_PERMITTIVITY * self.permittivity
        return charge * self.potential**2 / self.debye_length

    @property
    def reach(self) -> float:
        """The gap at which the repulsion has become negligible, or ``cut`` [m]."""
        return cut_at(self.cut, -math.log(NEGLIGIBLE_FORCE) * self.debye_length)

    @property
    def absent(self) -> str:
        return "potential is zero" if self.potential == 0.0 else ""

    @staticmethod
    def kernel(pair, strength, kappa):
        """F = strength r* exp(−κ d) [N]."""
        return strength * pair.reduced_radius * math.exp(-kappa * max(pair.gap, 0.0))

    @staticmethod
    def slope(pair, strength, kappa):
        """−κ F [N/m], none in contact."""
        if pair.gap <= 0.0:
            return 0.0
        return -kappa * strength * pair.reduced_radius * math.exp(-kappa * pair.gap)
