"""Velocity Verlet: explicit, second order, fixed step."""

import attrs

from flocsim import slots
from flocsim.fields import quantity
from flocsim.integrators.base import Integrator, all_finite
from flocsim.integrators.explicit import sum_forces
from flocsim.integrators.slips import advance_slips
from flocsim.layout import FORCE, FREE, HALF, INERTIA, LARGEST_STEP, MASS, NEW, NOW, TIME


def kick(scene, work, start, end, step):
    """Velocity of state ``end`` = that of ``start`` + step · acceleration, for free bodies."""
    known = scene.bodies
    for body in range(known.shape[0]):
        for axis in range(3):
            inertia = known[body, INERTIA] if axis == 2 else known[body, MASS]
            gain = step * known[body, FREE] * work.bodies[body, FORCE + axis] / inertia
            work.motion[end, body, 3 + axis] = work.motion[start, body, 3 + axis] + gain


def drift(work, step):
    """Place of NEW = place of NOW + step · velocity of HALF."""
    motion = work.motion
    for body in range(motion.shape[1]):
        for axis in range(3):
            motion[NEW, body, axis] = motion[NOW, body, axis] + step * motion[HALF, body, 3 + axis]


def verlet_attempt(scene, work, clock, step):
    """Half a kick, a drift, half a kick: 0, or −1 where the motion is no longer finite."""
    time = clock[TIME]
    sum_forces(scene, work, time, NOW, NOW, NOW)
    kick(scene, work, NOW, HALF, 0.5 * step)
    advance_slips(scene, work, HALF, NOW, NEW, step)
    drift(work, step)
    # Drag at the half step's velocity would be half a step late: take a whole kick's instead.
    kick(scene, work, NOW, NEW, step)
    sum_forces(scene, work, time + step, NEW, NEW, NEW)
    kick(scene, work, HALF, NEW, 0.5 * step)
    if not all_finite(work, NEW):
        return -1.0
    return 0.0


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
        return {slots.attempt: verlet_attempt, slots.next_step: same_step}
