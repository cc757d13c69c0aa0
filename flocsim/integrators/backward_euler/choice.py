"""When steps across switches are ahead of steps that end at every one.

Counts of steps alone decide: clocks have no say, so that the choice is the same everywhere.
"""

from flocsim.arrays import FIRST_STAGE, FREE, NOW, TOLERANCE, VELOCITY
from flocsim.integrators.rhs.views import lever

AHEAD = 4.0
"""Backward Euler must be expected to need so many times fewer steps."""

BEFORE = FIRST_STAGE + 4
"""Row of ``Work.motion`` for the velocities at the last look."""


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
