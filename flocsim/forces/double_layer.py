"""Electric double-layer repulsion."""

import math
from collections.abc import Iterable

import attrs

from flocsim.constants import NEGLIGIBLE_FORCE, VACUUM_PERMITTIVITY, WATER_PERMITTIVITY
from flocsim.errors import UsageError
from flocsim.fields import choice, quantity, quantity_of_each
from flocsim.forces.base import Force, PairForce
from flocsim.forces.van_der_waals import CUT_HELP, GAPS, cut_at


@attrs.frozen
class DoubleLayer(PairForce):
    """Repulsion F = 4π ε0 ε_r κ φ_i φ_j r* exp(−κ d), r* = r_i r_j/(r_i + r_j).

    Parameters: ``potential`` φ [V], of both bodies, or of each where they are unlike (of opposite
    signs they attract each other); ``debye_length`` 1/κ [m]; ``permittivity`` ε_r [-]; ``gap`` and
    ``cut`` as for VanDerWaals. Bodies in contact count as d = 0.  Source: Tang et al. (2014), eq.
    6, whose minus sign means "against attraction".
    """

    potential: float | tuple[float, float] = quantity_of_each(
        "V", default=15e-3, help="of both bodies; or of each, as [15e-3, -40e-3]"
    )
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
        """4π ε0 ε_r κ φ_i φ_j [N/m]: the repulsion at contact for unit reduced radius."""
        charge = 4.0 * math.pi * VACUUM_PERMITTIVITY * self.permittivity
        given = self.potential
        product = given[0] * given[1] if isinstance(given, tuple) else given**2
        return charge * product / self.debye_length

    @property
    def reach(self) -> float:
        """The gap at which the repulsion has become negligible, or ``cut`` [m]."""
        return cut_at(self.cut, -math.log(NEGLIGIBLE_FORCE) * self.debye_length)

    @property
    def absent(self) -> str:
        return "potential is zero" if self.strength == 0.0 else ""

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


def unlike(force: Force) -> bool:
    """Whether a force is one of two bodies of different potentials."""
    return isinstance(force, DoubleLayer) and isinstance(force.potential, tuple)


def refuse_unlike(forces: Iterable[Force], bodies: int) -> None:
    """UsageError for potentials of two bodies among more of them."""
    if bodies > 2 and any(map(unlike, forces)):
        raise UsageError(
            f"potential = [a, b] is of two unlike bodies, found {bodies} bodies: give one number"
        )
