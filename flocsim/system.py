"""System: bodies, forces, an integrator and a fluid; running one returns a Trajectory."""

import functools
import math
import time
import warnings
from collections.abc import Callable, Iterable
from itertools import combinations
from typing import Any

import attrs
import numpy as np

from flocsim.body import Body, Fluid, of_forces, scene_of
from flocsim.compiler.composer import compose
from flocsim.errors import KernelError, KernelWarning, PlausibilityWarning, UsageError
from flocsim.explain import explain
from flocsim.fields import above_zero, check_whole, is_whole, only
from flocsim.forces.base import Force
from flocsim.forces.body_forces import kick_parameters, random_key
from flocsim.forces.codegen import Pieces, laws_of
from flocsim.forces.dlvo import refuse_unlike_potentials
from flocsim.forces.drag import resistance_numbers, shields_clusters
from flocsim.forces.outline import smoothing_of
from flocsim.forces.pair_resistance import pair_resistance_tables, resistance_of_pairs
from flocsim.geometry.contact.near_pairs import SPHERES_ONLY
from flocsim.geometry.contact.points import overlap_fault
from flocsim.geometry.shapes.cores import Parts
from flocsim.hooks import HOOKS, awaits_touch, compiled_calls, law_table
from flocsim.integrators.amplification import amplification_of
from flocsim.integrators.base import Integrator, Status
from flocsim.integrators.implicit import Implicit
from flocsim.integrators.left_out import left_out
from flocsim.integrators.loop.driver import drive
from flocsim.plausibility import plausibility_warnings
from flocsim.run import UNABLE, Run, force_to_blame
from flocsim.state.scene import NO_OUTLINES, Scene
from flocsim.state.work import NOW, copy_of, work_of
from flocsim.trajectories.replay import Origin
from flocsim.trajectories.trajectory import Trajectory, Watch, watched

DEEP_START = 0.05
"""Overlap, as a share of r_i + r_j, from which on a start is implausible: contacts are usually
pressed by 1 % at most."""

Fillings = dict[Callable, Callable]
"""{hook of flocsim.hooks.HOOKS: its replacement}."""


def as_tuple(values: Any, what: str) -> tuple:
    """Return a sequence as a tuple; raise UsageError for a single object."""
    try:
        return tuple(values)
    except TypeError:
        raise UsageError(f"{what} must be a list, found {values!r}: write [{what}]") from None


def check_bodies(bodies: Iterable[Body]) -> tuple[Body, ...]:
    """Return the bodies as a tuple; raise UsageError for none, or for another object."""
    bodies = as_tuple(bodies, "bodies")
    if not bodies:
        raise UsageError("a System needs at least one Body")
    for body in bodies:
        if not isinstance(body, Body):
            raise UsageError(f"bodies must be flocsim Body objects, found {body!r}")
    return bodies


def check_forces(forces: Iterable[Force]) -> tuple[Force, ...]:
    """Return the forces as a tuple; raise UsageError for a class in the place of an object."""
    forces = as_tuple(forces, "forces")
    for force in forces:
        if isinstance(force, type) and issubclass(force, Force):
            raise UsageError(
                f"forces must be objects, found the class {force.__name__}: write "
                f"{force.__name__}(…) with its parameters"
            )
    return forces


def check_starts(pairs: Iterable[tuple[int, int, Parts, Parts]], most: float = math.inf) -> None:
    """Raise UsageError for placed bodies (number, number, parts, parts) that overlap too deeply.

    Warn of the first that overlap more than contacts do. ``most``: largest overlap [m] for forces
    along outlines.
    """
    deep = ""
    for i, j, a, b in pairs:
        if fault := overlap_fault(a, b, most):
            raise UsageError(f"bodies {i} and {j} start {fault}; move them apart")
        if not deep and (fault := overlap_fault(a, b, most, DEEP_START)):
            deep = f"bodies {i} and {j} start {fault}: they will be flung apart; move them apart"
    if deep:
        warnings.warn(deep, PlausibilityWarning, stacklevel=4)


def read_seed(value: Any) -> tuple[int, ...]:
    """Return a non-negative integer, or several, as a tuple; raise UsageError for anything else."""
    numbers = (value,) if is_whole(value) else as_tuple(value, "seed")
    if not numbers or not all(is_whole(each) and each >= 0 for each in numbers):
        raise UsageError(f"seed must be a whole number from 0, or some of them, found {value!r}")
    return tuple(int(each) for each in numbers)


@attrs.frozen(eq=False, repr=False)
class System:
    """Bodies in a fluid, the forces on them, and the integrator of their motion.

    Parameters
    ----------
    bodies : iterable of Body
    forces : iterable of Force, optional
    integrator : Integrator, optional
        Implicit by default.
    fluid : Fluid, optional
    seed : int or sequence of int, optional
        Seed of random forces, e.g. (seed, replicate).

    Raises
    ------
    UsageError
        If an argument has the wrong type, or bodies and forces cannot be combined.
    KernelError
        If a kernel of a force cannot be used.

    Examples
    --------
    >>> from flocsim.forces import Gravity, StokesDrag
    >>> body = Body(Sphere(5e-6), density=2650.0)
    >>> System([body], [Gravity(), StokesDrag()]).run(until=1e-3).status.name
    'FINISHED'
    """

    bodies: tuple[Body, ...] = attrs.field(converter=check_bodies)
    forces: tuple[Force, ...] = attrs.field(default=(), converter=check_forces)
    integrator: Integrator = attrs.field(
        factory=Implicit, validator=only(Integrator, "the integrator must be an Integrator object")
    )
    fluid: Fluid = attrs.field(
        factory=Fluid, validator=only(Fluid, "the fluid must be a Fluid object")
    )
    seed: tuple[int, ...] = attrs.field(default=0, converter=read_seed, kw_only=True)
    pieces: Pieces = attrs.field(init=False, repr=False)

    def __attrs_post_init__(self) -> None:
        refuse_unlike_potentials(self.forces, len(self.bodies))
        shapes = [body.shape for body in self.bodies]
        object.__setattr__(self, "pieces", laws_of(self.forces, self.fluid, shapes))
        pair_resistance_tables(self.forces, self.bodies, self.fluid)

    def __repr__(self) -> str:
        n = len(self.bodies)
        words = [f"{n} {'body' if n == 1 else 'bodies'}"]
        words += [type(force).__name__ for force in self.forces]
        return f"System({', '.join([*words, type(self.integrator).__name__])})"

    def changed(self, **fields: Any) -> "System":
        """Return a copy with as many other ``bodies``, or another ``seed``; they are not checked
        again.

        The laws are reused, except for forces between outlines, which depend on the shapes. Raises
        UsageError if a pair resistance does not support the bodies.
        """
        # Parameters of forces between outlines depend on the shapes: construct anew.
        if "bodies" in fields:
            if self.pieces.outlines != NO_OUTLINES:
                return attrs.evolve(self, **fields)
            pair_resistance_tables(self.forces, fields["bodies"], self.fluid)
        # Bypass the constructor, which would generate and check the laws again.
        other = object.__new__(type(self))
        for each in attrs.fields(type(self)):
            value = fields.get(each.name, getattr(self, each.name))
            object.__setattr__(other, each.name, value)
        return other

    def __reduce__(self) -> tuple:
        # Laws are functions made of generated text: a copy makes its own.
        made = functools.partial(type(self), seed=self.seed)
        return made, (self.bodies, self.forces, self.integrator, self.fluid)

    @property
    def spheres_only(self) -> bool:
        """True if no body has an edge."""
        return all(len(body.shape.vertices) == 1 for body in self.bodies)

    @property
    def family(self) -> str:
        """Family of shapes to compile for: "spheres" or "polygons"."""
        return "spheres" if self.spheres_only else "polygons"

    @property
    def reached(self) -> dict[str, bool]:
        """Optional parts of an engine that its forces use (flocsim.integrators.left_out).

        Two systems of one family with the same parts share their compiled code.
        """
        return {
            "outlines": bool({"outline_pressure", "oriented_energy"} & self.pieces.laws.keys())
            or self.pieces.layer[2] > 0.0,
            "charges": self.pieces.layer[2] > 0.0,
            "plain": self.pieces.plain_bodies,
            "sliding": "slip_limit" in self.pieces.laws,
            "water": resistance_of_pairs(self.forces) is not None,
        }

    def scene(self, *, jit: bool = True, laws: Any = None, near: bool = False) -> Scene:
        """Return the bodies as a Scene, with the laws of their forces or with given ``laws``.

        ``near``: whether bodies that come near count even if no force acts there. Raises
        KernelError for a law that cannot be compiled.
        """
        shapes = [body.shape for body in self.bodies]
        pair_table, water = pair_resistance_tables(self.forces, self.bodies, self.fluid)
        return scene_of(
            self.bodies, self.fluid, **of_forces(self.pieces),
            laws=self.laws(jit=jit) if laws is None else laws,
            smoothing=smoothing_of(self.pieces.smoothness, shapes),
            kicks=kick_parameters(self.forces, self.bodies, self.fluid, near),
            key=random_key(*self.seed),
            resistances=[resistance_numbers(self.forces, body) for body in self.bodies],
            pair_table=pair_table, water=water,
        )  # fmt: skip

    def laws(self, *, jit: bool = True) -> Any:
        """Return the laws of the scene, compiled unless ``jit=False``.

        Raises KernelError, with the name of the force, for a law that cannot be compiled.
        """
        try:
            return law_table(self.pieces.laws, jit=jit, plain=self.pieces.plain_bodies)
        except KernelError as error:
            # Find the force at fault: compile the laws of each force alone.
            for name, force in self.pieces.used.items():
                try:
                    its = laws_of([force], self.fluid)
                    law_table(its.laws, jit=jit, plain=its.plain_bodies)
                except KernelError as its_own:
                    raise KernelError(f"{name}: {its_own}") from None
            raise error from None

    def motion(self) -> tuple[np.ndarray, np.ndarray]:
        """Return initial positions and velocities, (n, 3) each."""
        position = [(*body.position, body.angle) for body in self.bodies]
        velocity = [(*body.velocity, body.spin) for body in self.bodies]
        return np.array(position, dtype=float), np.array(velocity, dtype=float)

    def fillings(self, observer: Fillings | None = None, *, grows: bool = False) -> Fillings:
        """Return {hook: replacement} of integrator, shapes and observer.

        ``grows``: whether the driver must serve any number of bodies.
        """
        shapes = SPHERES_ONLY if self.spheres_only else {}
        needless = left_out(math.inf if grows else len(self.bodies), **self.reached)
        filled = {**self.integrator.fillings, **needless, **shapes, **(observer or {})}
        # Only registered hooks can be replaced.
        for replaced in filled.keys() - set(HOOKS.values()):
            raise UsageError(
                f"{replaced.__module__}.{replaced.__qualname__} cannot be replaced: "
                "flocsim.hooks.HOOKS lists what can"
            )
        return filled

    @property
    def compiled_calls(self) -> Fillings:
        """{hook: replacement} by which a compiled driver calls the laws of the scene."""
        return compiled_calls(self.pieces.plain_bodies)

    def compose(
        self, entry: Callable = drive, observer: Fillings | None = None, *, jit: bool = True
    ) -> Callable:
        """Return the driver of this family of scenes as one function, compiled unless
        ``jit=False``."""
        calls = self.compiled_calls if jit else {}
        what = f"the engine for {self.family}"
        return compose(entry, {**calls, **self.fillings(observer)}, jit=jit, what=what)

    def check_overlaps(self) -> None:
        """Raise UsageError if two bodies start with crossing cores or too deep an overlap, and warn
        of a deep one.

        With forces along outlines the limit is d_min. Fixed bodies may overlap: they do not
        interact.
        """
        reach, d_min, *_ = self.pieces.outlines
        most = d_min if reach > 0.0 else math.inf
        placed = [each.shape.placed_parts(*each.position, each.angle) for each in self.bodies]
        pairs = [
            (i, j, placed[i], placed[j])
            for i, j in combinations(range(len(placed)), 2)
            if not (self.bodies[i].fixed and self.bodies[j].fixed)
        ]
        check_starts(pairs, most)

    def run(
        self, until: float | str, *, max_steps: int = 1_000_000, record: bool = True,
        amplification: bool = False, jit: bool = True, start: Trajectory | None = None,
        watch: Watch | None = None,
    ) -> Trajectory:  # fmt: skip
        """Move the bodies until a time and return the Trajectory.

        Parameters
        ----------
        until : float or str
            End time, in s or as a text such as "20 ms".
        max_steps : int
            Budget of steps.
        record : bool
            Whether every accepted step is stored.
        amplification : bool
            Whether to run a perturbed companion as well, for Trajectory.amplification.
        jit : bool
            False runs uncompiled.
        start : Trajectory, optional
            Continue at the end of another run of the same shapes: its time, motion and tangential
            displacements. Forces, masses and the method may differ.
        watch : callable, optional
            ``watch(state)`` is called between steps (every 0.1 ms or so) and stops the run, as
            STOPPED, by returning a true value.

        Returns
        -------
        Trajectory
            A run that ends early says why in ``status``; it raises no exception.

        Raises
        ------
        UsageError
            For bodies that overlap too deeply, or arguments that cannot be combined.

        Warns
        -----
        KernelWarning
            If a force returned no number and ended the run: its name, file and line.
        PlausibilityWarning
            Once for each implausible property of the scene.
        """
        end = above_zero(until, "s", "until")
        check_whole(max_steps, 0, "max_steps")
        if shields_clusters(self.forces):
            raise UsageError(
                "a System does not find clusters: run a Swarm, or leave clusters out of the drag"
            )
        if start is None:
            self.check_overlaps()
        elif amplification:
            raise UsageError("amplification can only be found for a whole run: leave start out")
        if watch is not None and not callable(watch):
            raise UsageError(f"watch must be a function of a State, found {watch!r}")
        for line in plausibility_warnings([self]):
            warnings.warn(line, PlausibilityWarning, stacklevel=2)
        began = time.perf_counter()

        fresh = functools.partial(self.begin_at, start, end, max_steps=max_steps, jit=jit)
        run = fresh(record=record)
        # The run itself; a force that returned no number is identified afterwards.
        status = watched(run, watch)
        if status in UNABLE and (why := force_to_blame(self, run.work, run.clock.time)):
            warnings.warn(f"the run ended at t = {run.time:.6g} s ({status.name}): {why}",
                          KernelWarning, stacklevel=2)  # fmt: skip
        measure = None
        if start is None:
            measure = functools.partial(
                self.amplification, run.time, run.work.place[NOW].copy(), max_steps, jit=jit
            )
        growth = measure() if measure is not None and amplification else None
        legs = ((run.steps, end),)
        origin = Origin(
            self.bodies, self.forces, self.fluid, self.integrator, fresh, run, legs, measure
        )
        return Trajectory.of(run, status, time.perf_counter() - began, growth, origin=origin)

    def begin_at(self, start: Trajectory | None, until: float, **more: Any) -> Run:
        """Return a Run as `begin` does, at the end of another run if there is a ``start``."""
        run = self.begin(until, **more)
        return run if start is None else self.placed_at_end(run, start)

    def placed_at_end(self, run: Run, start: Trajectory) -> Run:
        """Place a fresh Run at the end of another one, with the history of its contacts.

        Raises UsageError if that has other shapes, or has already reached this run's end time.
        """
        if not isinstance(start, Trajectory):
            raise UsageError(
                "start must be a Trajectory, from whose end this run continues, found "
                f"{type(start).__name__}: give the result of an earlier run"
            )
        origin = start.known()
        if run.clock.until <= start.t[-1]:
            raise UsageError(
                f"until must be a time above {start.t[-1]:g} s, the end of start, found "
                f"{run.clock.until:g}"
            )
        scene = origin.ended.scene
        # Contacts are stored by the numbers of bodies and features: shapes and order must be the
        # same.
        if not all(
            np.array_equal(own, other)
            for own, other in (
                (run.scene.first, scene.first), (run.scene.vertices, scene.vertices),
                (run.scene.bodies["radius"], scene.bodies["radius"]),
            )
        ):  # fmt: skip
            raise UsageError("start must be a run of the same shapes in the same order")
        # The end of the other run stays as it is: several runs may start there.
        run.work = copy_of(origin.ended.work)
        run.work.budget[:] = -1.0  # rebuild the lists: other forces may reach further
        if (run.scene.kicks, run.scene.key) != (scene.kicks, scene.key):
            run.work.kick.duration = 0.0  # no kick has begun
        # Count from zero, and go on with time and stated error of the other run.
        run.work.tally.rebuilds = 0
        run.work.tally.evaluations = 0
        run.clock.time = start.t[-1]
        if np.isfinite(start.error) and np.isfinite(run.clock.tolerance):
            run.clock.error = start.error
        run.saved = [run.row_now()]
        return run

    def amplification(
        self, until: float, end: np.ndarray, max_steps: int = 1_000_000, *,
        nudge: float | None = None, jit: bool = True,
    ) -> float:  # fmt: skip
        """Return by which factor the motion up to a time [s] amplifies a perturbation of its start.

        It is the distance of any outline point at ``end`` (n, 3), the final positions, from that
        point in a companion run whose moving bodies start ``nudge`` [m] further in fixed
        directions, over the nudge (default: amplification.NUDGE of a radius). inf if the companion
        ends early.
        """

        def companion(bodies: list[Body]) -> np.ndarray | None:
            run = attrs.evolve(self, bodies=bodies).begin(until, max_steps=max_steps, jit=jit)
            ended = run.to_end() == Status.FINISHED
            return run.work.place[NOW] if ended else None

        return amplification_of(self.bodies, end, companion, nudge)

    def begin(
        self,
        until: float,
        *,
        max_steps: int = 1_000_000,
        record: bool = False,
        observer: Fillings | None = None,
        observed: np.ndarray | None = None,
        jit: bool = True,
    ) -> Run:
        """Return a Run to a time [s] that has not taken a step yet.

        ``observer`` {hook: replacement} may replace hooks.observe and hooks.awaits_touch;
        ``observed`` is the array that they receive.
        """
        scene = self.scene(jit=jit, near=awaits_touch in (observer or {}))
        return Run(
            self.compose(observer=observer, jit=jit), scene, work_of(scene, *self.motion()),
            self.integrator, until, max_steps=max_steps, observed=observed, record=record,
        )  # fmt: skip

    def explain(self) -> str:
        """Return a text on what this scene contains and leaves out, with reasons.

        It ends with Reynolds numbers, time scales, the step that an explicit method would need, and
        a line on everything implausible.
        """
        return explain(self)
