"""The attraction zone d_c < D_0: where van der Waals attraction and double-layer repulsion balance.

With x = κ d, F_A = F_R reads x² exp(−x) = S, S = H_A κ/(24π ε0 ε_r φ²): sizes cancel. It has two
roots where S ≤ 4/e², x = −2 W₀(−√S/2) (inner) and −2 W₋₁(−√S/2) (outer), W Lambert's function, and
none above.
"""

import math
from collections.abc import Sequence

from flocsim.ensembles.config.schema import ZoneConfig
from flocsim.errors import ZoneError
from flocsim.forces import DoubleLayer, VanDerWaals
from flocsim.forces.base import Force

LARGEST_RATIO = 4.0 / math.e**2
"""S above which attraction wins at every distance."""


def attraction_ratio(attraction: VanDerWaals, layer: DoubleLayer) -> float:
    """S = H_A κ/(24π ε0 ε_r φ_i φ_j) [-]; inf without repulsion."""
    if layer.strength <= 0.0:
        return math.inf
    return attraction.hamaker / (6.0 * layer.strength * layer.debye_length**2)


def neutral_distance(attraction: VanDerWaals, layer: DoubleLayer, root: str) -> float:
    """d_0 [m], the ``root`` ("inner" or "outer") of F_A = F_R; ZoneError where there is none."""
    ratio = attraction_ratio(attraction, layer)
    if ratio > LARGEST_RATIO:
        raise ZoneError(
            f"no attraction zone: van der Waals attraction exceeds double-layer repulsion at every "
            f"distance, S = {ratio:.4g} > 4/e² = {LARGEST_RATIO:.4f}, so that F_A = F_R has no "
            f"root; raise forces.double_layer.potential or debye_length, lower "
            f"forces.van_der_waals.hamaker, or give zone.distance or zone.centre"
        )
    if ratio <= 0.0:
        raise ZoneError(
            "no attraction zone: without attraction F_A = F_R has no root; raise "
            "forces.van_der_waals.hamaker, or give zone.distance or zone.centre"
        )
    return balance(ratio, root) * layer.debye_length


def balance(ratio: float, root: str) -> float:
    """x [-] at which x² exp(−x) is a ratio up to 4/e², below 2 ("inner") or above ("outer").

    Newton's method on 2 ln x − x, which is concave: from outside of a root it comes nearer with
    every step and never passes it.
    """
    x = math.sqrt(ratio) if root == "inner" else 4.0 - 2.0 * math.log(ratio)
    for _ in range(100):
        above = 2.0 * math.log(x) - x - math.log(ratio)
        if above >= 0.0 or x == 2.0:
            break
        x -= above / (2.0 / x - 1.0)
    return x


def only_one(forces, kind):
    found = [force for force in forces if isinstance(force, kind)]
    if len(found) != 1:
        raise ZoneError(
            f"zone.root needs just one {kind.__name__} force to balance, found {len(found)}; give "
            "zone.distance or zone.centre instead"
        )
    return found[0]


def zone_distance(
    zone: ZoneConfig, forces: Sequence[Force], radius_i: float, radius_j: float
) -> float:
    """D_0 [m], the centre distance within which a pair counts as inside the zone."""
    if zone.centre is not None:
        return zone.centre
    if zone.distance is not None:
        return radius_i + radius_j + zone.distance
    both = only_one(forces, VanDerWaals), only_one(forces, DoubleLayer)
    return radius_i + radius_j + neutral_distance(*both, zone.root or "outer")
