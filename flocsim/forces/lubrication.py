"""Lubrication: the fluid that two bodies squeeze out of the gap between them."""

import math

import attrs

from flocsim.constants import MINIMUM_GAP
from flocsim.errors import RangeError
from flocsim.fields import quantity
from flocsim.forces.base import SurfaceForce

FADES_FROM = 0.5
"""Share of the cut from which on the force fades, so that it does not jump at the cut."""


def fading(gap, cut):
    """(w, dw/dgap): 1 up to half the cut, 0 from the cut on, a cubic without a kink between."""
    left = (cut - gap) / ((1.0 - FADES_FROM) * cut)
    if left >= 1.0:
        return 1.0, 0.0
    if left <= 0.0:
        return 0.0, 0.0
    slope = -6.0 * left * (1.0 - left) / ((1.0 - FADES_FROM) * cut)
    return left * left * (3.0 - 2.0 * left), slope


@attrs.frozen
class Lubrication(SurfaceForce):
    """Resistance F = −6πγ r*² ḣ/h against a change of the gap h, r* = r_i r_j/(r_i + r_j).

    Of two spheres that are close, h ≪ r*, and of other outlines at the smooth gap between them.
    Below ``h_min`` [m], where surfaces are rough and the fluid is none any more, the resistance
    stays what it is at h_min, so that bodies touch; ``cut`` [m]: the force ends there, and fades
    from half of it on. Viscosity γ is the fluid's. A constant push F on the pair
    makes h = h₀ exp(−F t/(6πγ r*²)), and van der Waals attraction at the surface gap
    h² = h₀² − H_A t/(18πγ r*).

    Source: Kim and Karrila (1991), Microhydrodynamics, ch. 9; the leading term of two spheres.
    """

    h_min: float = quantity(
        "m", above=0.0, default=MINIMUM_GAP, help="the resistance grows no further below this gap"
    )
    cut: float = quantity(
        "m",
        above=0.0,
        default=1e-5,
        help="gap at which the force ends; it fades from half of it on",
    )

    def __attrs_post_init__(self) -> None:
        if self.h_min > FADES_FROM * self.cut:
            raise RangeError(
                f"h_min must be at most half of cut, found {self.h_min:g} m with a cut of "
                f"{self.cut:g} m"
            )

    @property
    def reach(self) -> float:
        """``cut`` [m]."""
        return self.cut

    @staticmethod
    def kernel(pair, viscosity, h_min, cut):
        """−6πγ r*² ḣ/h [N]."""
        share, _ = fading(pair.gap, cut)
        resistance = 6.0 * math.pi * viscosity * pair.reduced_radius**2 / max(pair.gap, h_min)
        return -share * resistance * pair.gap_rate

    @staticmethod
    def slope(pair, viscosity, h_min, cut):
        """Its derivative by the gap [N/m], none below h_min."""
        if pair.gap <= h_min:
            return 0.0
        share, fall = fading(pair.gap, cut)
        squeezed = 6.0 * math.pi * viscosity * pair.reduced_radius**2 * pair.gap_rate
        return squeezed / pair.gap * (share / pair.gap - fall)
