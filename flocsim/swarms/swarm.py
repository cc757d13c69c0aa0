"""Swarm: many bodies in a fluid, the run of them, and its SwarmTrajectory."""

import functools
import math
import time
from collections.abc import Callable, Sequence
from typing import Any

import attrs
import numpy as np

from flocsim.body import Body, Fluid
from flocsim.compiler.composer import compose
from flocsim.errors import UsageError
from flocsim.fields import above_zero, check_whole, in_unit
from flocsim.forces.base import Force
from flocsim.forces.body_forces import kick_parameters
from flocsim.forces.drag import shields_clusters
from flocsim.forces.outline import refuse_outlines
from flocsim.forces.pair_resistance import refuse_pair_resistance
from flocsim.geometry.contact.points import PERIODIC
from flocsim.geometry.shapes.shape import Shape
from flocsim.hooks import observe
from flocsim.integrators.base import Integrator, Status
from flocsim.integrators.implicit import Implicit
from flocsim.integrators.loop.kicks import HALVINGS
from flocsim.state.scene import NO_BOX
from flocsim.swarms.arrays import swarm_of
from flocsim.swarms.grouping import find_islands, join_islands
from flocsim.swarms.islands import run_islands, watch_paths
from flocsim.swarms.placement import Leaving
from flocsim.swarms.progress import Effort, Progress
from flocsim.swarms.runner import Runner, ThreadArrays
from flocsim.swarms.together.bonds import BondGauge, Bonds
from flocsim.swarms.together.clusters import Clusters, Gauge, Neighbours, Shielding
from flocsim.system import System, check_bodies, check_forces, check_starts, read_seed


@attrs.frozen(eq=False, repr=False)
class SwarmTrajectory:
    """The motion of a swarm of n bodies.

    Attributes
    ----------
    t : (k,) float array
        Start, and the requested times [s].
    position, velocity : (k, n, 3) float array
        [m, m, rad] and [m/s, m/s, rad/s]; positions continue through a periodic box.
    error : (k,) float array
        Largest stated error of position of a body [m]; inf where one is not known.
    status : Status
        How the run ended.
    failed : int array or None
        Bodies of the island that ended the run early.
    effort : Effort
        Numbers of steps.
    wall_time : float
        [s]
    bodies : tuple of Body
    box : (float, float)
        Width and height of the periodic box [m]; inf along an axis that is not periodic.
    """

    t: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    error: np.ndarray
    status: Status
    failed: np.ndarray | None
    effort: Effort
    wall_time: float
    bodies: tuple[Body, ...]
    box: tuple[float, float]
    swarm: "Swarm"

    @functools.cached_property
    def gauge(self) -> Gauge:
        """Object that measures the gaps between the bodies."""
        return self.swarm.gauge()

    def __repr__(self) -> str:
        return (
            f"SwarmTrajectory({len(self.bodies)} bodies, {len(self.t)} times up to "
            f"{self.t[-1]:g} s, {self.status.name})"
        )

    def neighbours(self, at: int = -1, within: float = 0.0) -> Neighbours:
        """Return the pairs of bodies that touch or are nearer than a gap.

        Parameters
        ----------
        at : int
            Index of the time along ``t``.
        within : float
            Gap [m].

        Returns
        -------
        Neighbours
        """
        return self.gauge.neighbours(self.position[at], within)

    def clusters(self, at: int = -1, within: float = 0.0) -> Clusters:
        """Return the clusters of bodies that touch or are nearer than a gap.

        Parameters
        ----------
        at : int
            Index of the time along ``t``.
        within : float
            Gap [m].

        Returns
        -------
        Clusters
        """
        near = self.neighbours(at, within)
        return Clusters.of(self.bodies, self.position[at], self.velocity[at], near)

    def bonds(self, at: int = -1, within: float = 0.0) -> Bonds:
        """Return the kind of bond of every pair that touches or is nearer than a gap.

        Parameters
        ----------
        at : int
            Index of the time along ``t``.
        within : float
            Gap [m].

        Returns
        -------
        Bonds
            Certificate, hook, or rest (stable since the previous time of ``t``); or none that is
            known.
        """
        at = range(len(self.t))[at]
        motion = np.concatenate([self.position, self.velocity], axis=2)
        before = (float(self.t[at - 1]), motion[at - 1]) if at else None
        near = self.neighbours(at, within)
        return self.swarm.bond_gauge().bonds(float(self.t[at]), motion[at], near, before)

    def momentum(self, at: int = -1) -> np.ndarray:
        """Return the momentum Σ m v of all free bodies.

        Parameters
        ----------
        at : int
            Index of the time along ``t``.

        Returns
        -------
        (2,) float array
            [kg m/s]
        """
        mass = np.array([0.0 if body.fixed else body.mass for body in self.bodies])
        return mass @ self.velocity[at, :, :2]


LEAST_BOX = 3.0
"""A box that repeats itself is so many times as wide as the largest body at least: two bodies must
not meet in two places at once."""

MOST_STEPS = 200_000
"""Steps that an island may try in a window by default, as in studies."""

MANY = 200
"""Of more bodies than that, forces without a reach are refused: all of them would act on all."""


def read_box(box: Any) -> tuple[float, float]:
    """Periods along x and y [m], inf where nothing repeats; UsageError for anything else."""
    if box is None:
        return NO_BOX
    try:
        width, height = box
    except (TypeError, ValueError):
        raise UsageError(
            "box must be (width, height), with None for a side along which it is not periodic, "
            f"found {box!r}"
        ) from None
    sides = []
    for side, name in ((width, "width"), (height, "height")):
        endless = side is None or (isinstance(side, float) and side == math.inf)
        sides.append(math.inf if endless else above_zero(side, "m", f"the box's {name}"))
    return sides[0], sides[1]


@attrs.frozen(eq=False, repr=False)
class Swarm:
    """Many bodies in a fluid, moved as islands of interacting bodies.

    Parameters
    ----------
    bodies : sequence of Body
    forces : sequence of Force
    integrator : Integrator
    fluid : Fluid
        As for a System.
    box : (float or None, float or None), optional
        Width and height [m] of a periodic box; None for an axis that is not periodic.
    all_pairs : bool
        Allow forces without a finite reach for more than 200 bodies.
    seed : int or sequence of int
        As for a System.

    Raises
    ------
    UsageError
        If a force has no finite reach among more than 200 bodies, if the box is too small for the
        bodies and forces, or if the flow varies along a periodic axis.

    Notes
    -----
    Each island has its own time steps and contact lists between two common times; pair forces end
    at their reach.
    """

    bodies: tuple[Body, ...] = attrs.field(converter=check_bodies)
    forces: tuple[Force, ...] = attrs.field(default=(), converter=check_forces)
    integrator: Integrator = attrs.field(factory=Implicit)
    fluid: Fluid = attrs.field(factory=Fluid)
    box: tuple[float, float] = attrs.field(default=None, converter=read_box, kw_only=True)
    all_pairs: bool = attrs.field(default=False, kw_only=True)
    seed: tuple[int, ...] = attrs.field(default=0, converter=read_seed, kw_only=True)
    system: System = attrs.field(init=False, repr=False)

    def __attrs_post_init__(self) -> None:
        refuse_pair_resistance(self.forces, "a swarm")
        system = System(self.bodies, self.forces, self.integrator, self.fluid, seed=self.seed)
        object.__setattr__(self, "system", system)
        if all(body.fixed for body in self.bodies):
            raise UsageError("a Swarm needs at least one body that moves")
        refuse_outlines(self.forces, "a swarm")
        for name, force in system.pieces.used.items():
            many = len(self.bodies) > MANY and not self.all_pairs
            if many and getattr(force, "reach", 0.0) == math.inf:
                size = np.mean([body.shape.equivalent_radius for body in self.bodies])
                raise UsageError(
                    f"{name} has no finite reach, so each of {len(self.bodies)} bodies would act "
                    f"on all others: give it a property `reach`, for example {size:.1g} m, or set "
                    "all_pairs=True"
                )
        self.check_box()
        if kick_parameters(self.forces, self.bodies, self.fluid)[HALVINGS] > 0.0:
            raise UsageError(
                "all islands of a swarm need kicks of the same duration: give Thermal a kick, such "
                'as "1 ms", and leave finest out'
            )

    def __reduce__(self) -> tuple:
        made = functools.partial(type(self), box=self.box, all_pairs=self.all_pairs, seed=self.seed)
        return made, (self.bodies, self.forces, self.integrator, self.fluid)

    def __repr__(self) -> str:
        return repr(self.system).replace("System", "Swarm")

    @property
    def reach(self) -> float:
        """Largest gap at which a pair force acts [m]."""
        return max(0.0, self.system.pieces.surface_reach, self.system.pieces.centre_reach)

    def gauge(self) -> Gauge:
        """Return an object that measures the gaps of the bodies at any positions."""
        return Gauge(self.system.scene()._replace(box=self.box), self.fillings())

    def bond_gauge(self) -> BondGauge:
        """Return an object that finds the kinds of bonds at any positions."""
        return BondGauge(self)

    def check_box(self) -> None:
        """Raise UsageError if the box is too small for the bodies and forces, or the flow is not
        periodic.
        """
        if min(self.box) == math.inf:
            return
        check_box([body.shape for body in self.bodies if not body.fixed], self.box, self.reach)
        xx, xy, yx, yy = self.fluid.gradient
        for side, changes, axis in ((self.box[0], (xx, yx), "x"), (self.box[1], (xy, yy), "y")):
            if side < math.inf and any(changes):
                raise UsageError(FLOW_ADVICE.format(axis=axis))

    def check_overlaps(self, gauge: Gauge) -> None:
        """Raise UsageError if two bodies start with crossing cores or too deep an overlap, and warn
        of a deep one.

        Two fixed bodies may overlap.
        """
        position, _ = self.system.motion()
        near = gauge.neighbours(position)
        check_starts(
            (j, i, self.bodies[i].shape.placed_parts(*vector, self.bodies[i].angle),
             self.bodies[j].shape.placed_parts(0.0, 0.0, self.bodies[j].angle))
            for (i, j), vector in zip(near.pairs.tolist(), near.vector, strict=True)
        )  # fmt: skip

    def begin(
        self, until: float, *, threads: int = 1, max_steps: int = MOST_STEPS,
        leaving: Leaving | None = None,
    ) -> Progress:  # fmt: skip
        """Return a Progress to a time [s] that has not taken a step yet.

        ``leaving``: rule for bodies that leave the box.
        """
        scene = self.system.scene()._replace(box=self.box)
        fillings = {**self.system.compiled_calls, **self.fillings()}
        what = f"the engine for swarms of {self.system.family}"
        runner = Runner(
            compose(find_islands, {}), compose(join_islands, {}),
            compose(run_islands, fillings, what=what), self.integrator,
            [ThreadArrays(scene) for _ in range(threads)], max_steps, self.box, self.reach,
        )  # fmt: skip
        swarm = swarm_of(scene, *self.system.motion(), self.integrator.fresh_clock())
        shielding = None
        if shields_clusters(self.forces):
            shielding = Shielding(self.bodies, self.forces, self.gauge())
        return Progress(runner, swarm, until, leaving, shielding)

    def fillings(self) -> dict[Callable, Callable]:
        """Return {hook: function} of integrator, shapes and path recording.

        They are the same with and without a box, so that one compiled engine serves both.
        """
        return {**self.system.fillings({observe: watch_paths}, grows=True), **PERIODIC}

    def run(
        self, until: float | str, *, every: float | str | None = None,
        times: Sequence[float] | None = None, threads: int = 1, max_steps: int = MOST_STEPS,
        watch: Callable[[float], bool] | None = None,
    ) -> SwarmTrajectory:  # fmt: skip
        """Move the bodies until a time.

        Parameters
        ----------
        until : float or str
            End time [s], or a text such as "10 s".
        every : float or str, optional
            Interval between the stored times [s].
        times : sequence of float, optional
            Stored times [s], instead of ``every``. Without either, start and end are stored.
        threads : int
            Number of threads; results do not depend on it.
        max_steps : int
            Largest number of steps of an island of up to 50 bodies between two common times; for n
            > 50 bodies it is 50/n of this number.
        watch : callable, optional
            Function of the time [s], called at every common time; the run stops if it returns true.

        Returns
        -------
        SwarmTrajectory
            Its ``status`` says why a run ended early: with STEP_BUDGET, ``failed`` has the bodies
            of the island that needed more steps.

        Raises
        ------
        UsageError
            If an argument is wrong, or two bodies start with too deep an overlap.
        """
        end = above_zero(until, "s", "until")
        check_whole(max_steps, 0, "max_steps")
        check_whole(threads, 1, "threads")
        stops = stops_of(end, every, times)
        began = time.perf_counter()
        self.check_overlaps(self.gauge())
        progress = self.begin(end, threads=threads, max_steps=max_steps)
        seen, status = [progress.seen()], Status.FINISHED
        for stop in stops:
            status = Status.PAUSED
            while status == Status.PAUSED:
                status = progress.advance(stop)
                common = status in (Status.PAUSED, Status.FINISHED)
                if common and watch is not None and watch(progress.time) and progress.time < end:
                    status = Status.STOPPED
            seen.append(progress.seen())
            if status != Status.FINISHED:
                break
        t, motion, error = (np.array(column) for column in zip(*seen, strict=True))
        places, rates = motion[:, :, :3], motion[:, :, 3:]
        ended = status, progress.failed, progress.effort, time.perf_counter() - began
        return SwarmTrajectory(t, places, rates, error, *ended, self.bodies, self.box, self)


FLOW_ADVICE = (
    "the flow varies along {axis}, but the box is periodic along {axis}: images of a body would "
    "move at a different speed. Make the box periodic along the other axis only, as in a shear "
    'flow u_x = g y with periodic = "x", or not at all, periodic = "none" (leaving = "reenter" '
    "returns bodies that the flow carries out)"
)


def check_box(shapes: Sequence[Shape], box: tuple[float, float], reach: float) -> None:
    """UsageError for a box that repeats itself, inf along other axes, in which bodies of some
    shapes, on which forces act up to a gap [m], would meet themselves."""
    side = min(box)
    largest = max(shape.bounding_radius for shape in shapes)
    least = LEAST_BOX * (2.0 * largest + reach)
    if side < least:
        raise UsageError(
            f"the box is {side:.6g} m wide, but forces reach {reach:.3g} m between bodies of up to "
            f"{2.0 * largest:.3g} m: make the box at least {(1.0 + 1e-5) * least:.6g} m wide, or "
            "cut the forces at a smaller gap"
        )


def stops_of(end: float, every: float | str | None, times: Sequence[float] | None) -> list[float]:
    """The times that a run is to keep [s], ``end`` the last; UsageError for what are none."""
    if times is not None and every is not None:
        raise UsageError("give only one of times and every, found both")
    if times is not None:
        listed = [float(in_unit(each, "s", "times")) for each in times]
        if sorted(set(listed)) != listed or not all(0.0 < each <= end for each in listed):
            raise UsageError(
                f"times must increase from above 0 s to at most {end:g} s, found {times}"
            )
        return listed if listed and listed[-1] == end else [*listed, end]
    if every is None:
        return [end]
    step = above_zero(every, "s", "every")
    count = max(1, round(end / step))
    whole = abs(count * step - end) <= 1e-9 * end
    kept = [step * number for number in range(1, count if whole else math.ceil(end / step))]
    return [each for each in kept if each < end] + [end]
