"""Run: one run of a scene in progress, and the only caller of a driver; and which force gives no
number where a run could not go on.

A method tries shorter and shorter steps where a force is NaN or infinite, and ends as stalled, or
without any steps left. Looking at every force by itself where the run has ended, and at where it
would have gone next, tells such an end from one that the method alone is to blame for.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from flocsim.compiler.composer import compose
from flocsim.compiler.linker import where
from flocsim.forces.check import asked_at
from flocsim.forces.codegen import Pieces, laws_of
from flocsim.geometry.contact.candidates import list_candidates
from flocsim.geometry.contact.points import locate_contacts
from flocsim.integrators.base import Integrator, Status
from flocsim.integrators.rhs.orientation import oriented_now
from flocsim.integrators.rhs.surface_gap import flag_near, run_end, surface_view
from flocsim.integrators.rhs.views import body_view, centre_view, contact_view
from flocsim.state.clock import NOT_COMPILED, NOTHING_FULL
from flocsim.state.scene import Scene
from flocsim.state.work import NOW, Work, copy_of, counts_as_pair, motion_of, put_motion, with_room

STEPS_AT_A_TIME = 5_000
"""Steps between two looks at whether to go on: some 50 ms."""

RECORD_ROWS = 4096
"""Rows of the record between two copies."""

AHEAD = (0.0, *np.geomspace(1e-16, 1e-4, 25))
"""Times [s] behind the end of a run at which forces are looked at, at unchanged velocities."""

UNABLE = (Status.STEP_BUDGET, Status.STALLED, Status.NOT_FINITE)
"""Ends at which a force may be to blame that gives NaN or infinity."""

LARGEST = 1e100
"""Beyond such an answer, in SI units, the motion overflows."""

MAY_BE_INFINITE = ("slip_limit", "contact_event")
"""Laws of which only NaN is no answer."""


def with_more(driver: Any, work: Work) -> tuple[Callable[..., int], Work]:
    """An engine and its arrays with what was lacking (Tally.full): with what it had left
    out until a run needs it, or with room."""
    if work.tally.full == NOT_COMPILED:
        work.tally.full = NOTHING_FULL
        return driver.whole, work
    return driver, with_room(work)


class Run:
    """The arrays of a run, what was recorded of it, and how it goes on.

    Parameters: ``driver``, of System.compose; ``scene`` and ``work``, its arrays (System.scene,
    arrays.work_of); ``integrator``; ``until`` [s]; ``max_steps``, of all steps tried; ``observed``,
    the observer's array; ``record``, whether to keep every accepted step.
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
        self.driver, self.scene, self.work = driver, scene, work
        self.clock, self.counts = integrator.fresh_clock(), integrator.fresh_counts(max_steps)
        self.clock.until = until
        self.observed = np.zeros(1) if observed is None else observed
        n = len(scene.bodies)
        self.record = np.zeros((RECORD_ROWS if record else 0, 1 + 6 * n))
        self.saved = [self.row_now()]

    def row_now(self) -> np.ndarray:
        """Time and state now, as one row of a record."""
        return np.concatenate([[self.clock.time], motion_of(self.work, NOW).ravel()])[None]

    def advance(self, steps: int | None = None) -> Status:
        """Go on for so many steps: PAUSED, or the Status with which the run has ended for good.

        A pause comes between two steps, so that it changes nothing.
        """
        self.counts.pause_at = self.counts.steps + (steps or STEPS_AT_A_TIME)
        while True:
            code = self.driver(
                self.scene, self.work, self.observed, self.clock, self.counts, self.record
            )
            if self.counts.recorded > 0:
                self.saved.append(self.record[: self.counts.recorded].copy())
                self.counts.recorded = 0
            if code == Status.NO_ROOM:
                self.driver, self.work = with_more(self.driver, self.work)
            elif code != Status.RECORD_FULL:
                return Status(code)

    def copy(self) -> "Run":
        """The same run with arrays of its own: either may go on."""
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
        """Return the run as it is, or, of one that was pickled or copied as an object, a copy with
        the compiled code of a run that ``begin`` makes of the same scene."""
        if self.driver is not None:
            return self
        made, run = begin(), self.copy()
        run.driver, run.scene = made.driver, made.scene
        return run

    def to_end(self, halted: Callable[[], bool] | None = None) -> Status:
        """Go on until the run has ended: its Status; PAUSED where ``halted()`` said to give up."""
        while (status := self.advance()) == Status.PAUSED:
            if halted is not None and halted():
                break
        return status

    def rows(self) -> np.ndarray:
        """The record (k, 1 + 6 n): time, then x, y, angle, vx, vy, spin of every body; start and
        end alone where steps are not kept."""
        end = [] if len(self.record) else [self.row_now()]
        return np.concatenate([*self.saved, *end])

    def motion(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times (k,) [s], places (k, n, 3) [m, m, rad] and velocities (k, n, 3) of the record."""
        rows = self.rows()
        states = rows[:, 1:].reshape(len(rows), -1, 6)
        return rows[:, 0], states[:, :, :3], states[:, :, 3:]

    @property
    def time(self) -> float:
        """How far it has come [s]."""
        return float(self.clock.time)

    @property
    def steps(self) -> int:
        return int(self.counts.steps)

    @property
    def rejected(self) -> int:
        """Steps tried in vain."""
        return int(self.counts.rejected)

    @property
    def evaluations(self) -> int:
        """How often the forces were summed."""
        return int(self.work.tally.evaluations)

    @property
    def error(self) -> float:
        """The sum of the steps' estimated errors [m]."""
        return float(self.clock.error)

    @property
    def code(self) -> int:
        """The observer's last code."""
        return int(self.counts.code)


def locate(scene: Any, work: Work) -> bool:
    """List the pairs of outlines that are near, and where they are; False without room."""
    room = list_candidates(scene, work)
    locate_contacts(scene, work, NOW)
    return room


def views_of(
    system: Any, scene: Any, work: Work, time: float, located: Callable[..., bool]
) -> dict[str, list]:
    """{first part of laws' names: [what they are shown]} in the state NOW; ``located(scene, work)``
    lists the pairs there (see locate)."""
    bodies = range(len(system.bodies))
    pairs = [(a, b) for a in bodies for b in range(a) if counts_as_pair(scene.bodies, a, b)]
    views = {
        "body": [body_view(scene, work, time, NOW, body) for body in bodies],
        "centre": [centre_view(scene, work, time, NOW, a, b) for a, b in pairs],
        "oriented": [oriented_now(scene, work, time, a, b) for a, b in pairs],
    }
    if located(scene, work):
        rows = range(work.tally.candidates)
        touching = [row for row in rows if work.geometry[NOW, row].gap < 0.0]
        flag_near(scene, work, NOW, 0.0)
        first, views["surface"] = 0, []
        while first < len(rows):
            end = run_end(work, first)
            views["surface"].append(surface_view(scene, work, time, NOW, first, end))
            first = end
        views["contact"] = [contact_view(scene, work, NOW, row) for row in touching]
    return views


def family(law: str) -> str:
    """Which views a law is shown: the key in views_of."""
    first = law.partition("_")[0]
    return {"velocity": "body", "position": "body", "slip": "contact"}.get(first, first)


def values_of(law: Callable, view: Any, parameters: np.ndarray, which: tuple[int, ...]) -> tuple:
    """What a law answers, as a tuple; as compiled where Python raises for what is no number."""
    try:
        answer = law(view, parameters, *which)
    except (ArithmeticError, ValueError):
        answer = compose(law, {})(view, parameters, *which)
    return answer if isinstance(answer, tuple) else (answer,)


def kernel_of(force: Any, law: str, fluid: Any) -> Callable:
    """The function of a force that a law calls."""
    if family(law) == "body":
        return force.kernel_in(fluid)
    if law.endswith("derivatives") and getattr(force, "slope", None) is not None:
        return force.slope
    return getattr(
        force, {"slip_limit": "slip_limit", "contact_event": "events"}.get(law, "kernel")
    )


@np.errstate(all="ignore")
def wrong_answer(force: Any, pieces: Pieces, views: dict[str, list], fluid: Any) -> str:
    """ "kernel (file:line) gives nan at …" of a force; "" where all of its answers are numbers.

    ``pieces``, of the force alone; ``views`` {"body", "centre", …: the views to ask for}.
    """
    parameters = np.array(pieces.parameters, dtype=float)
    for name, law in pieces.laws.items():
        each_event = range(pieces.events) if name == "contact_event" else [None]
        for view in views.get(family(name), ()):
            for event in each_event:
                which = () if event is None else (event,)
                most = math.inf if name in MAY_BE_INFINITE else LARGEST
                values = values_of(law, view, parameters, which)
                wrong = [value for value in values if not abs(value) <= most]
                if wrong:
                    what = where(kernel_of(force, name, fluid))
                    slope = "a slope of " if name.endswith("derivatives") else ""
                    return f"{what} gives {slope}{float(wrong[0])} at {asked_at(view)}"
    return ""


@np.errstate(all="ignore")
def force_to_blame(system: Any, run: Run) -> str:
    """The force of a System that gives NaN, or more than LARGEST, where a Run has ended, in words;
    or ""."""
    scene: Any = system.scene(jit=False)
    start = motion_of(run.work, NOW)
    if not np.isfinite(start).all():
        return ""
    work = copy_of(run.work)
    used = system.pieces.used
    pieces = [(name, force, laws_of([force], system.fluid)) for name, force in used.items()]
    classes = [type(force) for force in used.values()]
    located = compose(locate, system.fillings(), jit=False)
    for ahead in AHEAD:
        put_motion(work, NOW, start)
        work.place[NOW] += ahead * work.velocity[NOW]
        views = views_of(system, scene, work, run.clock.time + ahead, located)
        for name, force, own in pieces:
            words = wrong_answer(force, own, views, system.fluid)
            if words:
                return f"{name}: {words}" if classes.count(type(force)) > 1 else words
    return ""
