"""The rate at which a flow opens a doublet, by runs at rising rates from where it is bound."""

import math
import warnings
from collections.abc import Callable, Sequence
from itertools import product
from statistics import fmean
from typing import NamedTuple

import attrs
import numpy as np

from flocsim.body import Body, Fluid
from flocsim.brownian import repulsion
from flocsim.constants import MINIMUM_GAP
from flocsim.errors import PlausibilityWarning
from flocsim.forces.base import Force
from flocsim.forces.body_forces import Gravity, Thermal
from flocsim.forces.outline import refuse_outlines
from flocsim.forces.pair_resistance import PairResistance, resistance_of_pairs
from flocsim.geometry.shapes.outline import core_gap
from flocsim.hydrodynamics import SpherePair
from flocsim.integrators.base import Integrator, Status
from flocsim.integrators.implicit import Overdamped
from flocsim.io.results.strength_file import FAILED, HOLDS, OPENED, OPENS_AT_LEAST
from flocsim.system import System
from flocsim.trajectories.trajectory import State, Trajectory

FLOWS: dict[str, tuple[tuple[float, float, float, float], float]] = {
    "shear": ((0.0, 1.0, 0.0, 0.0), 0.0),
    "extension": ((0.5, 0.0, 0.0, -0.5), 0.25 * math.pi),
}
"""Gradients of flows of unit rate G: u = (G y, 0), and u = (G x, −G y)/2, which pulls as hard; and
the angle [rad] from the flow's x to the line of centres at first. In shear that begins by pressing
the bodies together, and in extension the doublet turns into the pull."""

OPEN = 0.1
"""A doublet is open once its outlines are this share of the smaller equivalent radius apart."""

TURN = 1.05 * math.pi
"""By so much a doublet in shear has turned when it has met the flow from every side: half a turn is
the same flow again."""

LONGEST = 60.0
"""Strain G t after which a doublet that has not opened is taken to hold."""

LEAST, MOST = -12, 8
"""The ladder of rates: from 2^LEAST to 2^MOST times the rate that would open two spheres."""

FILM = 0.03
"""Gap over the mean radius below which the water between a doublet resists as it does there. It has
to flow into the gap before the two part, the longer the nearer they are, while the shear turns them
out of its pull: spheres of 5 µm that touch at 1 nm would hold up to 1.6 times what pulls at them as
hard as they attract each other. The pull itself is .7 % larger there than at touch."""

TRIES = ((1e-11, 2_000), (1e-10, 2_000), (1e-9, 8_000), (1e-8, 20_000))
"""(tolerance [m], steps tried at most) of a run, and of those made in its place where it has not
ended by then. The first is far below the gap at which attraction gives way, and most runs try a few
hundred steps. Edges that slide over each other near the rate at which they open may bounce by
1e-15 m, tens of thousands of times; coarser steps go over that (docs/strength.md)."""


class Opening(NamedTuple):
    """Between which rates a doublet opens: it ``holds`` at one and ``opens`` at the next [1/s].

    NaN where there is none; ``status``: a code of STATUS; ``runs`` made, each at one rate, at
    whatever tolerances; ``tolerance``: the largest [m] that one of them needed, NaN for unknown.
    """

    holds: float
    opens: float
    status: int
    runs: int
    tolerance: float = math.nan


def strongest(forces: Sequence[Force], radii: tuple[float, float], fluid: Fluid) -> float:
    """The largest attraction of two spheres at any gap [N]."""
    refuse_outlines(forces, "the strength of a bond")
    gaps = np.append(0.0, np.geomspace(1e-2 * MINIMUM_GAP, 10.0 * sum(radii), 400))
    return max(0.0, float(-repulsion(forces, radii, fluid)(gaps).min()))


def sphere_rate(forces: Sequence[Force], radii: tuple[float, float], fluid: Fluid) -> float:
    """G at which a shear opens two spheres [1/s]: F = 6πγ r* G R/2 is their largest attraction.

    R = r_i + r_j, r* = r_i r_j/R: the pull of a shear along the line of centres, at 45° to the flow
    and without inertia. For van der Waals forces that is G = H_A/(18πγ d_min² R). With the water
    between the two, F is that of SpherePair.doublet at touch: 2.04 times as much for equal ones.
    """
    r_i, r_j = radii
    stretched = 6.0 * math.pi * fluid.viscosity * r_i * r_j
    water = resistance_of_pairs(forces)
    if water:
        stretched = float(SpherePair(radii, fluid.viscosity).doublet(water.h_min)[0][0])
    return 2.0 * strongest(forces, radii, fluid) / stretched


def gap_of(bodies: Sequence[Body], position: np.ndarray) -> float:
    """Distance of two outlines [m], below 0 where they overlap."""
    placed = [body.shape.placed_parts(*place) for body, place in zip(bodies, position, strict=True)]
    return min(core_gap(a, b) - a.radius - b.radius for a, b in product(*placed))


class Watch:
    """Stops a run once the doublet is open, or has met the flow from every side."""

    def __init__(self, bodies: Sequence[Body], turns: bool) -> None:
        self.bodies, self.turns = bodies, turns
        self.wide = OPEN * min(body.shape.equivalent_radius for body in bodies)
        self.opened, self.turned, self.angle = False, 0.0, math.nan

    def __call__(self, state: State) -> bool:
        x, y = state.position[1, :2] - state.position[0, :2]
        angle = math.atan2(y, x)
        if not math.isnan(self.angle):
            self.turned += math.remainder(angle - self.angle, 2.0 * math.pi)
        self.angle = angle
        self.opened = bool(gap_of(self.bodies, state.position) > self.wide)
        return self.opened or (self.turns and abs(self.turned) > TURN)


@attrs.frozen(eq=False)
class Doublet:
    """Two bodies as a run has left them bound, to be put into flows.

    Weight, thermal motion and how long water takes to come between the two are left out, and
    inertia is, too, unless the methods are others than Overdamped: what is tested is the bond, at
    both bodies' drag. ``tries``: methods with the steps that each may try; a run that has not ended
    by then is made again by the next.
    """

    start: Trajectory
    flow: str = "shear"
    tries: tuple[tuple[Integrator, int], ...] = tuple(
        (Overdamped(tolerance), most_steps) for tolerance, most_steps in TRIES
    )
    jit: bool = True

    @property
    def bodies(self) -> list[Body]:
        """The bodies, none of them held."""
        return [attrs.evolve(body, fixed=False) for body in self.start.known().bodies]

    @property
    def forces(self) -> list[Force]:
        """The forces but for weight and thermal motion; parting does not wait for the water."""
        left_out = Gravity, Thermal
        found = [each for each in self.start.known().forces if not isinstance(each, left_out)]
        film = FILM * fmean(body.shape.equivalent_radius for body in self.start.known().bodies)
        return [
            attrs.evolve(each, h_min=max(film, each.h_min))
            if isinstance(each, PairResistance) else each
            for each in found
        ]  # fmt: skip

    def rate_of_spheres(self) -> float:
        """The rate that would open two spheres of the same radii [1/s]; 1 without attraction."""
        known = self.start.known()
        r_i, r_j = (body.shape.equivalent_radius for body in known.bodies)
        return sphere_rate(known.forces, (r_i, r_j), known.fluid) or 1.0

    def answer(self, rate: float) -> tuple[bool | None, float]:
        """Whether a flow of a rate [1/s] opens the doublet, by the first of the tries that ends,
        None where every run fails; and the tolerance [m] of the last made."""
        found, tolerance = None, math.nan
        for method, most_steps in self.tries:
            found, tolerance = self.opened_by(method, most_steps, rate), float(method.tolerance)
            if found is not None:
                break
        return found, tolerance

    def opened_by(self, method: Integrator, most_steps: int, rate: float) -> bool | None:
        """Whether the doublet opens in a run by one method; None where that does not end."""
        bodies, origin = self.bodies, self.start.known()
        places = self.start.position[-1, :, :2]
        gradient, before = FLOWS[self.flow]
        turn = math.atan2(*(places[1] - places[0])[::-1]) - before
        c, s = math.cos(turn), math.sin(turn)
        turning = np.array([[c, -s], [s, c]])
        matrix = rate * turning @ np.reshape(gradient, (2, 2)) @ turning.T
        velocity = -matrix @ places.mean(axis=0)
        fluid = attrs.evolve(origin.fluid, velocity=velocity, gradient=matrix.ravel())
        system = System(bodies, self.forces, method, fluid)
        watch = Watch(bodies, turns=self.flow == "shear")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", PlausibilityWarning)
            run = system.run(
                self.start.t[-1] + LONGEST / rate, start=self.start, watch=watch, record=False,
                jit=self.jit, max_steps=most_steps,
            )  # fmt: skip
        if run.status not in (Status.STOPPED, Status.FINISHED):
            return None
        return watch.opened

    def opening(self, precision: float = 5e-3) -> Opening:
        """The first rate of the ladder at which it opens, then by halves of the logarithm to a
        relative ``precision``.

        A doublet may hold again at higher rates: it is the first rung that counts.
        """
        used = []

        def opens_at(rate: float) -> bool | None:
            found, tolerance = self.answer(rate)
            used.append(tolerance)
            return found

        found = first_opening(opens_at, self.rate_of_spheres(), precision)
        return found._replace(tolerance=max(used))


def first_opening(
    opens_at: Callable[[float], bool | None], scale: float, precision: float
) -> Opening:
    """The Opening of what opens at some rates: ``opens_at(rate)`` is None where that fails."""
    holds, runs = math.nan, 0
    for rung in range(LEAST, MOST + 1):
        opens, runs = scale * 2.0**rung, runs + 1
        found = opens_at(opens)
        if found is None:
            return Opening(holds, math.nan, FAILED, runs)
        if found:
            break
        holds = opens
    else:
        return Opening(holds, math.nan, HOLDS, runs)
    if math.isnan(holds):
        return Opening(holds, opens, OPENS_AT_LEAST, runs)
    while opens > (1.0 + precision) * holds:
        middle, runs = math.sqrt(holds * opens), runs + 1
        found = opens_at(middle)
        if found is None:
            return Opening(holds, opens, FAILED, runs)
        holds, opens = (holds, middle) if found else (middle, opens)
    return Opening(holds, opens, OPENED, runs)
