"""Integrator: what all integrators share, and the driver's inputs made from it.

How a run can end.
"""

import math
from abc import ABC, abstractmethod
from enum import IntEnum

import attrs
import numpy as np

from flocsim.arrays import (
    BEARABLE_STEP,
    CLOCK_SIZE,
    COUNTS_SIZE,
    LARGEST_STEP,
    MAX_STEPS,
    MOTION_COLUMNS,
    PAUSE_AT,
    PREVIOUS_STEP,
    SETTLED_STEP,
    STEP,
    TOLERANCE,
    UNTIL,
)


class Status(IntEnum):
    """How a run ended: a typed result, never an exception."""

    FINISHED = 1
    STOPPED = 2
    STEP_BUDGET = 3
    STALLED = 4
    TOO_DEEP = 5
    NO_ROOM = 6
    RECORD_FULL = 7
    PAUSED = 8
    NOT_FINITE = 9

    @property
    def reason(self):
        """What happened and what to do, in one line."""
        return REASONS[self]


REASONS = {
    Status.FINISHED: "the end time was reached",
    Status.STOPPED: "the observer stopped the run",
    Status.STEP_BUDGET: "the step budget ran out: raise integrator.max_steps or the tolerance",
    Status.STALLED: "the step shrank to nothing: the forces change too abruptly for the tolerance",
    Status.TOO_DEEP: "two bodies overlap by more than half of r_i + r_j, where the contact law has "
    "lost its meaning: use stiffer contacts, smaller steps or a larger spheroradius",
    Status.NO_ROOM: "the list of contact candidates is full",
    Status.RECORD_FULL: "the record is full",
    Status.PAUSED: "the run is paused",
    Status.NOT_FINITE: "the motion is no longer finite: the step is too large for these forces",
}


__all__ = ["Integrator", "Status", "all_finite"]


def all_finite(work, state):
    """Whether every place and velocity of a state is finite."""
    for body in range(work.motion.shape[1]):
        for axis in range(MOTION_COLUMNS):
            if not math.isfinite(work.motion[state, body, axis]):
                return False
    return True


@attrs.frozen
class Integrator(ABC):
    """A way to take one step. A subclass names the plain functions that do it.

    ``fillings`` maps ``slots.attempt`` and ``slots.next_step`` to them. ``tolerance`` [m] and
    ``first_step`` [s] are read by the driver; a fixed-step method has an infinite tolerance.
    """

    tolerance = math.inf
    first_step = 1e-6
    largest_step = math.inf

    @property
    @abstractmethod
    def fillings(self):
        """{slot: function} of this integrator."""

    def fresh_clock(self):
        """The float state of a run that starts at time zero."""
        clock = np.zeros(CLOCK_SIZE)
        clock[UNTIL] = math.inf
        clock[STEP] = self.first_step
        clock[TOLERANCE] = self.tolerance
        clock[LARGEST_STEP] = self.largest_step
        clock[PREVIOUS_STEP] = math.inf
        clock[BEARABLE_STEP] = math.inf
        clock[SETTLED_STEP] = math.inf
        return clock

    def fresh_counts(self, max_steps):
        """The integer state of a run with a step budget."""
        counts = np.zeros(COUNTS_SIZE, dtype=np.int64)
        counts[MAX_STEPS] = max_steps
        counts[PAUSE_AT] = np.iinfo(np.int64).max
        return counts
