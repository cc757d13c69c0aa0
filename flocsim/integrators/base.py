"""Integrator: what all integrators share, and the driver's inputs made from it."""

import math
from abc import ABC, abstractmethod

import attrs
import numpy as np

from flocsim.integrators.status import Status
from flocsim.layout import (
    BEARABLE_STEP,
    CLOCK_SIZE,
    COUNTS_SIZE,
    LARGEST_STEP,
    MAX_STEPS,
    PAUSE_AT,
    PREVIOUS_STEP,
    SETTLED_STEP,
    STEP,
    TOLERANCE,
    UNTIL,
)

__all__ = ["Integrator", "Status", "all_finite"]


def all_finite(work, state):
    """Whether every place and velocity of a state is finite."""
    for body in range(work.motion.shape[1]):
        for axis in range(6):
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
