"""Spheres that water passes through: how much less they resist, and how permeable flocs are.

Brinkman's equation inside of a sphere of radius a and permeability k, Stokes's outside; β = a/√k.

Sources: H. C. Brinkman (1949), Appl. Sci. Res. A 1, 27; G. Neale, N. Epstein and W. Nader (1973),
Chem. Eng. Sci. 28, 1865; of turning B. U. Felderhof and J. M. Deutch (1975), J. Chem. Phys. 62,
2391; J. Happel (1958), AIChE J. 4, 197, for flocs X. Li and B. E. Logan (2001), Water Res. 35,
3373.
"""

import math

from flocsim.errors import UsageError

SLOW = 1e-2
"""β below which series take the place of differences that cancel."""


def drag_factor(radius, permeability):
    """2β²(1 − tanh β/β)/(2β² + 3(1 − tanh β/β)): the drag of a permeable sphere over that of a
    solid one; radius [m], permeability [m²] above 0."""
    beta = radius / math.sqrt(permeability)
    # 1 − tanh β/β of small β.
    less = beta * beta * (1.0 / 3.0 - 2.0 * beta * beta / 15.0)
    if beta > SLOW:
        less = 1.0 - math.tanh(beta) / beta
    return 2.0 * beta * beta * less / (2.0 * beta * beta + 3.0 * less)


def turning_factor(radius, permeability):
    """1 + 3/β² − 3 coth β/β: the same of the torque on one that turns."""
    beta = radius / math.sqrt(permeability)
    if beta < SLOW:
        return beta * beta / 15.0
    return 1.0 + 3.0 / (beta * beta) - 3.0 / (beta * math.tanh(beta))


def happel_permeability(grain: float, solid: float) -> float:
    """k [m²] of flocs of grains of a radius ``grain`` [m] that fill a share ``solid`` of them.

    k = 2 a²/(9 φ) · (3 − 4.5 φ^⅓ + 4.5 φ^(5/3) − 3 φ²)/(3 + 2 φ^(5/3)), by Happel's cell. For a
    floc that is a cluster of clusters, those are its grains, as water passes between them (Li and
    Logan). UsageError for a radius that is none, or a share that is not between 0 and 1.
    """
    if not 0.0 < grain < math.inf or not 0.0 < solid < 1.0:
        raise UsageError(
            "permeability is of grains of a radius above 0 m that fill a share between 0 and 1, "
            f"found {grain} m and {solid}"
        )
    third = solid ** (1.0 / 3.0)
    cell = 3.0 - 4.5 * third + 4.5 * third**5 - 3.0 * solid**2
    return 2.0 * grain**2 / (9.0 * solid) * cell / (3.0 + 2.0 * third**5)
