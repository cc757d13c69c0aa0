"""BackwardEuler, steps that go on across switches as a method of its own; and the rule by which
Implicit hands over to it, and takes back, in System and Swarm.

Steps that end at every switch are right for few contacts. In a bed some contact opens or closes all
the time, while nothing moves. So, where bodies are run together and touch:

- Behind every PROBE steps that end at switches it looks how far they have come: where backward
  Euler would have passed that time in AHEAD times fewer steps than were tried, it goes on; where
  there are fewer bodies than FEWEST, in FAR_AHEAD times fewer, as a pair of a swarm that hums.
- It gives back where nothing touches any more, where ENOUGH_TRIALS of its steps had fewer than
  FEW_SWITCHES switches each, and where bodies would fly apart again, by more than is allowed.

Counts of steps alone decide: clocks have no say, so that the choice is the same everywhere.
"""

import math
from collections.abc import Callable

import attrs

from flocsim.compiler.linker import postponed
from flocsim.fields import quantity
from flocsim.geometry.contact.points import least_listed_gap
from flocsim.hooks import CONTACT_FORCE, has, note_step
from flocsim.integrators.backward_euler.step import (
    end_at_switches,
    euler_step,
    go_across,
    next_across,
    note_rates,
)
from flocsim.integrators.base import Integrator
from flocsim.integrators.rhs.views import lever
from flocsim.state.clock import NOT_COMPILED
from flocsim.state.work import AT_LAST_CHECK, NOW

RESOLVED_BOUNCE = 0.003
"""Steps are this share of 1/ω0 at most while bodies touch that fly apart again."""


@attrs.frozen
class BackwardEuler(Integrator):
    """Backward Euler with the contacts of each step's end, of first order: for beds at rest.

    Steps go on across any number of switches. Impacts from which bodies would fly apart again by
    more than the tolerance are resolved by some thousand steps each. Parameters: ``tolerance`` [m],
    the error of a step in the place of any outline point, what its velocity error leads to
    included; ``first_step`` [s].

    Source: Moreau (1988), Jean (1999), for contacts that are springs.
    """

    across = True
    tolerance: float = quantity("m", above=0.0, default=1e-9)
    first_step: float = quantity("s", above=0.0, default=1e-6)

    @staticmethod
    def attempt(scene, work, clock, step):
        """One step: error over tolerance, or −1 where its end is not found."""
        ratio, bounce = euler_step(scene, work, clock, step, True)
        return max(ratio, step * bounce / RESOLVED_BOUNCE) if ratio >= 0.0 else ratio

    @staticmethod
    def next_step(clock, step, ratio):
        """Errors go with h², and with h where contacts switch."""
        return next_across(clock, step, ratio)

    @property
    def replaces(self) -> dict[Callable, Callable]:
        """What is kept of a step for the estimate of the next."""
        return {note_step: note_rates}


FEWEST = 3
"""Bodies, fixed ones among them: two have few contacts; a System of two leaves all of this out."""

PROBE = 60
"""Steps with located switches between two looks at how far they have come."""

AHEAD, FAR_AHEAD = 4.0, 40.0
"""Backward Euler must be expected to need so many times fewer steps; and of fewer bodies than that.
"""

ENOUGH_TRIALS, FEW_SWITCHES = 60, 0.25
"""Behind so many trials with fewer switches than that for each, located switches cost no more."""

MANY, LEAST_PROBE = 50, 10
"""Of more bodies than that, steps that end at switches are tried so many times as rarely, and for
so many times fewer steps, down to LEAST_PROBE: they never paid in a pile of 495, at a tenth of the
time."""


def largest_change(scene, work):
    """How much the velocity of an outline has changed since the last look [m/s]."""
    largest = 0.0
    for body in range(work.place.shape[1]):
        if scene.bodies[body].free == 1.0:
            for axis in range(3):
                now = work.velocity[NOW, body, axis]
                change = abs(now - work.velocity[AT_LAST_CHECK, body, axis])
                largest = max(largest, lever(scene, body, axis) * change)
    return largest


def pays(scene, work, clock, trials, passed):
    """Whether backward Euler would have passed that time in far fewer steps than were tried: its
    error of a step is half of that times the change of velocity."""
    steps = 1.0 + passed * largest_change(scene, work) / clock.tolerance
    ahead = AHEAD if work.poses.shape[0] >= FEWEST else FAR_AHEAD
    return ahead * steps <= trials


def crowd(work):
    """How many times the bodies are MANY, or 1."""
    return max(1.0, work.poses.shape[0] / MANY)


def hand_over(scene, work, clock, counts):
    """Hand over to backward Euler, or take back, where that is due."""
    if not has(scene, CONTACT_FORCE) and clock.across == 0.0:
        return
    tried = counts.steps + counts.rejected + counts.located
    trials = tried - counts.trials_at_check
    if clock.across == 1.0:
        enough = trials >= ENOUGH_TRIALS * crowd(work)
        quiet = enough and clock.switches_since_check < FEW_SWITCHES * trials
        if quiet or least_listed_gap(work) >= 0.0:
            end_at_switches(scene, work, clock)
        elif not enough:
            return
    elif clock.checked_at < math.inf:
        if counts.steps < counts.next_check:
            return
        passed = clock.time - clock.checked_at
        if pays(scene, work, clock, trials, passed) and least_listed_gap(work) < 0.0:
            go_across(clock, passed)
    probe = max(LEAST_PROBE, int(PROBE / crowd(work)))
    counts.next_check, counts.trials_at_check = counts.steps + probe, tried
    clock.checked_at, clock.switches_since_check = clock.time, 0.0
    for body in range(work.place.shape[1]):
        for axis in range(3):
            work.velocity[AT_LAST_CHECK, body, axis] = work.velocity[NOW, body, axis]


def across_not_compiled(scene, work, clock, step):
    """Tell that steps across switches have not been compiled yet."""
    work.tally.full = NOT_COMPILED
    return -1.0


@postponed(across_not_compiled)
def step_or_give_back(scene, work, clock, step):
    """One step across switches; −1 where it fails, also for bodies that would fly apart again."""
    ratio, bounce = euler_step(scene, work, clock, step, False)
    if 0.0 <= ratio <= 1.0 and bounce > 0.0:
        end_at_switches(scene, work, clock)
        return -1.0
    return ratio
