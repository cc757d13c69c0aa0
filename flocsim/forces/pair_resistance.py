"""Hydrodynamic interaction of two bodies: lubrication alone, or the full resistance of two
spheres."""

import functools
import math
from collections.abc import Iterable, Sequence
from typing import Any

import attrs
import numpy as np

from flocsim.body import Body, Fluid
from flocsim.compiler.disk_cache import kept
from flocsim.constants import MINIMUM_GAP
from flocsim.errors import RangeError, UsageError
from flocsim.fields import quantity
from flocsim.forces.base import Force, SurfaceForce
from flocsim.forces.body_forces import Thermal
from flocsim.forces.drag import StokesDrag, computation_key, drag_radius, is_permeable
from flocsim.hydrodynamics import pair, two_spheres
from flocsim.hydrodynamics.two_spheres import FADES_FROM, fading
from flocsim.state.scene import NO_WATER, Water

OUTLINE_RANGE = 2.0
"""Gap of the outlines over the mean radius from which relative motion depends on the distance of
the centres alone; outlines fade out from FADES_FROM times this gap."""


@attrs.frozen
class Lubrication(SurfaceForce):
    """Lubrication resistance F = −6πγ r*² ḣ/h against a change of the gap h, r* = r_i r_j/(r_i +
    r_j).

    Parameters
    ----------
    h_min : float
        Gap [m] below which the resistance stays constant, because surfaces are rough and the fluid
        is no continuum; bodies can touch.
    cut : float
        Gap [m] at which the force ends; it fades out from half of it.

    Raises
    ------
    RangeError
        If ``h_min`` is above half of ``cut``.

    Notes
    -----
    Leading term for two spheres with h ≪ r*; for other outlines the smooth gap is used. Viscosity γ
    is the fluid's. Under a constant force F on the pair h = h₀ exp(−F t/(6πγ r*²)); under van der
    Waals attraction at the surface gap h² = h₀² − H_A t/(18πγ r*).

    Source: Kim and Karrila (1991), Microhydrodynamics, ch. 9.
    """

    h_min: float = quantity(
        "m", above=0.0, default=MINIMUM_GAP, help="gap below which the resistance is constant"
    )
    cut: float = quantity(
        "m",
        above=0.0,
        default=1e-5,
        help="gap at which the force ends; it fades out from half of this gap",
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
        """Return the force −6πγ r*² ḣ/h [N]."""
        # Kim and Karrila (1991), ch. 9; the fade brings it to zero at the cut without a jump.
        share, _ = fading(pair.gap, cut)
        resistance = 6.0 * math.pi * viscosity * pair.reduced_radius**2 / max(pair.gap, h_min)
        return -share * resistance * pair.gap_rate

    @staticmethod
    def slope(pair, viscosity, h_min, cut):
        """Return its derivative with respect to the gap [N/m], 0 below h_min."""
        if pair.gap <= h_min:
            return 0.0
        # Product rule: 1/h and the fade both depend on the gap.
        share, fall = fading(pair.gap, cut)
        squeezed = 6.0 * math.pi * viscosity * pair.reduced_radius**2 * pair.gap_rate
        return squeezed / pair.gap * (share / pair.gap - fall)


@attrs.frozen
class PairResistance(Force):
    """Forces and torques that two bodies exert on each other through the water between them.

    Parameters
    ----------
    h_min : float
        Gap [m] below which the resistance stays constant, because surfaces are rough; bodies can
        touch.
    cut : float
        Gap over r_i + r_j at which the interaction ends. It fades out from half of that, where it
        changes the speed of two settling bodies by less than a tenth, in proportion to 1/gap.

    Notes
    -----
    The load follows from the motion of both bodies and the strain of the flow: the exact resistance
    of two spheres in slow flow, minus the Stokes drag of each alone, which StokesDrag provides. The
    spheres have the drag of the bodies: their equivalent radii or, with the drag law "shape", radii
    larger by about 8 %. Together with that drag the resistance is symmetric and positive definite.

    Common motion uses the distance of the centres. Relative motion, along and across their line,
    uses a gap that changes from that of the outlines at contact to that of the spheres, which takes
    over between one and two mean radii. For real flocs at least 0.25 r_eq apart, with the drag of
    their shape, common motion is right to 3 % (rms), and that of settling pairs to 6 % (rms, 12 %
    at most). Relative motion is right to 6 and 2 % (rms, along and across) at a gap of r_eq, 18 and
    5 % at half of it, 23 and 8 % at a quarter (docs/evidence/accuracy.md).

    For two free bodies with ratios of radii up to 50, and gaps from 1e-7 mean radii. Sources:
    Jeffrey and Onishi (1984), J. Fluid Mech. 139, 261; Jeffrey (1992), Phys. Fluids A 4, 16.
    """

    h_min: float = quantity(
        "m", above=0.0, default=MINIMUM_GAP, help="gap below which the resistance is constant"
    )
    cut: float = quantity(
        "",
        at_least=5.0,
        at_most=0.5 * pair.FARTHEST,
        default=20.0,
        help="gap over r_i + r_j at which it ends; it fades out from half of this gap",
    )

    @staticmethod
    def kernel(view):
        """Raise NotImplementedError: loads follow from tables
        (integrators/rhs/pair_resistance.py)."""
        raise NotImplementedError("PairResistance has no kernel")


def resistance_of_pairs(forces: Iterable[Force]) -> PairResistance | None:
    """Return the pair resistance among some forces, None without one.

    Raises UsageError for several, or for a combination with an incompatible force.
    """
    forces = list(forces)
    found = [force for force in forces if isinstance(force, PairResistance)]
    if not found:
        return None
    if len(found) > 1:
        raise UsageError(f"give only one PairResistance, found {len(found)}")
    for force in forces:
        if isinstance(force, Lubrication):
            raise UsageError(
                "Lubrication is part of PairResistance and would count twice: leave one of them out"
            )
        # Fluctuation–dissipation: kicks must have the covariance of the joint resistance.
        if isinstance(force, Thermal) and not force.absent:
            raise UsageError(
                "Thermal cannot be combined with PairResistance: its kicks would have to be "
                "correlated between the bodies; leave one of them out"
            )
    # The tables contain the drag of single spheres in slow flow: it must be there to be subtracted.
    drags = [force for force in forces if isinstance(force, StokesDrag)]
    usual = len(drags) == 1 and drags[0].rotational and not is_permeable(drags)
    if not usual or drags[0].law == "schiller_naumann":
        raise UsageError(
            "PairResistance adds the interaction of two bodies to the drag of each: give one "
            'StokesDrag with it, with law "stokes" or "shape", rotational = true and no '
            "permeability"
        )
    return found[0]


def refuse_pair_resistance(forces: Iterable[Force], subject: str) -> None:
    """Raise UsageError if there is a pair resistance, which ``subject`` does not support."""
    if any(isinstance(force, PairResistance) for force in forces):
        raise UsageError(
            f"PairResistance is for two bodies, and {subject} cannot have it: summed over the "
            "pairs of many bodies, the resistance would not be positive definite; leave it out"
        )


def pair_resistance_tables(
    forces: Iterable[Force], bodies: Sequence[Body], fluid: Fluid
) -> tuple[np.ndarray, Water]:
    """Return (``Scene.pair_table``, ``Scene.water``) of two bodies; NO_WATER without interaction.

    Raises UsageError if the tables do not cover these bodies.
    """
    forces = list(forces)
    force = resistance_of_pairs(forces)
    if force is None or len(bodies) < 2:
        return NO_WATER
    if len(bodies) > 2:
        refuse_pair_resistance([force], f"a System of {len(bodies)} bodies")
    if any(body.fixed for body in bodies):
        raise UsageError(
            "PairResistance needs two free bodies, but one is fixed: free it, or leave "
            "PairResistance out"
        )
    first, second = radii = [drag_radius(forces, body) for body in bodies]
    # Tables start at gaps of NEAREST mean radii.
    mean = 0.5 * (first + second)
    if not pair.NEAREST * mean <= force.h_min <= 0.1 * mean:
        raise UsageError(
            f"h_min of PairResistance must be {pair.NEAREST:g} to 0.1 times the mean radius of "
            f"both bodies, {mean:.3g} m, found {force.h_min:g} m"
        )
    # Two spheres have the gap that the tables are made for: near_cut is 0.
    spheres = all(len(body.shape.vertices) == 1 for body in bodies)
    water = Water.one()
    water.viscosity, water.mean_radius, water.floor = fluid.viscosity, mean, force.h_min
    water.cut, water.near_cut = force.cut * 2.0 * mean, 0.0 if spheres else OUTLINE_RANGE * mean
    water.flow_x, water.flow_y = fluid.velocity
    water.flow_x_by_x, water.flow_x_by_y, water.flow_y_by_x, water.flow_y_by_y = fluid.gradient
    water.first_radius, water.second_radius = radii
    # Tables are stored for a mean radius and a viscosity of 1 and scaled by powers of both.
    table = unit_table(second / first) * pair.scales(fluid.viscosity, mean)[:, None]
    return table, water


def lubrication_stand_in(force: PairResistance) -> Lubrication:
    """Return a Lubrication force that varies as fast as the pair resistance does."""
    # A fade that begins at 1000 h_min leaves 1/h as the only scale on which it varies.
    return Lubrication(force.h_min, force.h_min / FADES_FROM * 1e3)


@functools.lru_cache(maxsize=256)
def unit_table(ratio: float) -> Any:
    """Return ``Scene.pair_table`` for a mean radius and a viscosity of 1; ``ratio`` = r₂/r₁."""
    if not 1.0 / pair.LARGEST_RATIO <= ratio * (1.0 + 1e-9) <= 1.0001 * 50.0:
        raise UsageError(
            f"PairResistance needs radii whose ratio is at most {pair.LARGEST_RATIO:g}, found "
            f"{max(ratio, 1.0 / ratio):.4g}"
        )
    # Lagrange interpolation between tabulated ratios of radii.
    values = sum(weight * stored_node(place) for place, weight in pair.interpolation_weights(ratio))
    return pair.cubics(np.asarray(values))


@functools.cache
def stored_node(place: int) -> np.ndarray:
    """Return the table columns at a node of the ratio, from disk if stored: they take a second."""
    # Ratios below 1 are those above 1 with the two bodies exchanged.
    if place < 0:
        return pair.exchanged(stored_node(-place))
    facts = computation_key(pair, two_spheres)
    data = kept("flocsim_pair", f"{place} {facts}", lambda: pair.ratio_node(place).tobytes())
    return np.frombuffer(data).reshape(pair.NODES, -1)
