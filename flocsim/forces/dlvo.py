"""DLVO forces between bodies in salt water: van der Waals attraction and double-layer repulsion.

Two formulations of each: between equivalent spheres or at nearest surface points (Derjaguin's
approximation, Tang et al. 2014, eqs 5 and 6), and integrated along both outlines (``law =
"outline"``), where the kernel is the pressure between parallel plates.
"""

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
"""{key ``gap``: where the force acts}: between equivalent spheres (the paper), or between outlines.
"""

CUT_HELP = "gap beyond which the force is neglected; by default, where it is negligible anyway"


RETARDATION = 5.32
"""Coefficient of d/λ in the retardation factor 1/(1 + 5.32 d/λ), Gregory (1981), J. Colloid
Interface Sci. 83, 138."""


def depth_factor(x):
    """Return the fraction of the plate pressure at gap d that bodies of finite depth W retain, x =
    d/W.

    The exact fraction is the mean of (2/π) atan(W/ρ) weighted by ρ⁻⁵ over a plate. This closed form
    is within 1e-4 up to x = 0.1 and within 2 % at x = 1.
    """
    # Taylor series: its first omitted term, cubic in x, is below 4e-6 here.
    if x < 0.02:
        return 1.0 - 0.75 * x  # the cubic term is below 4e-6
    return 2.0 / math.pi * math.atan(8.0 / (3.0 * math.pi * x))


def smaller_reach(cut: float | None, reach: float) -> float:
    """Return the smaller of a reach and an optional cut-off gap [m]."""
    return reach if cut is None else min(cut, reach)


LAW_HELP = (
    "spheres: the force of the equivalent spheres at the distance that `gap` states; outline: the "
    "sum over both outlines (settling pairs only)"
)

DEPTH_HELP = 'law = "outline": thickness of the bodies; "sphere" = 4/3 r_eq of the smaller one'


@attrs.frozen
class VanDerWaals(PairForce):
    """Van der Waals attraction F = H_A r*/(6 d²), r* = r_i r_j/(r_i + r_j), constant below d =
    d_min.

    Parameters
    ----------
    hamaker : float
        Hamaker constant H_A [J].
    d_min : float
        Gap [m] below which the diverging law is held constant.
    gap : "equivalent_spheres" or "surface"
        Meaning of d: d_c − r_i − r_j, along the line of centres; or the smooth gap of the outlines.
    cut : float, optional
        Gap [m] beyond which the force is left out even if it is not yet negligible.
    law : "spheres" or "outline"
        "outline" integrates −C/r⁶, H_A = π² C, over both bodies; outlines nearer than d_min count
        as d_min apart.
    depth : float or "sphere"
        Extent of the bodies in the third direction [m]; "sphere": 4/3 r_eq of the smaller body.
    wavelength : float, optional
        λ [m] of the retardation, which divides the plate energy by 1 + 5.32 d/λ; none by default.

    Notes
    -----
    Sources: Tang et al. (2014), eq. 5; Hamaker (1937); Gregory (1981).
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
        "m", above=0.0, default=None, help='law = "outline": wavelength λ of the retardation'
    )

    @property
    def acts_on(self) -> str:
        return "outlines" if self.law == "outline" else GAPS[self.gap]

    @property
    def reach(self) -> float:
        """Gap [m] at which the attraction becomes negligible, or ``cut`` if that is smaller.

        Plates (law "outline") decay as d⁻³, spheres as d⁻². What is left out beyond a gap does not
        depend on d_min, so that one below MINIMUM_GAP does not shorten the reach.
        """
        # (d/d_min)^−n equals NEGLIGIBLE_FORCE, n = 3 for plates and 2 for spheres.
        power = 1.0 / 3.0 if self.law == "outline" else 0.5
        return smaller_reach(self.cut, max(self.d_min, MINIMUM_GAP) / NEGLIGIBLE_FORCE**power)

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
        """Return the pressure −H_A/(6π d³) (1 + 3x/2)/(1 + x)² q [Pa] between plates.

        d = ``point.plate_gap``, x = 5.32 d/λ; q is the fraction left by the finite depth
        (depth_factor).
        """
        d = point.plate_gap
        x = retarded * d
        # Minus the derivative of the retarded energy −H_A/(12π d²)/(1 + x).
        share = (1.0 + 1.5 * x) / ((1.0 + x) * (1.0 + x))
        return (
            -hamaker
            / (6.0 * math.pi * d * d * d)
            * share
            * depth_factor(point.depth_gap / point.depth)
        )

    @staticmethod
    def kernel(pair, hamaker, d_min):
        """Return the force −H_A r*/(6 d²) [N]."""
        # Tang et al. (2014), eq. 5: constant below d_min, as it diverges at d = 0.
        d = max(pair.gap, d_min)
        return -hamaker * pair.reduced_radius / (6.0 * d * d)

    @staticmethod
    def slope(pair, hamaker, d_min):
        """Return its derivative H_A r*/(3 d³) [N/m], 0 below d_min."""
        if pair.gap <= d_min:
            return 0.0
        return hamaker * pair.reduced_radius / (3.0 * pair.gap**3)


BOUNDARY_HELP = (
    'law = "outline": whether surfaces have a constant potential, a constant charge, or '
    "superposed double layers as they approach"
)


@attrs.frozen
class DoubleLayer(PairForce):
    """Double-layer repulsion F = 4π ε0 ε_r κ φ_i φ_j r* exp(−κ d), r* = r_i r_j/(r_i + r_j).

    Parameters
    ----------
    potential : float or (float, float)
        Surface potential φ [V] of both bodies, or of each; opposite signs attract.
    debye_length : float
        1/κ [m].
    permittivity : float
        ε_r [-].
    gap, cut, depth : see VanDerWaals
        Bodies in contact count as d = 0.
    law : "spheres" or "outline"
        "outline" superposes the double layers of both outlines; plates then repel with the pressure
        2ε κ² φ_i φ_j exp(−κ d).
    boundary : "superposition", "potential" or "charge"
        Quantity that surfaces keep constant as they approach (law "outline").
    d_min : float, optional
        Least gap [m] for a boundary condition whose pressure diverges at d = 0.

    Raises
    ------
    RangeError
        If ``boundary`` is given with another law than "outline", or lacks a needed ``d_min``.

    Notes
    -----
    At constant equal potentials plates have the energy ε κ φ² (1 − tanh(κ d/2)), at constant
    charges ε κ φ² (coth(κ d/2) − 1). For other outlines the difference between these pressures and
    that of superposition is added, gap by gap.

    Sources: Tang et al. (2014), eq. 6, whose minus sign means "against attraction"; Hogg, Healy and
    Fuerstenau (1966), Trans. Faraday Soc. 62, 1638; Wiese and Healy (1970), ibid. 66, 490.
    """

    potential: float | tuple[float, float] = quantity_of_each(
        "V", default=15e-3, help="of the surfaces of both bodies; or of each, as [15e-3, -40e-3]"
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
        "m", above=0.0, default=None, help="smallest gap used by a `boundary` that diverges at 0"
    )

    def __attrs_post_init__(self) -> None:
        if self.boundary != "superposition" and self.law != "outline":
            raise RangeError(
                f'boundary = "{self.boundary}" needs law = "outline", found law = "{self.law}": '
                "set that law, or leave boundary out"
            )
        # Its last part, of 1/sinh², diverges at d = 0: a least gap must be chosen by the user.
        if self.parts[2] != 0.0 and self.d_min is None:
            like = "" if self.boundary == "charge" else " between unlike potentials"
            raise RangeError(
                f'boundary = "{self.boundary}"{like} has an infinite pressure at contact: give '
                'd_min, the smallest gap to use, such as "0.3 nm"'
            )

    @property
    def acts_on(self) -> str:
        return "outlines" if self.law == "outline" else GAPS[self.gap]

    @property
    def kappa(self) -> float:
        """Inverse Debye length κ [1/m]."""
        return 1.0 / self.debye_length

    @property
    def potentials(self) -> tuple[float, float]:
        """Surface potential of each body [V]."""
        given = self.potential
        return given if isinstance(given, tuple) else (given, given)

    @property
    def strength(self) -> float:
        """4π ε0 ε_r κ φ_i φ_j [N/m]: the repulsion at contact per unit of reduced radius."""
        # Tang et al. (2014), eq. 6, with φ_i φ_j in the place of φ².
        return 2.0 * self.between_charges / self.debye_length

    @property
    def between_charges(self) -> float:
        """2π ε0 ε_r φ_i φ_j [N], the factor of the energy between outline charges."""
        one, other = self.potentials
        return 2.0 * math.pi * VACUUM_PERMITTIVITY * self.permittivity * one * other

    @property
    def first(self) -> float:
        """2ε κ² φ_i φ_j [Pa], the pressure of plates at d = 0 by superposition."""
        return self.between_charges * self.kappa**2 / math.pi

    @property
    def parts(self) -> tuple[float, float, float]:
        """Coefficients [Pa] of exp(−κd), 1/(2 cosh²(κd/2)) and 1/(2 sinh²(κd/2)) in the plate
        pressure."""
        if self.boundary == "superposition":
            return self.first, 0.0, 0.0
        one, other = self.potentials
        unit = VACUUM_PERMITTIVITY * self.permittivity * self.kappa**2
        # Unlike surfaces are the sum of a symmetric and an antisymmetric pair, with the strengths
        # ¼(φ_i + φ_j)² and ¼(φ_i − φ_j)² (Hogg et al. 1966; Wiese and Healy 1970). The boundary
        # condition decides which of the two diverges at d = 0.
        mean, rest = unit * (0.5 * (one + other)) ** 2, unit * (0.5 * (one - other)) ** 2
        return (0.0, mean, -rest) if self.boundary == "potential" else (0.0, -rest, mean)

    @property
    def closest(self) -> float:
        """Least gap used in the pressure [m]."""
        return self.d_min or 0.0

    @property
    def reach(self) -> float:
        """Gap [m] at which the repulsion becomes negligible, or ``cut`` if that is smaller."""
        # exp(−κ d) equals NEGLIGIBLE_FORCE.
        return smaller_reach(self.cut, -math.log(NEGLIGIBLE_FORCE) * self.debye_length)

    @property
    def absent(self) -> str:
        return "" if any(self.parts) else "potential is zero"

    def kernel_in(self, fluid: Fluid) -> Callable:
        return DoubleLayer.pressure if self.law == "outline" else self.kernel

    @staticmethod
    def pressure(point, parts, kappa, closest):
        """Return the pressure of plates [Pa]."""
        first, even, odd = parts
        # cosh and sinh are written in powers of exp(−κd), which cannot overflow at large gaps.
        x = kappa * max(point.parted_gap, closest)
        fall = math.exp(-x)
        total = first * fall + 2.0 * even * fall / (1.0 + fall) ** 2
        if odd != 0.0:
            total += 2.0 * odd * fall / math.expm1(-x) ** 2
        return total

    @staticmethod
    def kernel(pair, strength, kappa):
        """Return the force strength · r* · exp(−κ d) [N]."""
        # Equivalent spheres of irregular flocs overlap at contact: they count as touching.
        return strength * pair.reduced_radius * math.exp(-kappa * max(pair.gap, 0.0))

    @staticmethod
    def slope(pair, strength, kappa):
        """Return its derivative −κ F [N/m], 0 in contact."""
        if pair.gap <= 0.0:
            return 0.0
        return -kappa * strength * pair.reduced_radius * math.exp(-kappa * pair.gap)


@attrs.frozen
class BoundaryCorrection(DoubleLayer):
    """The pressure that a boundary condition adds to superposition.

    Superposition itself is then computed from outline charges (geometry/contact/charges.py).
    """

    @property
    def parts(self) -> tuple[float, float, float]:
        _, even, odd = super().parts
        # The charges contain superposition already: subtract its pressure from the full one.
        return -self.first, even, odd


def has_unlike_potentials(force: Force) -> bool:
    """Return True if a force has different potentials on its two bodies."""
    return isinstance(force, DoubleLayer) and isinstance(force.potential, tuple)


def refuse_unlike_potentials(forces: Iterable[Force], bodies: int) -> None:
    """Raise UsageError for two different potentials in a scene of more than two bodies."""
    if bodies > 2 and any(map(has_unlike_potentials, forces)):
        raise UsageError(
            f"potential = [a, b] is for two bodies, found {bodies} bodies: give one number"
        )
