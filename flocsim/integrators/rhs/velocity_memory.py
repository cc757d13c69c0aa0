"""How long a velocity is remembered: what turns an error in velocity into one in place.

A velocity error e displaces a body by e·T until drag, or the next encounter, has wiped it out:
1/T = damping rate + speed against the other bodies / size + 1 / time that is left to run.
"""

import math

from flocsim.arrays import BOUNDING_RADIUS, DAMPING, MEMORY, NOW, SPIN, VX, VY
from flocsim.integrators.rhs.views import inertia

TINY = 1e-300
"""Keeps the reciprocal of a rate finite."""


def mean_velocity(work, axis):
    """Mean of one component over all bodies [m/s]."""
    total = 0.0
    for body in range(work.motion.shape[1]):
        total += work.motion[NOW, body, axis]
    return total / work.motion.shape[1]


def turnover_rate(scene, work, body):
    """Speed of a body's outline against the mean of all bodies, over its size [1/s]."""
    motion = work.motion
    vx = motion[NOW, body, VX] - mean_velocity(work, 3)
    vy = motion[NOW, body, VY] - mean_velocity(work, 4)
    return math.hypot(vx, vy) / scene.bodies[body, BOUNDING_RADIUS] + abs(motion[NOW, body, SPIN])


def remember_velocities(scene, work, remaining):
    """Write every body's memory [s]; DAMPING holds the body forces' part alone."""
    for body in range(scene.bodies.shape[0]):
        slowest = math.inf
        for axis in range(3):
            mass = inertia(scene, body, axis)
            damping = max(work.jacobian[DAMPING, 3 * body + axis, 3 * body + axis], 0.0)
            rate = mass * (turnover_rate(scene, work, body) + 1.0 / remaining) + damping
            slowest = min(slowest, rate / max(mass, TINY))
        work.bodies[body, MEMORY] = 1.0 / slowest
