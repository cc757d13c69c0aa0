"""How large an error is: in metres, at any point of an outline, and in what a velocity leads to.

A velocity error e displaces a body by e·T until drag, or the next encounter, has wiped it out:
1/T = damping rate + speed against the other bodies / size + 1 / time that is left to run.
"""

import math

from flocsim.geometry.contact.points import least_listed_gap, length_of
from flocsim.integrators.rhs.views import inertia, lever
from flocsim.state.bodies import ANGLE, X, Y
from flocsim.state.work import DAMPING, DEVIATION, NEW, NOW

ROUNDING = 1e-15
"""A few units in the last place of a number."""

TINY = 1e-300
"""Keeps the reciprocal of a rate finite."""

FREE_SHARE = 0.01
"""Share of the tolerance that is allowed while no gap is below it: free motion is cheap to follow,
and what it runs into hangs on nanometres."""


def mean_velocity(work, axis):
    """Mean of one component over all bodies [m/s]."""
    total = 0.0
    for body in range(work.place.shape[1]):
        total += work.velocity[NOW, body, axis]
    return total / work.place.shape[1]


def turnover_rate(scene, work, body, mean_x, mean_y):
    """Speed of a body's outline against the mean of all bodies, over its size [1/s]."""
    vx = work.velocity[NOW, body, X] - mean_x
    vy = work.velocity[NOW, body, Y] - mean_y
    return length_of(vx, vy) / scene.bodies[body].bounding_radius + abs(
        work.velocity[NOW, body, ANGLE]
    )


def remember_velocities(scene, work, remaining):
    """Write every body's memory [s]; DAMPING holds the body forces' part alone."""
    mean_x, mean_y = mean_velocity(work, X), mean_velocity(work, Y)
    for body in range(scene.bodies.shape[0]):
        errors = work.errors[body]
        slowest, relaxation = math.inf, 0.0
        turnover = turnover_rate(scene, work, body, mean_x, mean_y)
        for axis in range(3):
            mass = inertia(scene, body, axis)
            damping = max(work.jacobian[DAMPING, body, axis, axis], 0.0)
            relaxation = max(relaxation, mass / max(damping, TINY))
            rate = mass * (turnover + 1.0 / remaining) + damping
            slowest = min(slowest, rate / max(mass, TINY))
        errors.memory = 1.0 / slowest
        errors.relaxation = relaxation


def end_of_run(clock):
    """When a run ends [s]."""
    return max(clock.until, clock.horizon)


def step_tolerance(work, clock):
    """What the error of the next step may be [m]."""
    if least_listed_gap(work) > clock.tolerance:
        return FREE_SHARE * clock.tolerance
    return clock.tolerance


def error_ratio(scene, work, clock, step):
    """The error of the step over what is allowed, −1 where it or the new state is no number."""
    error = error_size(scene, work)
    clock.step_error = error
    if not error < math.inf:
        return -1.0
    return error / max(step_tolerance(work, clock), rounding_size(scene, work, NEW, step))


def body_error(scene, work, body):
    """The error of one body, from DEVIATION: displacement of its outline, now and later [m]; both
    parts of it are written down."""
    errors = work.errors[body]
    size = scene.bodies[body].bounding_radius
    place = length_of(work.place[DEVIATION, body, X], work.place[DEVIATION, body, Y]) + size * abs(
        work.place[DEVIATION, body, ANGLE]
    )
    speed = length_of(
        work.velocity[DEVIATION, body, X], work.velocity[DEVIATION, body, Y]
    ) + size * abs(work.velocity[DEVIATION, body, ANGLE])
    errors.step_place, errors.step_speed = place, speed
    return place + speed * errors.memory


def error_size(scene, work):
    """The largest error of a body; inf where it, or the new state, is no number."""
    largest = 0.0
    for body in range(scene.bodies.shape[0]):
        error = body_error(scene, work, body)
        if not error < math.inf:
            return math.inf
        largest = max(largest, error)
    return largest


def rounding_size(scene, work, state, step):
    """What rounding alone does to a step that ends in a state [m]."""
    largest = 0.0
    for body in range(scene.bodies.shape[0]):
        memory = work.errors[body].memory
        for axis in range(3):
            place = abs(work.place[state, body, axis])
            speed = abs(work.velocity[state, body, axis])
            size = place * (1.0 + memory / step) + speed * (step + memory)
            largest = max(largest, lever(scene, body, axis) * size)
    return ROUNDING * largest
