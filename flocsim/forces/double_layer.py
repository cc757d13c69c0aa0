"""Electric double-layer repulsion."""

import math
from collections.abc import Callable, Iterable

import attrs

from flocsim.body import Fluid
from flocsim.constants import NEGLIGIBLE_FORCE, VACUUM_PERMITTIVITY, WATER_PERMITTIVITY
from flocsim.errors import RangeError, UsageError
from flocsim.fields import choice, quantity, quantity_of_each, word_or_quantity
from flocsim.forces.base import Force, PairForce
from flocsim.forces.van_der_waals import CUT_HELP, DEPTH_HELP, GAPS, LAW_HELP, cut_at

BOUNDARY_HELP = (
    'what bodies keep as they come near, of law = "outline": their potentials, their charges, or '
    "neither (the sum of what each has alone)"
)


@attrs.frozen
class DoubleLayer(PairForce):
    """Repulsion F = 4π ε0 ε_r κ φ_i φ_j r* exp(−κ d), r* = r_i r_j/(r_i + r_j).

    Parameters: ``potential`` φ [V], of both bodies, or of each where they are unlike (of opposite
    signs they attract each other); ``debye_length`` 1/κ [m]; ``permittivity`` ε_r [-]; ``gap`` and
    ``cut`` as for VanDerWaals. Bodies in contact count as d = 0.  Source: Tang et al. (2014), eq.
    6, whose minus sign means "against attraction".

    ``law = "outline"``: by linear superposition of what each outline has alone at its potential,
    plates having 2ε κ φ_i φ_j exp(−κ d), along the ``depth`` of the bodies as of VanDerWaals.
    ``boundary``: "superposition", or "potential" and "charge", which bodies keep as they come near;
    plates then have ε κ φ² (1 − tanh(κ d/2)) and ε κ φ² (coth(κ d/2) − 1), and other outlines, to
    what superposition has, the pressure by which these differ, gap by gap. Where that has no bound,
    d is ``d_min`` [m] at least.  Source: Hogg, Healy and Fuerstenau (1966), Trans. Faraday Soc. 62,
    1638; Wiese and Healy (1970), ibid. 66, 490.
    """

    potential: float | tuple[float, float] = quantity_of_each(
        "V", default=15e-3, help="of both bodies; or of each, as [15e-3, -40e-3]"
    )
    debye_length: float = quantity("m", above=0.0, default=0.98e-6)
    permittivity: float = quantity("", above=0.0, default=WATER_PERMITTIVITY)
    gap: str = choice(*GAPS, default="equivalent_spheres")
    cut: float | None = quantity("m", above=0.0, default=None, help=CUT_HELP)
    law: str = choice("spheres", "outline", default="spheres", help=LAW_HELP)
    boundary: str = choice(
        "superposition", "potential", "charge", default="superposition", help=BOUNDARY_HELP
    )
    depth: float | str = word_or_quantity(
        "sphere", "m", above=0.0, default="sphere", help=DEPTH_HELP
    )
    d_min: float | None = quantity(
        "m", above=0.0, default=None, help="least gap of a `boundary` whose pressure has no bound"
    )

    def __attrs_post_init__(self) -> None:
        if self.boundary != "superposition" and self.law != "outline":
            raise RangeError(
                f'boundary = "{self.boundary}" is of law = "outline", found law = "{self.law}": '
                "give that, or leave boundary out"
            )
        if self.unbounded != 0.0 and self.d_min is None:
            like = "" if self.boundary == "charge" else " between unlike potentials"
            raise RangeError(
                f'boundary = "{self.boundary}"{like} has a pressure without bound where outlines '
                "touch: give d_min, the least gap that counts, as 0.3 nm"
            )

    @property
    def acts_on(self) -> str:
        return "outlines" if self.law == "outline" else GAPS[self.gap]

    @property
    def kappa(self) -> float:
        """κ [1/m], the reciprocal Debye length."""
        return 1.0 / self.debye_length

    @property
    def potentials(self) -> tuple[float, float]:
        """Of either body [V]."""
        given = self.potential
        return given if isinstance(given, tuple) else (given, given)

    @property
    def strength(self) -> float:
        """4π ε0 ε_r κ φ_i φ_j [N/m]: the repulsion at contact for unit reduced radius."""
        return 2.0 * self.between_charges / self.debye_length

    @property
    def between_charges(self) -> float:
        """2π ε0 ε_r φ_i φ_j [N]."""
        one, other = self.potentials
        return 2.0 * math.pi * VACUUM_PERMITTIVITY * self.permittivity * one * other

    @property
    def first(self) -> float:
        """2ε κ² φ_i φ_j [Pa], the pressure of plates at touch by superposition."""
        return self.between_charges * self.kappa**2 / math.pi

    @property
    def parts(self) -> tuple[float, float, float]:
        """Factors [Pa] of exp(−κd), 1/(2 cosh²(κd/2)) and 1/(2 sinh²(κd/2)) in the pressure."""
        if self.boundary == "superposition":
            return self.first, 0.0, 0.0
        one, other = self.potentials
        unit = VACUUM_PERMITTIVITY * self.permittivity * self.kappa**2
        mean, rest = unit * (0.5 * (one + other)) ** 2, unit * (0.5 * (one - other)) ** 2
        return (0.0, mean, -rest) if self.boundary == "potential" else (0.0, -rest, mean)

    @property
    def unbounded(self) -> float:
        """That of 1/(2 sinh²(κd/2)), which grows without bound towards d = 0 [Pa]."""
        return self.parts[2]

    @property
    def closest(self) -> float:
        """The least gap that counts [m]."""
        return self.d_min or 0.0

    @property
    def reach(self) -> float:
        """The gap at which the repulsion has become negligible, or ``cut`` [m]."""
        return cut_at(self.cut, -math.log(NEGLIGIBLE_FORCE) * self.debye_length)

    @property
    def absent(self) -> str:
        return "" if any(self.parts) else "potential is zero"

    def kernel_in(self, fluid: Fluid) -> Callable:
        return DoubleLayer.pressure if self.law == "outline" else self.kernel

    def without_charges(self) -> "DoubleLayer":
        """What is a pressure of it where superposition is between charges (forces/outline.py)."""
        return BesideCharges(**attrs.asdict(self, recurse=False))

    @staticmethod
    def pressure(point, parts, kappa, closest):
        """Of plates [Pa], in powers of exp(−κd), which do not overflow."""
        first, even, odd = parts
        x = kappa * max(point.parted_gap, closest)
        fall = math.exp(-x)
        total = first * fall + 2.0 * even * fall / (1.0 + fall) ** 2
        if odd != 0.0:
            total += 2.0 * odd * fall / math.expm1(-x) ** 2
        return total

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


@attrs.frozen
class BesideCharges(DoubleLayer):
    """A double layer less what superposition makes of it."""

    @property
    def parts(self) -> tuple[float, float, float]:
        _, even, odd = super().parts
        return -self.first, even, odd


def unlike(force: Force) -> bool:
    """Whether a force is one of two bodies of different potentials."""
    return isinstance(force, DoubleLayer) and isinstance(force.potential, tuple)


def refuse_unlike(forces: Iterable[Force], bodies: int) -> None:
    """UsageError for potentials of two bodies among more of them."""
    if bodies > 2 and any(map(unlike, forces)):
        raise UsageError(
            f"potential = [a, b] is of two unlike bodies, found {bodies} bodies: give one number"
        )
