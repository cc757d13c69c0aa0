"""A run gone through again: the state within steps, contacts, forces and their work.

A run is the same each time, so nothing of this has to be kept: it is found when it is asked for.
Forces are summed by the engine's own functions, uncompiled, for one force at a time.
"""

import copy
import functools
from collections.abc import Callable, Iterator, Sequence

import attrs
import numpy as np

from flocsim.body import Body, Fluid, of_forces
from flocsim.forces.base import ContactForce, Force, force_names
from flocsim.forces.codegen import laws_of
from flocsim.forces.pair_resistance import PairResistance
from flocsim.geometry.contact.body_pairs import lists_all_pairs
from flocsim.geometry.contact.candidates import rebuild_list
from flocsim.geometry.contact.points import contact_point, locate_contacts
from flocsim.hooks import CONTACT_FORCE, contact_force, has, law_table
from flocsim.integrators.base import Integrator
from flocsim.integrators.events.first_event import set_closed
from flocsim.integrators.exponential.series import evaluate_all
from flocsim.integrators.implicit import Implicit, Overdamped
from flocsim.integrators.radau.collocation import interpolate, stage_weights
from flocsim.integrators.radau.tableau import SECOND_STAGE, THIRD_STAGE
from flocsim.integrators.rhs.forces import sum_forces
from flocsim.integrators.rhs.surface_gap import flag_near
from flocsim.integrators.rhs.views import contact_view
from flocsim.run import Run
from flocsim.state.clock import NEVER, RADAU, SERIES
from flocsim.state.scene import NO_WATER, Scene
from flocsim.state.work import (
    FIRST_STAGE,
    MOTION,
    NOW,
    START,
    TRIAL,
    Work,
    copy_of,
    motion_of,
    put_motion,
    with_room,
)

Slips = dict[tuple[int, int, int, int], float]
"""{(body and core point of the vertex, body and first core point of the edge): ξ [m]}."""


@attrs.frozen(eq=False)
class Origin:
    """What a Trajectory came from: its scene, a way to begin its run anew, and the run at its end.

    ``begin()`` makes a Run that has yet to take its first step and records nothing; ``legs``: the
    stretches that it ran, each (steps taken by its end, the time [s] until which it was to run);
    ``measure_growth()`` runs a perturbed companion, and returns Trajectory.amplification.
    """

    bodies: tuple[Body, ...]
    forces: tuple[Force, ...]
    fluid: Fluid
    integrator: Integrator
    begin: Callable[[], Run]
    ended: Run
    legs: tuple[tuple[int, float], ...]
    measure_growth: Callable[[], float] | None = None

    @property
    def has_stages(self) -> bool:
        """Whether the method has stages with a cubic through them."""
        return isinstance(self.integrator, Implicit)


@attrs.frozen
class Contact:
    """One contact point: two bodies whose outlines overlap there.

    ``bodies``: numbers of the two; ``point`` (x, y) [m], the middle of the overlap; ``normal``, the
    unit vector from the second to the first; ``overlap`` [m]; ``slip`` [m], the tangential elastic
    displacement ξ; ``force`` (f_n, f_t) [N] on the first, along the normal and along the tangent,
    which is the normal turned by +90°.
    """

    bodies: tuple[int, int]
    point: tuple[float, float]
    normal: tuple[float, float]
    overlap: float
    slip: float
    force: tuple[float, float]


@attrs.frozen(eq=False)
class Instant:
    """Everything at one time: ``work`` has state NOW, its pairs located and flagged."""

    time: float
    scene: Scene
    work: Work

    def forces(self, scene: Scene) -> np.ndarray:
        """(n, 3) force and torque on every body [N, N, N m] of a scene with these or other laws."""
        sum_forces(scene, self.work, self.time, NOW)
        return self.work.force[NOW].copy()

    def contacts(self) -> list[Contact]:
        """All contact points."""
        work, found = self.work, []
        for row in np.flatnonzero(work.candidates[: work.tally.candidates]["contact_mode"] == 1):
            candidate = work.candidates[row]
            a, b = int(candidate.vertex_body), int(candidate.edge_body)
            geometry, (x, y, _) = work.geometry[NOW, row], work.place[NOW, a]
            dx, dy = contact_point(work, row, a)
            force = (0.0, 0.0)
            if has(self.scene, CONTACT_FORCE):
                force = contact_force(self.scene, contact_view(self.scene, work, NOW, row))
            normal = float(geometry.normal_x), float(geometry.normal_y)
            depth, slip = float(-geometry.gap), float(work.slip[NOW, row])
            push = float(force[0]), float(force[1])
            found.append(Contact((a, b), (float(x + dx), float(y + dy)), normal, depth, slip, push))
        return found


class Replay:
    """A run gone through again, forwards."""

    def __init__(self, origin: Origin) -> None:
        self.origin, self.run, self.leg = origin, origin.begin(), 0
        self.run.counts.max_steps = NEVER
        self.run.clock.until = origin.legs[0][1]
        self.scene = self.scene_of(origin.forces)

    def scene_of(self, forces: Sequence[Force]) -> Scene:
        """The run's scene with the laws of these of its forces, uncompiled."""
        shapes = [body.shape for body in self.origin.bodies]
        pieces = laws_of(forces, self.origin.fluid, shapes)
        scene = self.run.scene._replace(laws=law_table(pieces.laws, jit=False), **of_forces(pieces))
        if any(isinstance(force, PairResistance) for force in forces):
            return scene
        return scene._replace(pair_table=NO_WATER[0], water=NO_WATER[1])

    @functools.cached_property
    def single_scenes(self) -> dict[str, Scene]:
        """{name of a force: the scene with it alone}."""
        forces = self.origin.forces
        named = zip(force_names(forces), forces, strict=True)
        return {name: self.scene_of([force]) for name, force in named}

    def to_step(self, step: int) -> None:
        """Go on until so many steps of the trajectory have been taken."""
        legs = self.origin.legs
        while self.run.steps < step:
            last = legs[self.leg][0]
            if self.run.steps >= last and self.leg + 1 < len(legs):
                self.leg += 1
                self.run.clock.until = legs[self.leg][1]
                continue
            self.run.advance(min(step, last) - self.run.steps)

    def instants(self, times: Sequence[float] | np.ndarray, steps: np.ndarray) -> Iterator[Instant]:
        """The Instant at each of these times [s], in increasing order.

        ``steps`` (k,): the times of the trajectory's start and steps.
        """
        for time in times:
            step = int(np.searchsorted(steps, time, side="right")) - 1
            if steps[step] == time:
                self.to_step(step)
                yield self.instant(time, motion_of(self.run.work, NOW), self.slips())
                continue
            yield self.instant(time, *self.within(float(time), step, steps))

    def within(self, time: float, step: int, steps: np.ndarray) -> tuple[np.ndarray, Slips]:
        """(motion (n, 6), tangential displacements) at a time inside of the step after so many.

        The step is taken by a copy of the run, so that it can be asked about again.
        """
        self.to_step(step)
        begin, end = float(steps[step]), float(steps[step + 1])
        ahead = copy.copy(self)
        ahead.run = self.run.copy()
        ahead.to_step(step + 1)
        start, before, after = motion_of(self.run.work, NOW), self.slips(), ahead.slips()
        share = (time - begin) / (end - begin)
        slips = {
            key: (1.0 - share) * before.get(key, 0.0) + share * after.get(key, 0.0)
            for key in before.keys() | after.keys()
        }
        return step_motion(ahead.run, start, begin, end, time), slips

    def slips(self) -> Slips:
        """The tangential displacements of all listed pairs now."""
        work = self.run.work
        rows = range(work.tally.candidates)
        return {key_of(work, row): float(work.slip[NOW, row]) for row in rows}

    def instant(self, time: float, motion: np.ndarray, slips: Slips) -> Instant:
        """The Instant of a motion (n, 6) near where the run is now."""
        work = copy_of(self.run.work)
        put_motion(work, NOW, motion)
        touching = has(self.scene, CONTACT_FORCE) or self.scene.listed_reach > 0.0
        if touching or not lists_all_pairs(work):
            while not work.tally.candidates and not rebuild_list(self.scene, work):
                work = with_room(work)
        if touching:
            locate_contacts(self.scene, work, NOW)
            set_closed(work)
            for row in range(work.tally.candidates):
                work.slip[NOW, row] = slips.get(key_of(work, row), 0.0)
            if self.scene.listed_reach > 0.0:
                flag_near(self.scene, work, NOW, 0.0)
        return Instant(float(time), self.scene, work)


def key_of(work, row):
    pair = work.candidates[row]
    return pair.vertex_body, pair.vertex, pair.edge_body, pair.edge_start


def step_motion(run: Run, start: np.ndarray, begin: float, end: float, time: float) -> np.ndarray:
    """The motion (n, 6) at a time inside of the step that a run has just taken.

    Of implicit methods the series or the cubic through the stages, which the engine itself goes by;
    of others, and where the stages are no longer those of the step, Hermite's through both ends.
    """
    work, clock = run.work, run.clock
    if work.tally.kind == SERIES and np.array_equal(motion_of(work, START), start):
        whole, terms = float(work.tally.series_step), int(work.tally.series_terms)
        evaluate_all(work, MOTION, START, terms, whole, (time - begin) / whole, TRIAL)
        return motion_of(work, TRIAL)
    stages = np.array(
        [motion_of(work, each) for each in (START, FIRST_STAGE, SECOND_STAGE, THIRD_STAGE)]
    )
    whole = float(clock.stages_step)
    if whole == 0.0 and np.array_equal(stages[3], motion_of(work, NOW)):
        whole = end - begin
    own = work.tally.kind == RADAU and clock.stages_time == begin and whole > 0.0
    if not own or not np.array_equal(stages[0], start):
        return hermite(begin, end, start, motion_of(work, NOW), time)
    return interpolate(stage_weights((time - begin) / whole), *stages)


def motion_at(times: np.ndarray, states: np.ndarray, time: float) -> np.ndarray:
    """The motion (n, 6) at a time among those (k,) of states (k, n, 6) [s]: at one of them, that
    state; between two, Hermite's cubic."""
    step = int(np.searchsorted(times, time, side="right")) - 1
    if times[step] == time:
        return states[step]
    step = min(step, len(times) - 2)  # the times of a file may not rise
    return hermite(times[step], times[step + 1], states[step], states[step + 1], time)


def hermite(
    begin: float, end: float, start: np.ndarray, stop: np.ndarray, time: float
) -> np.ndarray:
    """The motion (n, 6) of the cubic with the places and velocities (n, 6) at both ends."""
    h = end - begin
    s = (time - begin) / h
    x, v, y, w = start[:, :3], start[:, 3:], stop[:, :3], stop[:, 3:]
    # In changes, so that what does not move stays just where it is.
    place = x + s * s * (3.0 - 2.0 * s) * (y - x)
    place = place + h * s * (1.0 - s) * ((1.0 - s) * v - s * w)
    rate = 6.0 * s * (1.0 - s) * (y - x) / h
    rate = rate + (1.0 - s) * (1.0 - 3.0 * s) * v + s * (3.0 * s - 2.0) * w
    return np.concatenate([place, rate], axis=1)


LOBATTO = 0.5 + 0.5 * (3.0 / 7.0) ** 0.5 * np.array([-1.0, 0.0, 1.0])
"""The points of Lobatto's rule between the ends of a step."""

LOBATTO_WEIGHTS = (1 / 20, 49 / 180, 16 / 45, 49 / 180, 1 / 20)
"""Its weights, those of the ends included."""


@attrs.frozen(eq=False)
class Energies:
    """Kinetic energies and work over a run.

    ``t`` (k,) [s]; ``kinetic`` (k, n) ½ m v² + ½ I ω² of every body [J]; ``work`` {force: (k,)}
    done on all free bodies since the start [J], by Lobatto's rule over each step, on the
    integrator's interpolation. Contacts are stiff within steps: theirs, "contact", is what the
    balance Δ(kinetic) = Σ work leaves. ``error`` (k,) [J]: what it leaves where there are no
    contact forces, None else.
    """

    t: np.ndarray
    kinetic: np.ndarray
    work: dict[str, np.ndarray]
    error: np.ndarray | None = None

    def __repr__(self) -> str:
        return f"Energies({len(self.t)} times, work of {', '.join(self.work)})"


def energies_of(origin: Origin, times: np.ndarray, velocity: np.ndarray) -> Energies:
    """The Energies of a run with steps at these times (k,), its velocities being (k, n, 3)."""
    replay = Replay(origin)
    smooth = {
        name: scene
        for (name, scene), force in zip(replay.single_scenes.items(), origin.forces, strict=True)
        if not isinstance(force, ContactForce)
    }
    free = np.array([0.0 if body.fixed else 1.0 for body in origin.bodies])[:, None]

    def powers(instant: Instant) -> np.ndarray:
        rates = instant.work.velocity[NOW] * free
        return np.array([np.sum(instant.forces(scene) * rates) for scene in smooth.values()])

    inside = times[:-1, None] + np.diff(times)[:, None] * LOBATTO
    order = np.append(np.column_stack([times[:-1], inside]).ravel(), times[-1])
    found = np.array([powers(each) for each in replay.instants(order, times)])
    found = found.reshape(len(order), len(smooth))
    parts = np.zeros((len(times) - 1, len(smooth)))
    for place, weight in enumerate(LOBATTO_WEIGHTS):
        parts += weight * found[place : len(order) - 4 + place : 4]
    parts *= np.diff(times)[:, None]
    total = np.concatenate([np.zeros((1, len(smooth))), np.cumsum(parts, axis=0)])
    work = {name: total[:, place] for place, name in enumerate(smooth)}
    inertias = np.array([(body.mass, body.mass, body.inertia) for body in origin.bodies])
    kinetic = 0.5 * np.einsum("nc,knc->kn", inertias, velocity**2)
    change = (kinetic - kinetic[0]) @ free[:, 0]
    if isinstance(origin.integrator, Overdamped):
        change = np.zeros(len(times))  # without inertia forces balance, and so does their work
    left = change - total.sum(axis=1)
    if len(smooth) == len(origin.forces):
        return Energies(times, kinetic, work, left)
    return Energies(times, kinetic, work | {"contact": left})
