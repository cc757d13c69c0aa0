"""Run: one run of a scene in progress, and the only caller of a driver."""

import copy
from collections.abc import Callable
from typing import Any

import numpy as np

import flocsim.arrays as at
from flocsim.arrays import Scene, Work, copy_of, with_room
from flocsim.integrators.base import Integrator, Status

STEPS_AT_A_TIME = 5_000
"""Steps between two looks at whether to go on: some 50 ms."""

RECORD_ROWS = 4096
"""Rows of the record between two copies."""


def with_more(driver: Any, work: Work) -> tuple[Callable[..., int], Work]:
    """An engine and its arrays with what was lacking (flocsim.arrays: FULL): with what it had left
    out until a run needs it, or with room."""
    if work.tally[at.FULL] == at.NOT_COMPILED:
        work.tally[at.FULL] = at.NOTHING_FULL
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
        self.clock[at.UNTIL] = until
        self.observed = np.zeros(1) if observed is None else observed
        n = len(scene.bodies)
        self.record = np.zeros((RECORD_ROWS if record else 0, 1 + 6 * n))
        self.saved = [self.row_now()]

    def row_now(self) -> np.ndarray:
        """Time and state now, as one row of a record."""
        return np.concatenate([[self.clock[at.TIME]], self.work.motion[at.NOW].ravel()])[None]

    def advance(self, steps: int | None = None) -> Status:
        """Go on for so many steps: PAUSED, or the Status with which the run has ended for good.

        A pause comes between two steps, so that it changes nothing.
        """
        self.counts[at.PAUSE_AT] = self.counts[at.STEPS] + (steps or STEPS_AT_A_TIME)
        while True:
            code = self.driver(
                self.scene, self.work, self.observed, self.clock, self.counts, self.record
            )
            if self.counts[at.RECORDED] > 0:
                self.saved.append(self.record[: self.counts[at.RECORDED]].copy())
                self.counts[at.RECORDED] = 0
            if code == Status.NO_ROOM:
                self.driver, self.work = with_more(self.driver, self.work)
            elif code != Status.RECORD_FULL:
                return Status(code)

    def copy(self) -> "Run":
        """The same run with arrays of its own: either may go on."""
        other = copy.copy(self)
        other.work = copy_of(self.work)
        other.clock, other.counts = self.clock.copy(), self.counts.copy()
        other.observed, other.record = self.observed.copy(), self.record.copy()
        other.saved = list(self.saved)
        return other

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
        return float(self.clock[at.TIME])

    @property
    def steps(self) -> int:
        return int(self.counts[at.STEPS])

    @property
    def rejected(self) -> int:
        """Steps tried in vain."""
        return int(self.counts[at.REJECTED])

    @property
    def evaluations(self) -> int:
        """How often the forces were summed."""
        return int(self.work.tally[at.EVALUATIONS])

    @property
    def error(self) -> float:
        """The sum of the steps' estimated errors [m]."""
        return float(self.clock[at.ERROR])

    @property
    def code(self) -> int:
        """The observer's last code."""
        return int(self.counts[at.CODE])
