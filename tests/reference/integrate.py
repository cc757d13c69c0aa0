"""Equations of motion by DOP853, restarted at the instant each pair opens or closes."""

from dataclasses import dataclass

import numpy as np

from tests.reference.motion import Motion
from tests.reference.shapes import Scene

MOST_EVENTS = 5000
"""A corner that rests at zero overlap opens and closes endlessly; past this many, give up."""


@dataclass(frozen=True)
class Trajectory:
    """t (k,), positions and velocities (k, n, 3), the ξ by pair at the end, and the events.

    An event is (time, keys of the pairs that closed, keys of the pairs that opened).
    """

    bodies: tuple
    t: np.ndarray
    positions: np.ndarray
    velocities: np.ndarray
    displacement: dict
    events: list

    def scene(self, k=-1):
        """The scene at record k."""
        return Scene(self.bodies, self.positions[k], self.velocities[k])


def simulate(scene, laws, duration, displacement=None, rtol=1e-10, max_step=None):
    """The motion of a scene for `duration` [s], every accepted step recorded, as a Trajectory.

    ξ of a pair is the plain integral of v_t while its Δ > 0, under a friction limit too (the
    limit then clips the force and not ξ). Steps are at most `max_step` [s], by default a quarter
    of the least radius over the relative speed of the bodies after the last event.
    OverlapTooDeepError as in `contacts`; RuntimeError if the solver fails, a contact may have
    passed unseen within one step, or contacts chatter without end.
    """
    motion = Motion(scene, laws, displacement or {})
    t, y, events = 0.0, motion.pack(scene), []
    times, states = [0.0], [y[: 6 * motion.count]]
    while t < duration:
        leg = motion.leg(t, y, duration, rtol, max_step)
        t, y = leg.t[-1], leg.y[:, -1]
        times.extend(leg.t[1:])
        states.extend(leg.y[: 6 * motion.count, 1:].T)
        if leg.status == 1:
            events.append((t, *motion.switch(y)))
            if len(events) > MOST_EVENTS:
                raise RuntimeError(f"contacts opened and closed {MOST_EVENTS} times by t = {t} s")
            y = motion.pack(motion.scene(y))
    return trajectory(motion, times, states, events)


def trajectory(motion, times, states, events):
    """The record as arrays."""
    states = np.array(states).reshape(len(times), 2, motion.count, 3)
    keys = [tuple(int(part) for part in row) for row in motion.pairs[motion.active]]
    displacement = dict(zip(keys, motion.xi[motion.active].tolist(), strict=True))
    return Trajectory(
        motion.bodies, np.array(times), states[:, 0], states[:, 1], displacement, events
    )
