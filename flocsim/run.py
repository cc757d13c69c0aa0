"""Run, one run of a scene in progress and the only caller of a driver; and which force is to blame
for an end without a finite answer.

A method tries shorter and shorter steps where a force is NaN or infinite, and ends as stalled or
out of steps. Evaluating each force by itself at the end of the run, and shortly beyond, tells such
an end from one that the method alone is to blame for.
"""

import math
from collections.abc import Callable, Iterable
from itertools import product
from typing import Any

import numpy as np

from flocsim.compiler.composer import compose
from flocsim.compiler.linker import where
from flocsim.forces.check import describe_sample
from flocsim.forces.codegen import Pieces, laws_of
from flocsim.geometry.contact.candidates import rebuild_list
from flocsim.geometry.contact.points import locate_contacts
from flocsim.integrators.base import Integrator, Status
from flocsim.integrators.rhs.orientation import oriented_now
from flocsim.integrators.rhs.surface_gap import flag_near, pair_end, surface_view
from flocsim.integrators.rhs.views import body_view, centre_view, contact_view
from flocsim.state.clock import NOT_COMPILED, NOTHING_FULL
from flocsim.state.scene import Scene
from flocsim.state.work import (
    NOW,
    Work,
    copy_of,
    counts_as_pair,
    motion_of,
    put_motion,
    with_room,
)

Motion = tuple[np.ndarray, np.ndarray]
"""Positions and velocities of n bodies, (n, 3) each."""

STEPS_AT_A_TIME = 5_000
"""Steps between two checks whether to continue: some 50 ms. The record has a row for each."""

LOOK_AHEAD_TIMES = (0.0, *np.geomspace(1e-16, 1e-4, 25))
"""Times [s] past the end of a run at which forces are evaluated, at constant velocities."""

UNABLE = (Status.STEP_BUDGET, Status.STALLED, Status.NOT_FINITE)
"""Ends for which a force that returns NaN or infinity may be to blame."""

LARGEST = 1e100
"""Forces larger than this, in SI units, make the motion overflow."""

INFINITE_ALLOWED = ("slip_limit", "contact_event")
"""Laws for which infinity is a valid answer, and only NaN is not."""


def extended(driver: Any, work: Work) -> tuple[Callable[..., int], Work]:
    """Return an engine and its arrays with whatever they lacked (Tally.full): larger arrays, or the
    code that the engine had left out until a run needed it."""
    if work.tally.full == NOT_COMPILED:
        work.tally.full = NOTHING_FULL
        return driver.whole, work
    return driver, with_room(work)


class Run:
    """The arrays of a run, its record, and the ways to advance it.

    Parameters
    ----------
    driver : callable
        The engine, of System.compose.
    scene, work : Scene, Work
        Its arrays, of System.scene and state.work.work_of.
    integrator : Integrator
        The method; it gives the first clock and counters.
    until : float
        End of the run [s].
    max_steps : int
        Budget of all steps tried.
    observed : array, optional
        The observer's own array.
    record : bool, optional
        Whether to keep every accepted step.
    """

    def __init__(
        self,
        driver: Callable[..., int],
        scene: Scene,
        work: Work,
        integrator: Integrator,
        until: float,
        *,
        max_steps: int,
        observed: np.ndarray | None = None,
        record: bool = False,
    ) -> None:
        self.driver, self.scene, self.work, self.integrator = driver, scene, work, integrator
        self.clock, self.counts = integrator.fresh_clock(), integrator.fresh_counts(max_steps)
        self.clock.until = until
        self.observed = np.zeros(1) if observed is None else observed
        n = len(scene.bodies)
        # Of fixed size for the compiled loop, which returns when it is full; empty: none is kept.
        self.record = np.zeros((STEPS_AT_A_TIME if record else 0, 1 + 6 * n))
        self.saved = [self.row_now()]

    def row_now(self) -> np.ndarray:
        """Return the present time and state as one row of a record."""
        return np.append(self.clock.time, motion_of(self.work, NOW))[None]

    def advance(self, steps: int | None = None) -> Status:
        """Advance by so many steps; return PAUSED, or the Status with which the run has ended for
        good.

        A pause comes between two steps and changes nothing.
        """
        # Compiled code cannot be interrupted: pauses let the caller check clock and signals.
        self.counts.pause_at = self.counts.steps + (steps or STEPS_AT_A_TIME)
        while True:
            code = self.driver(
                self.scene, self.work, self.observed, self.clock, self.counts, self.record
            )
            # Copy the rows recorded, so the array can be filled anew.
            if self.counts.recorded > 0:
                self.saved.append(self.record[: self.counts.recorded].copy())
                self.counts.recorded = 0
            # Out of room: enlarge and continue with the same step.
            if code == Status.NO_ROOM:
                self.driver, self.work = extended(self.driver, self.work)
            elif code != Status.RECORD_FULL:
                return Status(code)

    def copy(self) -> "Run":
        """Return the same run with arrays of its own: either may continue."""
        # The scene is shared, as no run changes it.
        other = object.__new__(type(self))
        vars(other).update(vars(self), work=copy_of(self.work))
        other.clock, other.counts = self.clock.copy(), self.counts.copy()
        other.observed, other.record = self.observed.copy(), self.record.copy()
        other.saved = list(self.saved)
        return other

    def __getstate__(self) -> dict[str, Any]:
        # Compiled code stays in its process: `revived` gives a copy that of a run of its own.
        return vars(self) | {"driver": None, "scene": self.scene._replace(laws=None)}

    def revived(self, begin: Callable[[], "Run"]) -> "Run":
        """Return this run; or, if it was pickled or copied as an object, a copy with the compiled
        code of a run that ``begin`` makes of the same scene."""
        if self.driver is not None:
            return self
        made, run = begin(), self.copy()
        run.driver, run.scene = made.driver, made.scene
        return run

    def to_end(self, halted: Callable[[], bool] | None = None) -> Status:
        """Advance until the run has ended; return its Status, or PAUSED if ``halted()`` asked to
        stop."""
        while (status := self.advance()) == Status.PAUSED:
            if halted is not None and halted():
                break
        return status

    def rows(self) -> np.ndarray:
        """Return the record (k, 1 + 6 n): time, then x, y, angle, vx, vy, spin of every body. If
        steps are not kept, it has the start and the end only."""
        # A record contains its last step already.
        end = [] if len(self.record) else [self.row_now()]
        return np.concatenate([*self.saved, *end])

    def motion(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return times (k,) [s], positions (k, n, 3) [m, m, rad] and velocities (k, n, 3) of the
        record."""
        rows = self.rows()
        states = rows[:, 1:].reshape(len(rows), -1, 6)
        return rows[:, 0], states[:, :, :3], states[:, :, 3:]

    @property
    def time(self) -> float:
        """Time reached so far [s]."""
        return float(self.clock.time)

    @property
    def steps(self) -> int:
        return int(self.counts.steps)

    @property
    def rejected(self) -> int:
        """Steps rejected so far."""
        return int(self.counts.rejected)

    @property
    def evaluations(self) -> int:
        """Force sums so far."""
        return int(self.work.tally.evaluations)

    @property
    def error(self) -> float:
        """Stated error of the motion [m]; inf where nothing is known of it (see known_error)."""
        start, now = self.saved[0][0], self.row_now()[0]
        velocity = np.stack([row[1:].reshape(-1, 6)[:, 3:] for row in (start, now)])
        sizes, elapsed = self.scene.bodies["bounding_radius"], now[0] - start[0]
        return float(known_error(np.array(self.clock.error), velocity, sizes, elapsed))

    @property
    def code(self) -> int:
        """Last code of the observer."""
        return int(self.counts.code)


def known_error(
    stated: np.ndarray, velocity: np.ndarray, sizes: np.ndarray, elapsed: float
) -> np.ndarray:
    """Return stated errors [m], with inf for those beyond the reach of the bodies.

    Parameters
    ----------
    stated : float array
        Bounds of errors [m].
    velocity : (..., n, 3) float array
        Velocities of the bodies at some times of the run [m/s, m/s, rad/s].
    sizes : (n,) float array
        Bounding radii [m].
    elapsed : float
        Duration of the run [s].
    """
    speeds = np.hypot(velocity[..., 0], velocity[..., 1]) + sizes * np.abs(velocity[..., 2])
    return within_reach(stated, speeds.max(initial=0.0), sizes.max(initial=0.0), elapsed)


def within_reach(stated: Any, speed: Any, size: Any, elapsed: Any) -> np.ndarray:
    """Return the same for bodies of at most this speed [m/s] and size [m]: numbers, or arrays."""
    # In this time nothing has moved further than by about this, right or wrong.
    return np.where(stated > speed * elapsed + size, np.inf, stated)


def locate(scene: Any, work: Work) -> bool:
    """List and locate the pairs of outlines that are near; return False if an array is full."""
    room = rebuild_list(scene, work)
    locate_contacts(scene, work, NOW)
    return room


def views_of(
    system: Any, scene: Any, work: Work, time: float, located: Callable[..., bool]
) -> dict[str, list]:
    """Return {where forces act: [views]} for the state NOW.

    ``located(scene, work)`` lists the pairs there (see locate).
    """
    bodies = range(len(system.bodies))
    # The later body first, as in the engine.
    pairs = [(a, b) for a in bodies for b in range(a) if counts_as_pair(scene.bodies, a, b)]
    views = {
        "bodies": [body_view(scene, work, time, NOW, body) for body in bodies],
        "centres": [centre_view(scene, work, time, NOW, a, b) for a, b in pairs],
        "orientations": [oriented_now(scene, work, time, a, b) for a, b in pairs],
    }
    if located(scene, work):
        rows = range(work.tally.candidates)
        touching = [row for row in rows if work.geometry[NOW, row].gap < 0.0]
        flag_near(scene, work, NOW, 0.0)
        # Candidates of a pair of bodies are consecutive rows, which share one smooth gap.
        first, views["surfaces"] = 0, []
        while first < len(rows):
            end = pair_end(work, first)
            views["surfaces"].append(surface_view(scene, work, time, NOW, first, end))
            first = end
        views["contacts"] = [contact_view(scene, work, NOW, row) for row in touching]
    return views


def values_of(law: Callable, view: Any, parameters: np.ndarray, which: tuple[int, ...]) -> tuple:
    """Return the answer of a law as a tuple. Where Python raises an arithmetic error, the law is
    evaluated as compiled code, which returns NaN or infinity."""
    try:
        answer = law(view, parameters, *which)
    except (ArithmeticError, ValueError):
        answer = compose(law, {})(view, parameters, *which)
    return answer if isinstance(answer, tuple) else (answer,)


def kernel_of(force: Any, law: str, fluid: Any) -> Callable:
    """Return the function of a force that a law calls."""
    if law == "contact_event":
        return force.events
    if law == "slip_limit":
        return force.slip_limit
    has_slope = law.endswith("derivatives") and getattr(force, "slope", None) is not None
    return force.slope if has_slope else force.kernel_in(fluid)


@np.errstate(all="ignore")
def invalid_value(force: Any, pieces: Pieces, views: Iterable, fluid: Any) -> str:
    """Return "kernel (file:line) gives nan at …" for a force, "" if all of its answers are finite.

    ``pieces`` belong to this force alone; ``views`` are those to evaluate.
    """
    parameters = np.array(pieces.parameters, dtype=float)
    for name, law in pieces.laws.items():
        # Event functions are numbered, and evaluated one by one.
        each_event = [(event,) for event in range(pieces.events)]
        most = math.inf if name in INFINITE_ALLOWED else LARGEST
        for view, which in product(views, each_event if name == "contact_event" else [()]):
            values = values_of(law, view, parameters, which)
            wrong = [value for value in values if not abs(value) <= most]
            if wrong:
                what = where(kernel_of(force, name, fluid))
                slope = "a slope of " if name.endswith("derivatives") else ""
                return f"{what} gives {slope}{float(wrong[0])} at {describe_sample(view)}"
    return ""


@np.errstate(all="ignore")
def force_to_blame(system: Any, arrays: Work, time: float) -> str:
    """Return the force of a System that gives NaN, or more than LARGEST, where a run has ended, at
    a time [s], in words; "" if none does."""
    # Plain functions, as each force is evaluated by itself: compiled laws are sums of forces.
    scene: Any = system.scene(jit=False)
    start = motion_of(arrays, NOW)
    # A state that is not finite says nothing about its cause.
    if not np.isfinite(start).all():
        return ""
    # With more room: wider lists than the run had must not run out of it.
    work = with_room(arrays)
    used = system.pieces.used
    pieces = [(name, force, laws_of([force], system.fluid)) for name, force in used.items()]
    classes = [type(force) for force in used.values()]
    located = compose(locate, system.fillings(), jit=False)
    # Forces where the run ended, and where it would have gone next.
    for ahead in LOOK_AHEAD_TIMES:
        put_motion(work, NOW, start)
        work.place[NOW] += ahead * work.velocity[NOW]
        views = views_of(system, scene, work, time + ahead, located)
        for name, force, own in pieces:
            words = invalid_value(force, own, views.get(force.acts_on, ()), system.fluid)
            if words:
                return f"{name}: {words}" if classes.count(type(force)) > 1 else words
    return ""
