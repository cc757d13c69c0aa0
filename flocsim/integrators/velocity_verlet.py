"""Velocity Verlet: explicit, second order, fixed step."""

import attrs

import flocsim.arrays as at
from flocsim.integrators.parts import (
    FixedStep,
    all_finite,
    evaluate,
    inertia,
    limit_slips,
    move_slips,
    sum_forces,
)

HALFWAY = at.FIRST_STAGE
"""The state whose velocity is that of the middle of the step."""


def kick_and_drift(scene, work, step):
    """Half a kick into HALFWAY, whose velocity leads to the place of NEW; NEW has a whole kick."""
    motion = work.motion
    for body in range(motion.shape[1]):
        for axis in range(3):
            speed = motion[at.NOW, body, at.VELOCITY + axis]
            kick = gain(scene, work, at.NOW, body, axis, step)
            motion[HALFWAY, body, at.VELOCITY + axis] = speed + 0.5 * kick
            motion[at.NEW, body, axis] = motion[at.NOW, body, axis] + step * (speed + 0.5 * kick)
            # Drag at the half step's velocity would be half a step late: take a whole kick's.
            motion[at.NEW, body, at.VELOCITY + axis] = speed + kick


def finish_kick(scene, work, step):
    """The velocity of NEW: that of HALFWAY and half a kick at the force of NEW."""
    for body in range(work.motion.shape[1]):
        for axis in range(3):
            kick = gain(scene, work, at.NEW, body, axis, 0.5 * step)
            work.motion[at.NEW, body, at.VELOCITY + axis] = (
                work.motion[HALFWAY, body, at.VELOCITY + axis] + kick
            )


def gain(scene, work, state, body, axis, step):
    """Change of a velocity in a step at the force of a state."""
    force = work.rates[state, body, at.FORCE + axis]
    return step * scene.bodies[body, at.FREE] * force / inertia(scene, body, axis)


@attrs.frozen
class VelocityVerlet(FixedStep):
    """Fixed steps of ``step`` [s]: the plain explicit method, to compare with.

    Stable for steps below about 2/ω of the stiffest contact or the strongest damping.
    """

    @staticmethod
    def attempt(scene, work, clock, step):
        """Half a kick, a drift, half a kick: 0, or −1 where the motion is no longer finite."""
        evaluate(scene, work, clock[at.TIME], at.NOW)
        kick_and_drift(scene, work, step)
        move_slips(scene, work, step)
        sum_forces(scene, work, clock[at.TIME] + step, at.NEW)
        finish_kick(scene, work, step)
        limit_slips(scene, work)
        return 0.0 if all_finite(work, at.NEW) else -1.0
