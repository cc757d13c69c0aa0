"""The size of an error: in metres at any point of an outline, including what a velocity error leads
to.

A velocity error e displaces a body by e T, where the velocity lifetime T ends by drag, by the next
encounter, or with the run:

    1/T = damping/mass + speed relative to the other bodies/size + 1/(time left to run).

The error of a step is the largest |Δx| + R |Δθ| + T (|Δv| + R |Δω|) over bodies, R being the
bounding radius.
"""

import math

from flocsim.constants import TINY
from flocsim.geometry.contact.points import least_listed_gap, length_of
from flocsim.integrators.rhs.views import inertia, lever
from flocsim.state.bodies import ANGLE, X, Y
from flocsim.state.work import DAMPING, NEW, NOW, STEP_ERROR

ROUNDING = 1e-15
"""Relative rounding of a coordinate or a time: a few units in the last place."""

COARSEST_ROUNDING = 2e-15
"""Limit of any resolution, as a fraction of the coordinates: ten neighbouring floating-point
numbers. At half of it, doublets of very stiff bodies rattle for twice as many steps."""

MAX_ITERATIONS = 10
"""Iterations for the end of a step before it is repeated with a smaller size, or otherwise."""

ITERATION_TOLERANCE = 0.01
"""Error that iterations for the end of a step may leave, as a fraction of the tolerance. With .05
the errors of consecutive series have one sign, and runs become ten times less accurate."""

NEGLIGIBLE = 0.1
"""Fraction of the tolerance below which an error, or a displacement by contacts that graze, counts
as none."""

FREE_MOTION_FRACTION = 0.01
"""Fraction of the tolerance allowed while no gap is below it. Free motion is cheap to follow, and
the outcome of the encounter that it leads to depends on nanometres."""

SAFETY = 0.9
"""Fraction of the step at which the error would just meet the tolerance."""

SMALLEST_FACTOR, LARGEST_FACTOR = 0.1, 8.0
"""Bounds of the change from one step to the next, but behind a switch (loop/step_size.plan)."""


def mean_velocity(work, axis):
    """Return the mean of one velocity component over all bodies [m/s]."""
    total = 0.0
    for body in range(work.place.shape[1]):
        total += work.velocity[NOW, body, axis]
    return total / work.place.shape[1]


def encounter_rate(scene, work, body, mean_x, mean_y):
    """Return the speed of a body's outline relative to the mean of all bodies, over its size
    [1/s]."""
    vx = work.velocity[NOW, body, X] - mean_x
    vy = work.velocity[NOW, body, Y] - mean_y
    return length_of(vx, vy) / scene.bodies[body].bounding_radius + abs(
        work.velocity[NOW, body, ANGLE]
    )


def set_velocity_lifetimes(scene, work, remaining):
    """Set every body's velocity lifetime and relaxation time [s]. DAMPING must hold body forces
    only."""
    mean_x, mean_y = mean_velocity(work, X), mean_velocity(work, Y)
    for body in range(scene.bodies.shape[0]):
        errors = work.errors[body]
        slowest, relaxation_time = math.inf, 0.0
        turnover = encounter_rate(scene, work, body, mean_x, mean_y)
        # The component with the lowest rate lasts longest.
        for axis in range(3):
            mass = inertia(scene, body, axis)
            damping = max(work.jacobian[DAMPING, body, axis, axis], 0.0)
            relaxation_time = max(relaxation_time, mass / max(damping, TINY))
            rate = mass * (turnover + 1.0 / remaining) + damping
            slowest = min(slowest, rate / max(mass, TINY))
        errors.velocity_lifetime = 1.0 / slowest
        errors.relaxation_time = relaxation_time


def end_of_run(clock):
    """Return the end of the run, not of a window of it [s]."""
    return max(clock.until, clock.horizon)


def step_tolerance(work, clock):
    """Return the error that the next step may have [m]."""
    # No contact, and none that the error could cause: free motion.
    if least_listed_gap(work) > clock.tolerance:
        return FREE_MOTION_FRACTION * clock.tolerance
    return clock.tolerance


def error_ratio(scene, work, clock, step):
    """Return the error of the step over its tolerance, −1 if it or the new state is not finite.

    The error is read from STEP_ERROR, a displacement and velocity per body, and its size is written
    to ``clock.step_error`` [m]. An error below rounding counts as allowed.
    """
    error = largest_error(scene, work)
    clock.step_error = error
    if not error < math.inf:
        return -1.0
    # An error below rounding cannot be reduced by a smaller step.
    return error / max(step_tolerance(work, clock), rounding_error(scene, work, NEW, step))


def outline_size(scene, vectors, kind, body):
    """Return the length of a body's row of vectors, such as errors, at its outline, rotation
    included.

    ``vectors`` and ``kind``: an array and a state, such as ``work.place`` and STEP_ERROR [m].
    """
    turn = scene.bodies[body].bounding_radius * abs(vectors[kind, body, ANGLE])
    return length_of(vectors[kind, body, X], vectors[kind, body, Y]) + turn


def largest_error(scene, work):
    """Return the largest error of a body [m], from STEP_ERROR; inf if one is not finite. Its two
    parts are stored in ``work.errors``."""
    largest = 0.0
    for body in range(scene.bodies.shape[0]):
        errors = work.errors[body]
        errors.step_displacement = outline_size(scene, work.place, STEP_ERROR, body)
        errors.step_velocity = outline_size(scene, work.velocity, STEP_ERROR, body)
        error = errors.step_displacement + errors.step_velocity * errors.velocity_lifetime
        if not error < math.inf:
            return math.inf
        largest = max(largest, error)
    return largest


def rounding_error(scene, work, state, step):
    """Return the error by rounding alone of a step that ends in a state [m]."""
    largest = 0.0
    for body in range(scene.bodies.shape[0]):
        velocity_lifetime = work.errors[body].velocity_lifetime
        for axis in range(3):
            place = abs(work.place[state, body, axis])
            speed = abs(work.velocity[state, body, axis])
            # Rounding of a position counts itself, and as a velocity error when divided by the
            # step.
            size = place * (1.0 + velocity_lifetime / step) + speed * (step + velocity_lifetime)
            largest = max(largest, lever(scene, body, axis) * size)
    return ROUNDING * largest


def largest_coordinate(work, state):
    """Return the largest coordinate of a body [m]."""
    furthest = 0.0
    for body in range(work.place.shape[1]):
        for axis in range(2):
            furthest = max(furthest, abs(work.place[state, body, axis]))
    return furthest


def at_least_rounding(work, state, length):
    """Return a length [m], but not less than what coordinates can resolve."""
    return max(length, COARSEST_ROUNDING * largest_coordinate(work, state))
