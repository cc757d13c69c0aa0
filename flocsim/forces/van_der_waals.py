"""Van der Waals attraction."""

import attrs

from flocsim.constants import MINIMUM_GAP, NEGLIGIBLE_FORCE
from flocsim.fields import choice, quantity
from flocsim.forces.base import PairForce

GAPS = {"equivalent_spheres": "centres", "surface": "surfaces"}
"""What the gap d is: between equivalent spheres (the paper), or between the outlines."""

CUT_HELP = (
    "gap beyond which the force is left out, where that is to be nearer than it is negligible"
)


def cut_at(cut: float | None, reach: float) -> float:
    """A reach [m], or a cut that is nearer."""
    return reach if cut is None else min(cut, reach)


@attrs.frozen
class VanDerWaals(PairForce):
    """Attraction F = H_A r*/(6 d²), r* = r_i r_j/(r_i + r_j), constant below d = d_min.

    Parameters: ``hamaker`` H_A [J]; ``d_min`` [m], below which the diverging law is cut off;
    ``gap``: d = d_c − r_i − r_j ("equivalent_spheres", along the line of centres) or the distance
    of the outlines ("surface", at all nearly closest points); ``cut`` [m], the gap beyond which the
    force is left out, where it is not negligible by then.  Source: Tang et al. (2014), eq. 5.
    """

    hamaker: float = quantity("J", at_least=0.0, default=1e-18)
    d_min: float = quantity("m", above=0.0, default=MINIMUM_GAP)
    gap: str = choice(*GAPS, default="equivalent_spheres")
    cut: float | None = quantity("m", above=0.0, default=None, help=CUT_HELP)

    @property
    def acts_on(self) -> str:
        return GAPS[self.gap]

    @property
    def reach(self) -> float:
        """The gap at which the attraction has become negligible, or ``cut`` [m]."""
        return cut_at(self.cut, self.d_min / NEGLIGIBLE_FORCE**0.5)

    @property
    def absent(self) -> str:
        return "hamaker is zero" if self.hamaker == 0.0 else ""

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
