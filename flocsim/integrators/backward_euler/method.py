"""BackwardEuler as a method of its own, and the rule by which Implicit hands over to it and back.

Steps that end at every event suit few contacts. In a bed some contact opens or closes all the time,
while nothing moves. So, in a System or Swarm whose bodies touch:

- After every PROBE steps that end at events, Implicit compares. If backward Euler would have
  needed AHEAD times fewer steps for that time than were tried, it hands over.
- It takes back where nothing touches any more, where PROBE steps had AHEAD times fewer events,
  where bodies would rebound by more than the tolerance, and where no step succeeds.

The rule depends on counts of steps alone. Measured times would differ between machines.
"""

import math

import attrs

from flocsim.compiler.linker import apart, postponed
from flocsim.geometry.contact.points import least_listed_gap
from flocsim.hooks import CONTACT_FORCE, has, hook
from flocsim.integrators.backward_euler.step import (
    end_at_switches,
    euler_step,
    next_across,
    start_across,
)
from flocsim.integrators.base import Adaptive
from flocsim.integrators.rhs.views import lever
from flocsim.state.clock import NEVER, NOT_COMPILED, moves
from flocsim.state.work import AT_LAST_CHECK, NOW

RESOLVED_BOUNCE = 0.003
"""Largest step, times ω0, while bodies touch that would rebound."""


@attrs.frozen
class BackwardEuler(Adaptive):
    """Backward Euler with the contacts of each step's end, of order 1: for beds at rest.

    Steps go on across any number of events. Impacts from which bodies would rebound by more than
    the tolerance are resolved by some thousand steps each.

    Parameters
    ----------
    tolerance : float
        Largest error of a step [m], > 0: displacement of any point of an outline, including the
        displacement that the error of the velocity leads to later.
    first_step : float
        Size of the first step [s], > 0.

    Notes
    -----
    Sources: Moreau (1988), Jean (1999), for contacts that are springs.
    """

    across = True

    @staticmethod
    def attempt(scene, work, clock, step):
        """Take one step; return its error over the tolerance, or −1 where its end is not found."""
        ratio, bounce = euler_step(scene, work, clock, step, True)
        # A rebound must be resolved, whatever the error estimate says.
        return max(ratio, step * bounce / RESOLVED_BOUNCE) if ratio >= 0.0 else ratio

    @staticmethod
    def next_step(clock, step, ratio):
        """Return the size [s] of the next step: errors scale as h², and as h at events."""
        return next_across(clock, step, ratio)


FEWEST = 3
"""Bodies, fixed ones included. Two have few contacts: a System of two leaves all of this out, but
where contacts stick and slide, as two of them may excite a vibration that never ends."""

PROBE, PROBE_OF_TWO = 60, 600
"""Steps between two comparisons; among two bodies located events are more accurate, and come to an
end sooner as a rule."""

SHORTEST_ACROSS = 100.0
"""Factor over the smallest step that moves anything, below which failing steps across events are
given up: a few quarterings before the run would stall."""

AHEAD = 4.0
"""Factor by which backward Euler must need fewer steps."""


def largest_change(scene, work):
    """Return the largest change of an outline's velocity since the last comparison [m/s]."""
    largest = 0.0
    for body in range(work.place.shape[1]):
        if scene.bodies[body].free == 1.0:
            for axis in range(3):
                now = work.velocity[NOW, body, axis]
                change = abs(now - work.velocity[AT_LAST_CHECK, body, axis])
                largest = max(largest, lever(scene, body, axis) * change)
    return largest


def would_pay(scene, work, clock, trials, passed):
    """Return True if backward Euler would have needed far fewer steps for the time that has passed.

    Its error per step is half the step times the change of velocity.
    """
    steps = 1.0 + passed * largest_change(scene, work) / clock.tolerance
    return AHEAD * steps <= trials


def keep_method(scene, work, clock, counts):
    """Never hand over: among two bodies without sliding, steps that end at events are as good."""


@hook
def hand_over(scene, work, clock, counts):
    """Hand over to backward Euler, or take back, where that is due."""
    if counts.next_check == NEVER or not (has(scene, CONTACT_FORCE) or clock.across == 1.0):
        return
    tried = counts.steps + counts.rejected + counts.located
    trials = tried - counts.trials_at_check
    probe = PROBE if work.poses.shape[0] >= FEWEST else PROBE_OF_TWO
    # Across events: take back where there are few, or nothing touches.
    if clock.across == 1.0:
        enough = trials >= probe
        # Located events need no more steps than there are events.
        quiet = enough and AHEAD * clock.switches_since_check < trials
        if quiet or least_listed_gap(work) >= 0.0:
            end_at_switches(scene, work, clock)
        elif not enough:
            return
    # Located events: compare after PROBE steps.
    elif clock.checked_at < math.inf:
        if counts.steps < counts.next_check:
            return
        passed = clock.time - clock.checked_at
        if would_pay(scene, work, clock, trials, passed) and least_listed_gap(work) < 0.0:
            start_across(clock, passed)
    # Start the next comparison from here.
    counts.next_check, counts.trials_at_check = counts.steps + probe, tried
    clock.checked_at, clock.switches_since_check = clock.time, 0.0
    for body in range(work.place.shape[1]):
        for axis in range(3):
            work.velocity[AT_LAST_CHECK, body, axis] = work.velocity[NOW, body, axis]


def across_not_compiled(scene, work, clock, step):
    """Report that steps across events have not been compiled yet; the caller compiles them and
    resumes."""
    work.tally.full = NOT_COMPILED
    return -1.0


def no_step_across(scene, work, clock, step):
    """Fail: the method never hands over."""
    return -1.0


@hook
@apart
@postponed(across_not_compiled)
def step_or_give_back(scene, work, clock, step):
    """Take one step across events; return −1 where it fails, or where bodies would rebound."""
    ratio, bounce = euler_step(scene, work, clock, step, False)
    succeeds = 0.0 <= ratio <= 1.0
    # Repeat with located events, which resolve a rebound. They are also the last resort before a
    # run stalls: where two contacts switch together, no step across them may succeed, however
    # short, while one that ends at the first switch does.
    tiny = not moves(clock, step / SHORTEST_ACROSS)
    if (succeeds and bounce > 0.0) or (tiny and not succeeds):
        end_at_switches(scene, work, clock)
        return -1.0
    return ratio
