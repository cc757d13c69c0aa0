"""The rule by which Implicit hands over to backward Euler, and takes back, in System and Swarm.

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

import flocsim.arrays as at
from flocsim.compiler.linker import postponed
from flocsim.geometry.contact.points import least_listed_gap
from flocsim.integrators.backward_euler.step import (
    end_at_switches,
    euler_step,
    go_across,
)
from flocsim.integrators.rhs.views import lever
from flocsim.laws import CONTACT_FORCE, has

FEWEST = 3
"""Bodies, fixed ones among them: two have few contacts; a System of two leaves all of this out."""

PROBE = 60
"""Steps with located switches between two looks at how far they have come."""

AHEAD, FAR_AHEAD = 4.0, 40.0
"""Backward Euler must be expected to need so many times fewer steps; and of fewer bodies than that.
"""

ENOUGH_TRIALS, FEW_SWITCHES = 60, 0.25
"""Behind so many trials with fewer switches than that for each, located switches cost no more."""


def largest_change(scene, work):
    """How much the velocity of an outline has changed since the last look [m/s]."""
    largest = 0.0
    for body in range(work.motion.shape[1]):
        if scene.bodies[body, at.FREE] == 1.0:
            for axis in range(3):
                now = work.motion[at.NOW, body, at.VELOCITY + axis]
                change = abs(now - work.motion[at.LOOKED, body, at.VELOCITY + axis])
                largest = max(largest, lever(scene, body, axis) * change)
    return largest


def pays(scene, work, clock, trials, passed):
    """Whether backward Euler would have passed that time in far fewer steps than were tried: its
    error of a step is half of that times the change of velocity."""
    steps = 1.0 + passed * largest_change(scene, work) / clock[at.TOLERANCE]
    ahead = AHEAD if work.bodies.shape[0] >= FEWEST else FAR_AHEAD
    return ahead * steps <= trials


def hand_over(scene, work, clock, counts):
    """Hand over to backward Euler, or take back, where that is due."""
    if not has(scene, CONTACT_FORCE) and clock[at.ACROSS] == 0.0:
        return
    tried = counts[at.STEPS] + counts[at.REJECTED] + counts[at.LOCATED]
    trials = tried - counts[at.LOOKED_TRIED]
    if clock[at.ACROSS] == 1.0:
        enough = trials >= ENOUGH_TRIALS
        quiet = enough and clock[at.SWITCHES] < FEW_SWITCHES * trials
        if quiet or least_listed_gap(work) >= 0.0:
            end_at_switches(scene, work, clock)
        elif not enough:
            return
    elif clock[at.LOOKED_AT] < math.inf:
        if counts[at.STEPS] < counts[at.LOOK_AT]:
            return
        passed = clock[at.TIME] - clock[at.LOOKED_AT]
        if pays(scene, work, clock, trials, passed) and least_listed_gap(work) < 0.0:
            go_across(clock, passed)
    counts[at.LOOK_AT], counts[at.LOOKED_TRIED] = counts[at.STEPS] + PROBE, tried
    clock[at.LOOKED_AT], clock[at.SWITCHES] = clock[at.TIME], 0.0
    for body in range(work.motion.shape[1]):
        for axis in range(at.VELOCITY, at.VELOCITY + 3):
            work.motion[at.LOOKED, body, axis] = work.motion[at.NOW, body, axis]


def across_not_compiled(scene, work, clock, step):
    """Tell that steps across switches have not been compiled yet."""
    work.tally[at.FULL] = at.NOT_COMPILED
    return -1.0


@postponed(across_not_compiled)
def step_or_give_back(scene, work, clock, step):
    """One step across switches; −1 where it fails, also for bodies that would fly apart again."""
    ratio, bounce = euler_step(scene, work, clock, step, False)
    if 0.0 <= ratio <= 1.0 and bounce > 0.0:
        end_at_switches(scene, work, clock)
        return -1.0
    return ratio
