"""What acts between bodies in water with a salt (DLVO): van der Waals attraction, double layers."""

import math
from collections.abc import Callable, Iterable

import attrs

from flocsim.body import Fluid
from flocsim.constants import (
    MINIMUM_GAP,
    NEGLIGIBLE_FORCE,
    VACUUM_PERMITTIVITY,
    WATER_PERMITTIVITY,
)
from flocsim.errors import RangeError, UsageError
from flocsim.fields import choice, quantity, quantity_of_each, word_or_quantity
from flocsim.forces.base import Force, PairForce

GAPS = {"equivalent_spheres": "centres", "surface": "surfaces"}
"""What the gap d is: between equivalent spheres (the paper), or between the outlines."""

CUT_HELP = (
    "gap beyond which the force is left out, where that is to be nearer than it is negligible"
)


RETARDATION = 5.32
"""Of 1 + 5.32 d/λ, by which Gregory (1981, J. Colloid Interface Sci. 83, 138) divides."""


def depth_share(x):
    """What a depth W leaves of the pressure between plates a gap d apart, x = d/W: within 1e-4 up
    to x = .1, 2 % at 1. Exactly it is the mean of (2/π) atan(W/ρ) over ρ⁻⁵ on a plate."""
    if x < 0.02:
        return 1.0 - 0.75 * x  # the cubic term is below 4e-6
    return 2.0 / math.pi * math.atan(8.0 / (3.0 * math.pi * x))


def cut_at(cut: float | None, reach: float) -> float:
    """A reach [m], or a cut that is nearer."""
    return reach if cut is None else min(cut, reach)


LAW_HELP = (
    "spheres: as strong as between the equivalent spheres, over the gap of `gap`; outline: the sum "
    "over both bodies as they are (pairs that settle)"
)

DEPTH_HELP = 'thickness of the bodies of law = "outline"; "sphere" = 4/3 r_eq of the smaller one'


@attrs.frozen
class VanDerWaals(PairForce):
    """Attraction F = H_A r*/(6 d²), r* = r_i r_j/(r_i + r_j), constant below d = d_min.

    Parameters: ``hamaker`` H_A [J]; ``d_min`` [m], below which the diverging law is cut off;
    ``gap``: d = d_c − r_i − r_j ("equivalent_spheres", along the line of centres) or the distance
    of the outlines ("surface", at all nearly closest points); ``cut`` [m], the gap beyond which the
    force is left out even if it is not negligible there.  Source: Tang et al. (2014), eq. 5.

    ``law = "outline"``: the sum of −C/r⁶ over both bodies, H_A = π² C, along their ``depth`` [m]
    ("sphere": 4/3 r_eq of the smaller); outlines nearer than d_min count as d_min apart.
    ``wavelength`` λ [m] of the retardation, which divides the energy of plates by 1 + 5.32 d/λ;
    no retardation unless given.  Source: Hamaker (1937); Gregory (1981).
    """

    hamaker: float = quantity("J", at_least=0.0, default=1e-18)
    d_min: float = quantity("m", above=0.0, default=MINIMUM_GAP)
    gap: str = choice(*GAPS, default="equivalent_spheres")
    cut: float | None = quantity("m", above=0.0, default=None, help=CUT_HELP)
    law: str = choice("spheres", "outline", default="spheres", help=LAW_HELP)
    depth: float | str = word_or_quantity(
        "sphere", "m", above=0.0, default="sphere", help=DEPTH_HELP
    )
    wavelength: float | None = quantity(
        "m", above=0.0, default=None, help='λ of the retardation of law = "outline"; none without'
    )

    @property
    def acts_on(self) -> str:
        return "outlines" if self.law == "outline" else GAPS[self.gap]

    @property
    def reach(self) -> float:
        """The gap at which the attraction has become negligible, or ``cut`` [m]: of outlines that
        of plates, of spheres that of spheres."""
        power = 1.0 / 3.0 if self.law == "outline" else 0.5
        return cut_at(self.cut, self.d_min / NEGLIGIBLE_FORCE**power)

    @property
    def absent(self) -> str:
        return "hamaker is zero" if self.hamaker == 0.0 else ""

    @property
    def retarded(self) -> float:
        """5.32/λ [1/m], 0 without retardation."""
        return 0.0 if self.wavelength is None else RETARDATION / self.wavelength

    def kernel_in(self, fluid: Fluid) -> Callable:
        return VanDerWaals.pressure if self.law == "outline" else self.kernel

    @staticmethod
    def pressure(point, hamaker, retarded):
        """−H_A/(6π d³) (1 + 3x/2)/(1 + x)² q [Pa], d = ``point.plate_gap``, x = 5.32 d/λ, and q
        what a depth W leaves of plates ``point.depth_gap`` apart."""
        d = point.plate_gap
        x = retarded * d
        share = (1.0 + 1.5 * x) / ((1.0 + x) * (1.0 + x))
        return (
            -hamaker
            / (6.0 * math.pi * d * d * d)
            * share
            * depth_share(point.depth_gap / point.depth)
        )

    @staticmethod
    def kernel(pair, hamaker, d_min):
        """−H_A r*/(6 d²) [N]."""
        d = max(pair.gap, d_min)
        return -hamaker * pair.reduced_radius / (6.0 * d * d)

    @staticmethod
    def slope(pair, hamaker, d_min):
        """H_A r*/(3 d³) [N/m], none below the cut-off."""
        if pair.gap <= d_min:
            return 0.0
        return hamaker * pair.reduced_radius / (3.0 * pair.gap**3)


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
    """A double layer less what superposition makes of it, which is between charges."""

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
