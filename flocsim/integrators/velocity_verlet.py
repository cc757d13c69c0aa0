"""Velocity Verlet: explicit, second order, fixed step."""

import attrs

from flocsim import hooks as slots
from flocsim.arrays import (
    CANDIDATES,
    CLOSED,
    FIRST_STAGE,
    FORCE,
    FREE,
    GAP,
    LARGEST_STEP,
    NEW,
    NOW,
    TIME,
    VELOCITY,
)
from flocsim.fields import quantity
from flocsim.geometry.contact.points import locate_acting, locate_contacts
from flocsim.integrators.base import Integrator, all_finite
from flocsim.integrators.events.modes import set_modes
from flocsim.integrators.rhs.forces import limit_slips, locate_and_rate, sum_forces
from flocsim.integrators.rhs.views import inertia, tangential_rate

HALFWAY = FIRST_STAGE
"""The state whose velocity is that of the middle of the step."""


def locate_and_flag(scene, work, state):
    """Fixed steps do not end at switches: every evaluation flags the pairs as they are."""
    locate_contacts(scene, work, state)
    set_modes(scene, work, state)


def gain(scene, work, state, body, axis, step):
    """Change of a velocity in a step at the force of a state."""
    force = work.rates[state, body, FORCE + axis]
    return step * scene.bodies[body, FREE] * force / inertia(scene, body, axis)


def kick_and_drift(scene, work, step):
    """Half a kick into HALFWAY, whose velocity leads to the place of NEW; NEW has a whole kick."""
    motion = work.motion
    for body in range(motion.shape[1]):
        for axis in range(3):
            speed = motion[NOW, body, VELOCITY + axis]
            kick = gain(scene, work, NOW, body, axis, step)
            motion[HALFWAY, body, VELOCITY + axis] = speed + 0.5 * kick
            motion[NEW, body, axis] = motion[NOW, body, axis] + step * (speed + 0.5 * kick)
            # Drag at the half step's velocity would be half a step late: take a whole kick's.
            motion[NEW, body, VELOCITY + axis] = speed + kick


def finish_kick(scene, work, step):
    """The velocity of NEW: that of HALFWAY and half a kick at the force of NEW."""
    for body in range(work.motion.shape[1]):
        for axis in range(3):
            kick = gain(scene, work, NEW, body, axis, 0.5 * step)
            work.motion[NEW, body, VELOCITY + axis] = (
                work.motion[HALFWAY, body, VELOCITY + axis] + kick
            )


def slip_new(work, step):
    """Tangential displacements of NEW from the mean of their rates at both ends."""
    slip = work.slip
    for row in range(work.tally[CANDIDATES]):
        slip[NEW, row] = 0.0
        if work.candidates[row, CLOSED] == 1:
            rate = tangential_rate(work, NEW, row)
            if work.geometry[NOW, row, GAP] < 0.0:
                rate = 0.5 * (rate + tangential_rate(work, NOW, row))
            slip[NEW, row] = slip[NOW, row] + step * rate


def verlet_attempt(scene, work, clock, step):
    """Half a kick, a drift, half a kick: 0, or −1 where the motion is no longer finite."""
    for state in (NOW, NEW):
        if state == NEW:
            kick_and_drift(scene, work, step)
        locate_and_rate(scene, work, state)
        if state == NEW:
            slip_new(work, step)
        sum_forces(scene, work, clock[TIME] + step * (state == NEW), state)
    finish_kick(scene, work, step)
    limit_slips(scene, work)
    return 0.0 if all_finite(work, NEW) else -1.0


def same_step(clock, step, ratio):
    """A fixed-step method keeps its step."""
    return clock[LARGEST_STEP]


@attrs.frozen
class VelocityVerlet(Integrator):
    """Fixed steps of ``step`` [s]: the plain explicit method, to compare with.

    Stable for steps below about 2/ω of the stiffest contact or the strongest damping.
    """

    step: float = quantity("s", above=0.0, default=1e-8)

    @property
    def first_step(self):
        """All steps are equal."""
        return self.step

    @property
    def largest_step(self):
        """All steps are equal."""
        return self.step

    @property
    def fillings(self):
        """The slots that this integrator fills."""
        return {
            slots.attempt: verlet_attempt,
            slots.next_step: same_step,
            locate_acting: locate_and_flag,
        }
