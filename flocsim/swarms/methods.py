"""Which method an island is run by: located switches, or steps that go on across them.

Steps that end at every switch are right for few contacts. In a bed some contact opens or closes all
the time, while nothing moves: backward Euler with the contacts of each step's end then goes through
many switches in a step whose error is allowed all the same. Every so many steps the island's own
counts say which of the two is ahead; clocks have no say, so that the choice is the same everywhere.
"""

import math

from flocsim.arrays import (
    BEARABLE_STEP,
    FIRST_STAGE,
    FREE,
    LOCATED,
    NOW,
    PAUSE_AT,
    PREVIOUS_STEP,
    REJECTED,
    SETTLED_STEP,
    SETTLING,
    STEP,
    STEPS,
    TIME,
    TOLERANCE,
    UNTIL,
    VELOCITY,
)
from flocsim.integrators.backward_euler.driver import NEXT_STEP, OTHER_METHOD, advance_across
from flocsim.integrators.loop.driver import FINISHED, PAUSED, advance
from flocsim.integrators.rhs.views import lever

LOCATES, ACROSS = range(2)
"""What ends a step: every switch; none."""

PROBE = 60
"""Steps with located switches between two looks at how far they have come."""

AHEAD = 4.0
"""Backward Euler must be expected to need so many times fewer steps."""

NEVER = 2**62
"""Steps after which to pause where nothing is to be looked at."""

BEFORE = FIRST_STAGE + 4
"""Row of ``Work.motion`` for the velocities at the last look."""

FIRST_SHARE = 0.1
"""The first step with located switches behind one across them, over that."""


def tried(counts):
    """Steps tried so far."""
    return counts[STEPS] + counts[REJECTED] + counts[LOCATED]


def note_velocities(work):
    for body in range(work.motion.shape[1]):
        for axis in range(VELOCITY, VELOCITY + 3):
            work.motion[BEFORE, body, axis] = work.motion[NOW, body, axis]


def largest_change(scene, work):
    """How much the velocity of an outline has changed since the last look [m/s]."""
    largest = 0.0
    for body in range(work.motion.shape[1]):
        if scene.bodies[body, FREE] == 1.0:
            for axis in range(3):
                now = work.motion[NOW, body, VELOCITY + axis]
                change = abs(now - work.motion[BEFORE, body, VELOCITY + axis])
                largest = max(largest, lever(scene, body, axis) * change)
    return largest


def pays(scene, work, clock, trials, passed):
    """Whether backward Euler would have passed that time in far fewer steps than were tried: its
    error of a step is half of that times the change of velocity."""
    steps = 1.0 + passed * largest_change(scene, work) / clock[TOLERANCE]
    return AHEAD * steps <= trials


def start_anew(clock, euler):
    """Sizes of steps with located switches behind others."""
    clock[STEP] = FIRST_SHARE * euler[NEXT_STEP]
    clock[PREVIOUS_STEP] = clock[BEARABLE_STEP] = clock[SETTLED_STEP] = math.inf
    clock[SETTLING] = 0.0


def advance_island(scene, work, observed, clock, counts, record, euler, method):
    """Run an island to a Status by whichever method is ahead, beginning with one: (Status, the
    method at the end)."""
    counts[PAUSE_AT] = NEVER
    while True:
        if method == ACROSS:
            code = advance_across(scene, work, observed, clock, counts, record, euler)
            if code != OTHER_METHOD:
                return code, method
            method = LOCATES
            start_anew(clock, euler)
        if work.bodies.shape[0] > 1:
            counts[PAUSE_AT] = counts[STEPS] + PROBE
        began, before = clock[TIME], tried(counts)
        note_velocities(work)
        code = advance(scene, work, observed, clock, counts, record)
        counts[PAUSE_AT] = NEVER
        if code != PAUSED:
            return code, method
        passed = clock[TIME] - began
        if pays(scene, work, clock, tried(counts) - before, passed):
            method, euler[NEXT_STEP] = ACROSS, passed
        if clock[TIME] >= clock[UNTIL]:
            return FINISHED, method
