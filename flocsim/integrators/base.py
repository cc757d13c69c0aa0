"""The contract of an integrator (Integrator), and how a run can end (Status)."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from enum import IntEnum

import attrs

from flocsim import hooks
from flocsim.fields import quantity
from flocsim.state.clock import NEVER, Clock, Counts


class Status(IntEnum):
    """How a run ended. Runs report it as a value and never raise it.

    FINISHED, STOPPED, STEP_BUDGET, STALLED, TOO_DEEP and NOT_FINITE end a run; after NO_ROOM,
    RECORD_FULL and PAUSED the same call goes on. ``reason`` says what happened and what to do. The
    compiled loop (flocsim.integrators.loop.driver) returns the same numbers.
    """

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
        """One line: what happened, and what to do about it."""
        return REASONS[self]


REASONS = {
    Status.FINISHED: "the end time was reached",
    Status.STOPPED: "the observer stopped the run",
    Status.STEP_BUDGET: "the step budget ran out: raise integrator.max_steps or the tolerance",
    Status.STALLED: "the step shrank to nothing: the forces change too abruptly for the tolerance",
    Status.TOO_DEEP: "two bodies overlap too deeply for the contact law (by more than half of "
    "r_i + r_j), or one has passed through the other: use stiffer contacts, smaller steps or a "
    "larger spheroradius",
    Status.NO_ROOM: "the list of contact candidates is full",
    Status.RECORD_FULL: "the record is full",
    Status.PAUSED: "the run is paused",
    Status.NOT_FINITE: "the motion is no longer finite: the step is too large for these forces",
}


@attrs.frozen
class Integrator(ABC):
    """Base class of integrators. A subclass takes one step; the loop around it exists once.

    Candidate lists, error control, events and recording are the loop's
    (flocsim.integrators.loop.driver).

    Attributes
    ----------
    tolerance : float
        Largest error of a step [m]; infinite for a method of fixed steps.
    first_step : float
        Size of the first step [s].
    largest_step : float
        Largest size of a step [s].
    estimate_share : float
        Fraction of the estimated errors that enters the stated error; far below 1 where the
        estimate is of much lower order than the method.
    across : bool
        True if steps go on across events instead of ending there. Such a method marks, as closed,
        the pairs that took part in the step.

    Notes
    -----
    ``attempt(scene, work, clock, step)`` returns a ratio. It is a plain function that numba
    compiles; on arrays it may use elements, ``shape``, ``len``, rows and slices. Input:
    ``work.place[NOW]`` (n, 3: x, y, angle), ``work.velocity[NOW]``, the time ``clock.time`` and the
    ``step`` [s] to try. Output: the motion one step later in the same arrays at NEW, and the
    tangential displacements in ``work.slip[NEW]`` (flocsim.integrators.parts has the building
    blocks).

    The ratio is the error of the step over its tolerance. Above 1 the step is repeated, shorter;
    below 0 it has failed, and is repeated much shorter. An adaptive method writes the error to
    ``clock.step_error`` [m] and, for each body, the time for which a velocity error persists to
    ``work.errors[body].velocity_lifetime`` [s], which decides how exactly events are located.
    ``parts.error_ratio`` and ``parts.weigh_velocities`` do both. A method of fixed steps subclasses
    ``parts.FixedStep`` and returns 0, or −1 where the motion is no longer finite.

    ``next_step(clock, step, ratio)`` returns the size of the next step. ``replaces`` maps hooks of
    flocsim.hooks to functions that this method puts in their place.

    A method stores everything that it needs later in the records of flocsim.state. So a pause, a
    copy of a run, a System and a Swarm can all resume.
    """

    # No error control and no largest step, unless a method declares them as fields.
    tolerance = math.inf
    first_step = 1e-6
    largest_step = math.inf
    estimate_share = 1.0
    across = False
    # True if the method may change to backward Euler during a run and back (Implicit).
    hands_over = False

    @staticmethod
    @abstractmethod
    def attempt(scene, work, clock, step):
        """Try one step; return its error over the tolerance. See the class.

        Parameters
        ----------
        scene : Scene
            Everything that stays the same in a run: bodies, parameters, laws.
        work : Work
            Everything that changes: motion, contacts, scratch space.
        clock : Clock
            Time, step sizes and tolerance.
        step : float
            Size of the step [s].

        Returns
        -------
        float
            Error over tolerance; above 1: too large; below 0: the step failed.
        """

    @staticmethod
    @abstractmethod
    def next_step(clock, step, ratio):
        """Return the size [s] of the step after one of size ``step`` [s] with this error ratio."""

    @property
    def replaces(self) -> dict[Callable, Callable]:
        """{hook of flocsim.hooks.HOOKS: function} that this method replaces; none by default."""
        return {}

    @property
    def fillings(self) -> dict[Callable, Callable]:
        """{hook: function} of this integrator, its attempt and next_step among them."""
        # ``replaces`` comes last, so that a method may fill these two hooks differently.
        return {
            hooks.attempt: self.attempt, hooks.next_step: self.next_step, **self.replaces,
        }  # fmt: skip

    def fresh_clock(self) -> Clock:
        """Return the clock of a run that starts at time zero."""
        # No step has been taken: nothing limits the first one but ``first_step``.
        return Clock.one(
            until=math.inf,
            step=self.first_step,
            tolerance=self.tolerance,
            largest_step=self.largest_step,
            estimate_share=self.estimate_share,
            previous_step=math.inf,
            feasible_step=math.inf,
            across=self.across,
        )

    def fresh_counts(self, max_steps: int) -> Counts:
        """Return the counters of a run with a budget of steps, tried ones included."""
        # 0: a method that may hand over begins to compare its progress at once.
        next_check = 0 if self.hands_over else NEVER
        return Counts.one(max_steps=max_steps, pause_at=NEVER, next_check=next_check)


@attrs.frozen
class Adaptive(Integrator):
    """Base class of integrators with error control.

    Parameters
    ----------
    tolerance : float
        Largest error of a step [m], > 0: displacement of any point of an outline, including the
        displacement that the error of the velocity leads to later.
    first_step : float
        Size of the first step [s], > 0.
    """

    tolerance: float = quantity("m", above=0.0, default=1e-9)
    first_step: float = quantity("s", above=0.0, default=1e-6)
