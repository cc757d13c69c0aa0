"""How deep two spheres run into each other where they meet, against what the contact law covers.

The contact law, whatever it is, is taken as the spring and dashpot that are worth it: as much work
up to the deepest overlap, as much damping half way. A spring k with damping ζ of critical stops a
mass M of speed v at v √(M/k) exp(−ζ acos ζ/√(1 − ζ²)), for critical damping v √(M/k)/e.
"""

import math
from collections.abc import Sequence

import numpy as np

from flocsim.arrays import ContactView
from flocsim.constants import DEEPEST_OVERLAP
from flocsim.ensembles.collision.encounter import Encounter
from flocsim.explain import pairs_of
from flocsim.forces import Contact, ContactForce

PARTS = 16
"""Intervals of the work of the contact force, an even number."""


def depth(speed: float, mass: float, stiffness: float, damping: float) -> float:
    """Deepest overlap [m] of a mass [kg] at a speed [m/s] on a spring [N/m] and dashpot [N s/m]."""
    omega = math.sqrt(stiffness / mass)
    share = 0.5 * damping / (mass * omega)
    if abs(share - 1.0) < 1e-6:
        exponent = 1.0
    elif share < 1.0:
        exponent = share * math.acos(share) / math.sqrt(1.0 - share * share)
    else:
        exponent = share * math.acosh(share) / math.sqrt(share * share - 1.0)
    return speed / omega * math.exp(-exponent)


def spring_and_dashpot(
    pair: Encounter, mass: float, radii: Sequence[float], speed: float
) -> tuple[float, float] | None:
    """(stiffness [N/m], damping [N s/m]) of the pair's contact law up to the deepest overlap.

    None where it has no such thing: it gives no numbers, or does not push apart.
    """
    law, known = pair.system.pieces.laws["contact_force"], pair.system.pieces.parameters
    deepest = DEEPEST_OVERLAP * sum(radii)

    def normal(overlap, rate):
        return float(law(ContactView(overlap, rate, 0.0, 0.0, mass, *radii), known)[0])

    try:
        with np.errstate(all="ignore"):
            values = [normal(deepest * k / PARTS, 0.0) for k in range(1, PARTS + 1)]
            middle, half = values[PARTS // 2 - 1], 0.5 * speed
            damping = (normal(0.5 * deepest, half) - middle) / half
    except (ArithmeticError, ValueError):
        return None
    # Simpson's rule; no force at no overlap.
    work = (4.0 * sum(values[0::2]) + 2.0 * sum(values[1:-1:2]) + values[-1]) / (3.0 * PARTS)
    stiffness = 2.0 * work / deepest
    if not (0.0 < stiffness < math.inf and -math.inf < damping < math.inf):
        return None
    return stiffness, max(damping, 0.0)


def stiffness_for(
    deepest: float, speed: float, mass: float, stiffness: float, damping: float, scales: bool
) -> float:
    """Least stiffness [N/m] at which the overlap stays below ``deepest`` [m].

    ``scales``: the damping is a share of critical damping, and grows with the stiffness.
    """

    def found(factor):
        more = math.sqrt(factor) if scales else 1.0
        return depth(speed, mass, factor * stiffness, more * damping)

    from scipy.optimize import brentq

    high = 2.0
    while found(high) > deepest:
        high *= 2.0
    return stiffness * float(brentq(lambda factor: found(factor) - deepest, 1.0, high))


def rounded_up(value: float) -> float:
    """A value to two digits, not below it."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.ceil(value / unit * (1.0 - 1e-12)) * unit:.2g}")


def too_deep(
    name: str, pair: Encounter, radii: Sequence[float], what: str
) -> tuple[float, str] | None:
    """How many times too soft the contact is for the equivalent spheres of a collision type, and
    that in words with what would do; None where it is stiff enough, or has no stiffness.

    ``radii`` [m] are those of the outlines that touch, of ``what``: spheroradii, or the spheres'.
    The speed is that at which the spheres settle onto each other.
    """
    speed, deepest = math.hypot(*pair.drift), DEEPEST_OVERLAP * sum(radii)
    [mass] = [mass for _, _, mass in pairs_of(pair.system)]
    law = spring_and_dashpot(pair, mass, radii, speed)
    if law is None or depth(speed, mass, *law) <= deepest:
        return None
    forces = [each for each in pair.system.forces if isinstance(each, ContactForce)]
    alone = forces[0] if len(forces) == 1 else None
    scales = isinstance(alone, Contact) and alone.damping_n == "critical"
    wanted = stiffness_for(deepest, speed, mass, *law, scales)
    cure = (
        f"give forces.contact.k_n {rounded_up(wanted):g} N/m or more"
        if type(alone) is Contact
        else f"make the contact {rounded_up(wanted / law[0]):g} times as stiff"
    )
    return wanted / law[0], (
        f"{name}: an impact at {1e3 * speed:.4g} mm/s is {1e6 * depth(speed, mass, *law):.3g} um "
        f"deep, more than the {1e6 * deepest:.3g} um that the contact law covers (half of "
        f"r_i + r_j of {what}): {cure}, or lighter bodies"
    )
