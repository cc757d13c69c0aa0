"""Forces on single bodies other than drag: gravity, and the random kicks of thermal motion."""

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

KICK_DISPLACEMENT = 0.1
"""Relative displacement of two distant bodies in an automatic kick, over the smallest radius."""

MOST_HALVINGS = 40
"""Largest number of halvings: a shorter kick would be below the rounding of time."""

KICK_STREAM = 0x7E4D
"""Stream number that separates kicks from other random numbers of a seed and replicate."""


@attrs.frozen
class Gravity(BodyForce):
    """Weight F = m g towards −y, times (1 − ρ_f/ρ) if the fluid's buoyancy is on.

    Parameters
    ----------
    g : float
        Gravitational acceleration [m/s²].

    Notes
    -----
    Source: Tang et al. (2014), eq. 3; the paper has no buoyancy.
    """

    g: float = quantity("m/s^2", at_least=0.0, default=STANDARD_GRAVITY)

    @property
    def absent(self) -> str:
        return "g is zero" if self.g == 0.0 else ""

    @staticmethod
    def kernel(body, g):
        """Return (0, −m_b g, 0), where m_b is the mass minus that of the displaced fluid, if
        buoyancy is on."""
        return 0.0, -body.buoyant_mass * g, 0.0


@attrs.frozen
class Thermal(BodyForce):
    """Random force √(2 k_B T ζ/τ) ξ_k, constant over each kick [kτ, (k + 1)τ), and such a torque.

    ζ is the Stokes resistance 6πγ r_eq (8πγ r_eq³ for the torque), so StokesDrag is needed as well;
    ξ is a standard normal number for each body, kick and coordinate.

    Parameters
    ----------
    temperature : float
        T [K].
    kick : float or "auto"
        Duration τ [s]; "auto": the time in which two bodies diffuse a tenth of the smallest radius
        relative to each other.
    finest : float or "auto"
        Near other bodies kicks are halved (Brownian bridge) until one displaces them by at most a
        quarter of the gap, or by this length [m]. "auto": 1 nm if ``kick`` is automatic, and no
        halving otherwise.
    rotational : bool
        Whether there is a random torque; switch it off together with that of the drag.

    Notes
    -----
    A free body diffuses with D = k_B T/ζ at any τ. Its velocity at the ends of kicks has ⟨v²⟩ =
    (k_B T/m) tanh(x/2)/(x/2), x = ζτ/m. The random numbers depend only on the seed, the replicate,
    the body and the kick.

    Source: Ermak and McCammon (1978), J. Chem. Phys. 69, 1352, without hydrodynamic interaction.
    """

    temperature: float = quantity("K", at_least=0.0, default=298.15)
    kick: float | str = word_or_quantity(
        "auto", "s", above=0.0, default="auto", help="time for which a random force is constant"
    )
    finest: float | str = word_or_quantity(
        "auto", "m", above=0.0, default="auto",
        help="displacement per kick below which kicks are not halved near contact",
    )  # fmt: skip
    rotational: bool = flag(default=True, help="also apply a random torque")

    @property
    def absent(self) -> str:
        return "temperature is zero" if self.temperature == 0.0 else ""

    @property
    def energy(self) -> float:
        """k_B T [J]."""
        return BOLTZMANN * self.temperature

    def diffusion(self, fluid: Fluid, radius: float) -> float:
        """Return D = k_B T/(6πγ r) of a sphere [m²/s]."""
        return self.energy / (6.0 * math.pi * fluid.viscosity * radius)

    def rotational_diffusion(self, fluid: Fluid, radius: float) -> float:
        """Return D_r = k_B T/(8πγ r³) of a sphere [1/s]."""
        return self.energy / (8.0 * math.pi * fluid.viscosity * radius**3)

    @property
    def least_displacement(self) -> float:
        """Displacement per kick below which kicks are not halved [m]; inf without halving."""
        if isinstance(self.finest, str):
            return MINIMUM_GAP if isinstance(self.kick, str) else math.inf
        return self.finest

    def remarks(self, fluid: Fluid) -> list[str]:
        """Return the duration of kicks in words."""
        length = (
            f"the time to diffuse {KICK_DISPLACEMENT:g} of the smallest radius"
            if isinstance(self.kick, str)
            else f"{self.kick:.3g} s"
        )
        least = self.least_displacement
        near = f", shorter near contact, down to displacements of {least:.3g} m"
        return [f"a kick lasts {length}{near * (least < math.inf)}"]

    @staticmethod
    def kernel(body, viscosity, energy, rotational):
        """Return √(2 k_B T ζ) times the mean of white noise over the present kick."""
        radius = body.radius
        # √(2 k_B T ζ) with ζ = 6πγ r, and ζ = 8πγ r³ for the torque.
        force = math.sqrt(12.0 * math.pi * viscosity * radius * energy)
        torque = math.sqrt(16.0 * math.pi * viscosity * radius**3 * energy) * rotational
        return force * body.kick_x, force * body.kick_y, torque * body.kick_turn


def thermal_forces(forces: Iterable[Force]) -> list[Thermal]:
    """Return the random forces with a temperature above 0 K."""
    return [force for force in forces if isinstance(force, Thermal) and not force.absent]


def kick_parameters(
    forces: Sequence[Force], bodies: Sequence[Body], fluid: Fluid, near: bool = False
) -> tuple[float, float, float, float]:
    """Return Scene.kicks: duration [s], halvings, relative diffusion [m²/s], least displacement
    [m].

    Zeros without random forces. ``near``: whether bodies that come near count whatever acts between
    them, as where a touch is awaited. Raises UsageError for several of them, or for a drag whose
    fluctuations they do not match.
    """
    found = thermal_forces(forces)
    radii = sorted(body.shape.equivalent_radius for body in bodies if not body.fixed)
    if not found or not radii:
        return 0.0, 0.0, 0.0, 0.0
    if len(found) > 1:
        raise UsageError("a scene has one temperature: give one Thermal force")
    if follows_shape(forces):
        raise UsageError(
            'Thermal cannot be combined with the drag law "shape": its kicks are those of '
            "equivalent spheres, and the bodies would not stay at its temperature; give another law"
        )
    if shields_clusters(forces) or is_permeable(forces):
        raise UsageError(
            "Thermal cannot be combined with a drag that is reduced by clusters or permeability: "
            "its kicks are those of single solid spheres, and the bodies would get too hot; leave "
            "clusters and permeability out of the drag"
        )
    thermal = found[0]
    # Mean squared relative displacement per time of the two most mobile bodies: ⟨x²⟩ = 2 (D_i +
    # D_j) t.
    relative_diffusion = 2.0 * sum(thermal.diffusion(fluid, radius) for radius in radii[:2])
    kick: Any = thermal.kick
    # ⟨x²⟩ = spread · τ is the square of KICK_DISPLACEMENT times the smallest radius.
    if kick == "auto":
        kick = (KICK_DISPLACEMENT * radii[0]) ** 2 / relative_diffusion
    least, halvings = thermal.least_displacement, 0
    # Halvings after which a kick displaces bodies by no more than ``least``; none where bodies that
    # come near make no difference, unless asked for.
    near = near or not isinstance(thermal.finest, str)
    near = near or any(not isinstance(force, BodyForce) and not force.absent for force in forces)
    if near and len(bodies) > 1 and relative_diffusion * kick > least**2:
        halvings = min(math.ceil(math.log2(relative_diffusion * kick / least**2)), MOST_HALVINGS)
    return float(kick), float(halvings), float(relative_diffusion), least if halvings else 0.0


def random_key(*numbers: int) -> tuple[int, int]:
    """Return Scene.key, two 32-bit words of a random stream, from a seed and its spawn numbers.

    The stream is independent of the replicate's other random numbers.
    """
    stream = np.random.SeedSequence(numbers[0], spawn_key=(*numbers[1:], KICK_STREAM))
    first, second = stream.generate_state(2).tolist()
    return first, second
