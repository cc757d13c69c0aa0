"""The contract of an integrator, and how a run can end."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from enum import IntEnum

import attrs
import numpy as np

from flocsim import hooks
from flocsim.state.clock import Clock, Counts


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

    def __str__(self) -> str:
        return f"{self.name}: {self.reason}"

    @property
    def reason(self) -> str:
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


@attrs.frozen
class Integrator(ABC):
    """A way to take one step; lists, error control, events and recording exist once, around it.

    A subclass gives ``attempt``, a plain function that numba can compile, on arrays of which it
    uses elements, ``shape``, ``len``, rows and slices:

    ``attempt(scene, work, clock, step) → ratio``. Given are the motion now, ``work.place[NOW]``
    (n, 3: x, y, angle) and ``work.velocity[NOW]``, the time ``clock.time`` and the step [s] to be
    tried. It must write the motion a step later to the same arrays at NEW, and the tangential
    displacements there to ``work.slip[NEW]`` (flocsim.integrators.parts has the pieces). It returns
    the step's error over what is allowed: above 1 the step is tried again, shorter; below 0 it has
    failed and is tried again much shorter. A method of controlled error writes that error to
    ``clock.step_error`` [m] and, for each body, how long a velocity is remembered to
    ``work.errors[body].velocity_lifetime`` [s], which says how finely switches must be located:
    ``parts.error_ratio`` and ``parts.weigh_velocities`` do both. A method of fixed steps returns 0
    or, where the motion is no longer finite, −1, and subclasses ``parts.FixedStep``.

    ``next_step(clock, step, ratio)`` is the size of the step after one with that ratio.
    ``replaces`` {hook: function} are other functions of the engine that it stands in for.
    ``tolerance`` [m] and ``first_step`` [s] are read by the driver; a fixed-step method has an
    infinite tolerance. ``estimate_share``: the share of the errors that it estimates for its steps
    that counts in the stated error, far below 1 where the estimate is of a much lower order.
    ``across``: whether its steps go on across switches instead of ending there, for which they
    flag, as closed, the pairs that have taken part.

    All that a method keeps from one step to the next lies in the arrays of flocsim.state, each
    column with its unit: a pause, a copy of a run, a System and a Swarm all go on from these.
    """

    tolerance = math.inf
    first_step = 1e-6
    largest_step = math.inf
    estimate_share = 1.0
    across = False

    @staticmethod
    @abstractmethod
    def attempt(scene, work, clock, step):
        """Try one step; see the class."""

    @staticmethod
    @abstractmethod
    def next_step(clock, step, ratio):
        """The size of the step after one of that size [s]."""

    @property
    def replaces(self) -> dict[Callable, Callable]:
        """{hook of flocsim.hooks.HOOKS: function} besides."""
        return {}

    @property
    def fillings(self) -> dict[Callable, Callable]:
        """{hook: function} of this integrator."""
        return {
            hooks.attempt: self.attempt, hooks.next_step: self.next_step, **self.replaces,
        }  # fmt: skip

    def fresh_clock(self) -> Clock:
        """The float state of a run that starts at time zero."""
        clock = Clock.one()
        clock.until = math.inf
        clock.step = self.first_step
        clock.tolerance = self.tolerance
        clock.largest_step = self.largest_step
        clock.estimate_share = self.estimate_share
        clock.previous_step = math.inf
        clock.feasible_step = math.inf
        clock.step_after_switch = math.inf
        clock.across = float(self.across)
        return clock

    def fresh_counts(self, max_steps: int) -> Counts:
        """The integer state of a run with a step budget."""
        counts = Counts.one()
        counts.max_steps = max_steps
        counts.pause_at = np.iinfo(np.int64).max
        return counts
