"""How an island is run by its method, which may have steps that go on across switches.

Steps that end at every switch are right for few contacts. In a bed some contact opens or closes
all the time, while nothing moves: there the implicit method goes on with backward Euler and the
contacts of each step's end, as soon as it would take far fewer steps (backward_euler/choice.py).
A method that has no such steps is run by its own alone.
"""

import math

from flocsim.arrays import (
    BEARABLE_STEP,
    LOCATED,
    PAUSE_AT,
    PREVIOUS_STEP,
    REJECTED,
    SETTLED_STEP,
    SETTLING,
    STEP,
    STEPS,
    TIME,
    UNTIL,
)
from flocsim.hooks import advance_across, pays_across
from flocsim.integrators.backward_euler.choice import note_velocities
from flocsim.integrators.backward_euler.driver import NEXT_STEP, OTHER_METHOD
from flocsim.integrators.loop.driver import FINISHED, PAUSED, advance

LOCATES, ACROSS = range(2)
"""What ends a step: every switch; none."""

PROBE = 60
"""Steps with located switches between two looks at how far they have come."""

NEVER = 2**62
"""Steps after which to pause where nothing is to be looked at."""

FIRST_SHARE = 0.1
"""The first step with located switches behind one across them, over that."""


def tried(counts):
    """Steps tried so far."""
    return counts[STEPS] + counts[REJECTED] + counts[LOCATED]


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
        if pays_across(scene, work, clock, tried(counts) - before, passed):
            method, euler[NEXT_STEP] = ACROSS, passed
        if clock[TIME] >= clock[UNTIL]:
            return FINISHED, method
