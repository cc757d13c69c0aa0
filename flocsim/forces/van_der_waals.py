"""Van der Waals attraction."""

import math
from collections.abc import Callable

import attrs

from flocsim.body import Fluid
from flocsim.constants import MINIMUM_GAP, NEGLIGIBLE_FORCE
from flocsim.fields import choice, quantity, word_or_quantity
from flocsim.forces.base import PairForce

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
