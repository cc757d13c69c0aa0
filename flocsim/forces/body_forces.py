"""Forces on every body by itself, besides drag: weight, and the kicks of thermal motion, which
Stokes's drag balances.
"""

import math
from collections.abc import Iterable, Sequence
from typing import Any

import attrs
import numpy as np

from flocsim.body import Body, Fluid
from flocsim.constants import BOLTZMANN, MINIMUM_GAP, STANDARD_GRAVITY
from flocsim.errors import UsageError
from flocsim.fields import flag, quantity, word_or_quantity
from flocsim.forces.base import BodyForce, Force
from flocsim.forces.drag import follows_shape, is_permeable, shields_clusters

FAR_SHARE = 0.1
"""Share of the smallest radius by which a kick of automatic length moves two bodies against each
other while they are far apart."""

MOST_HALVINGS = 40
"""More would take a kick below what a double can tell of the time."""

KICKS = 0x7E4D
"""Keeps kicks apart from what else is drawn with a seed and a replicate."""


@attrs.frozen
class Gravity(BodyForce):
    """Weight F = m g towards −y, times (1 − ρ_f/ρ) with the fluid's buoyancy on.

    Parameters: ``g`` [m/s²].  Source: Tang et al. (2014), eq. 3; the paper has no buoyancy.
    """

    g: float = quantity("m/s^2", at_least=0.0, default=STANDARD_GRAVITY)

    @property
    def absent(self) -> str:
        return "g is zero" if self.g == 0.0 else ""

    @staticmethod
    def kernel(body, g):
        """(0, −m_b g, 0), m_b the mass less the displaced fluid's where buoyancy is on."""
        return 0.0, -body.buoyant_mass * g, 0.0


@attrs.frozen
class Thermal(BodyForce):
    """Random force √(2 k_B T ζ/τ) ξ_k, constant over each kick [kτ, (k + 1)τ), and such a torque.

    ζ = 6πγ r_eq, 8πγ r_eq³ for the torque, as in Stokes's drag, which is needed as well; ξ is a
    standard normal number for each body, kick and coordinate. A free body diffuses
    with D = k_B T/ζ at any τ; its velocity at the end of kicks has
    ⟨v²⟩ = (k_B T/m) tanh(x/2)/(x/2), x = ζτ/m.

    Parameters: ``temperature`` T [K]; ``kick`` τ [s], "auto": the time in which two bodies
    diffuse a tenth of the smaller radius relative to each other; ``finest`` [m]: where bodies are
    near each other kicks are halved (a Brownian bridge) until one moves them by no more than a
    quarter of the gap, or by ``finest``; "auto": 1 nm where the kick is automatic, and no halving
    where it is given. ``rotational``: the torque; switch it off together with that of the drag.

    The random numbers depend only on the seed, the replicate, the body and the kick.

    Source: Ermak and McCammon (1978), J. Chem. Phys. 69, 1352, without hydrodynamic interaction.
    """

    temperature: float = quantity("K", at_least=0.0, default=298.15)
    kick: float | str = word_or_quantity(
        "auto", "s", above=0.0, default="auto", help="how long a random force stays the same"
    )
    finest: float | str = word_or_quantity(
        "auto", "m", above=0.0, default="auto",
        help="kicks are halved near contact down to this way",
    )  # fmt: skip
    rotational: bool = flag(default=True, help="random torque, too")

    @property
    def absent(self) -> str:
        return "temperature is zero" if self.temperature == 0.0 else ""

    @property
    def energy(self) -> float:
        """k_B T [J]."""
        return BOLTZMANN * self.temperature

    def diffusion(self, fluid: Fluid, radius: float) -> float:
        """D = k_B T/(6πγ r) of a sphere [m²/s]."""
        return self.energy / (6.0 * math.pi * fluid.viscosity * radius)

    def rotational_diffusion(self, fluid: Fluid, radius: float) -> float:
        """D_r = k_B T/(8πγ r³) of a sphere [1/s]."""
        return self.energy / (8.0 * math.pi * fluid.viscosity * radius**3)

    @property
    def least_way(self) -> float:
        """The way in a kick below which none is halved [m]; inf where none is at all."""
        if isinstance(self.finest, str):
            return MINIMUM_GAP if isinstance(self.kick, str) else math.inf
        return self.finest

    def remarks(self, fluid: Fluid) -> list[str]:
        """How long kicks are."""
        length = (
            f"as long as diffusion by {FAR_SHARE:g} of the smallest radius takes"
            if isinstance(self.kick, str)
            else f"of {self.kick:.3g} s"
        )
        least = self.least_way
        near = "" if least == math.inf else f", halved near contact down to ways of {least:.3g} m"
        return [f"steps end at kicks {length}{near}"]

    @staticmethod
    def kernel(body, viscosity, energy, rotational):
        """√(2 k_B T ζ) times the mean of white noise over the present kick."""
        radius = body.radius
        force = math.sqrt(12.0 * math.pi * viscosity * radius * energy)
        torque = math.sqrt(16.0 * math.pi * viscosity * radius**3 * energy) * rotational
        return force * body.kick_x, force * body.kick_y, torque * body.kick_turn


def thermal_in(forces: Iterable[Force]) -> list[Thermal]:
    """The random forces among some that are of a temperature above 0 K."""
    return [force for force in forces if isinstance(force, Thermal) and not force.absent]


def kicks_of(
    forces: Sequence[Force], bodies: Sequence[Body], fluid: Fluid
) -> tuple[float, float, float, float]:
    """Scene.kicks of these forces on these bodies; zeros without random forces.

    UsageError for more than one of them.
    """
    found = thermal_in(forces)
    radii = sorted(body.shape.equivalent_radius for body in bodies if not body.fixed)
    if not found or not radii:
        return 0.0, 0.0, 0.0, 0.0
    if len(found) > 1:
        raise UsageError("a scene has one temperature: give one Thermal force")
    if follows_shape(forces):
        raise UsageError(
            'thermal motion cannot have the drag law "shape": its kicks are those of equivalent '
            "spheres, and such bodies would not stay at their temperature: give another law"
        )
    if shields_clusters(forces) or is_permeable(forces):
        raise UsageError(
            "thermal motion cannot have a drag that is less in clusters, or of permeable bodies: "
            "its kicks are those of solid spheres alone, and such bodies would get too hot; leave "
            "the drag's clusters and permeability out"
        )
    thermal = found[0]
    spread = 2.0 * sum(thermal.diffusion(fluid, radius) for radius in radii[:2])
    kick: Any = thermal.kick
    if kick == "auto":
        kick = (FAR_SHARE * radii[0]) ** 2 / spread
    least, halvings = thermal.least_way, 0
    pairs = any(not isinstance(force, BodyForce) and not force.absent for force in forces)
    if pairs and len(bodies) > 1 and spread * kick > least**2:
        halvings = min(math.ceil(math.log2(spread * kick / least**2)), MOST_HALVINGS)
    return float(kick), float(halvings), float(spread), least if halvings else 0.0


def key_of(*numbers: int) -> tuple[int, int]:
    """Scene.key of a seed and of what it is spawned by, whole numbers from 0: two words of 32 bits.

    As the start of a replicate's own numbers, and apart from it.
    """
    stream = np.random.SeedSequence(numbers[0], spawn_key=(*numbers[1:], KICKS))
    first, second = stream.generate_state(2).tolist()
    return first, second
