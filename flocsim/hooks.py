"""Every function that a method, a family of shapes or an observer may replace.

``@hook`` marks such a function where it is defined, and HOOKS lists them all. A driver calls it by
name; for a scene the composer puts the scene's own function in its place in a clone of everything
that the driver reaches, before that is compiled. Physics is no matter of hooks: what forces a scene
has is told and called through its laws (flocsim.laws).
"""

from collections.abc import Callable
from typing import TypeVar

from flocsim.compiler.linker import apart

Function = TypeVar("Function", bound=Callable)

HOOKS: dict[str, Callable] = {}
"""{"module.name": function}: what may be replaced."""


def hook(function: Function) -> Function:
    """Mark a function that a scene may replace; it stays what it is."""
    HOOKS[f"{function.__module__}.{function.__qualname__}"] = function
    return function


@hook
@apart
def attempt(scene, work, clock, step):
    """One step of the integrator: the local error over the tolerance, or −1 where it failed.

    What it is given and what it has to fill: flocsim.integrators.base.Integrator.
    """
    return 0.0


@hook
def next_step(clock, step, ratio):
    """The size of the next step after one whose error was ``ratio`` times the tolerance."""
    return step


@hook
def end_within(scene, work, step, ratio, share):
    """Make the motion at a share of a step, whose error is ``ratio`` times what is allowed, the
    new state, as good as a shorter step's; False where it would not be, and nothing changes."""
    return False


@hook
def choose_method(scene, work, clock, counts):
    """Whether the next steps end at switches or go on across them, into ACROSS of the clock, where
    a method may do both."""


@hook
@apart
def step_across(scene, work, clock, step):
    """One step of a method that may do both, across switches: what ``attempt`` returns."""
    return -1.0


@hook
@apart
def leave_out_cycles(scene, work, clock, counts, until):
    """Go on by many equal cycles of switches at once, where they are, to before a time [s]."""


@hook
def note_step(scene, work, clock, step):
    """Write down what a method of steps across switches has to know of one that is accepted."""


@hook
def awaits_touch(observed):
    """Whether a method of fixed steps, too, is to end a step where the first pair touches."""
    return False


@hook
def observe(scene, work, observed, time):
    """Watches every accepted step; a code other than 0 stops the run."""
    return 0
