"""What a step of backward Euler is likely to be wrong by.

To first order its end is off by ½ h times how much the rates have changed in it, whether smoothly
or, where contacts have closed or opened somewhere in it, at once. As Hairer & Wanner (II, 1996,
IV.8) have it, that is sent through the step's own matrix, which leaves of it what the step would
not have damped: of a body that lands, what it goes on along the other body.

    e_v = (M/h + D + h K)⁻¹ ½ (M (a₀ − a₁) − h K (v₀ − v₁)),   e_x = ½ h (v₀ − v₁) + h e_v

a₁ being the acceleration of the step and a₀ that of the last one: what the forces were before. The
error of velocity is sent through once more, for what the next step leaves of it.
"""

from flocsim.arrays import (
    CHANGE,
    DEVIATION,
    FIRST_STAGE,
    FREE,
    NOW,
    START,
    STIFFNESS,
    TOLERANCE,
    VELOCITY,
)
from flocsim.compiler.composer import apart
from flocsim.integrators.radau.elimination import solve_sparse
from flocsim.integrators.radau.systems import balance_load
from flocsim.integrators.radau.tableau import REAL
from flocsim.integrators.rhs.blocks import subtract_product
from flocsim.integrators.rhs.error import error_size, rounding_size
from flocsim.integrators.rhs.views import inertia

BEFORE = FIRST_STAGE + 3
"""Row of ``Work.motion`` for the accelerations of the last step, which Radau has no use for."""


def accelerations(work, row, step, known):
    """Write the accelerations of the step into a row; those of the step before as well, where
    they are not known."""
    for body in range(work.motion.shape[1]):
        for axis in range(VELOCITY, VELOCITY + 3):
            change = work.motion[NOW, body, axis] - work.motion[START, body, axis]
            work.motion[row, body, axis] = change / step
            if not known:
                work.motion[BEFORE, body, axis] = change / step


@apart
def solve_loads(scene, work, weight):
    """The solution of the system for the loads less ``weight`` K CHANGE."""
    subtract_product(work, STIFFNESS, weight)
    balance_load(scene, work)
    solve_sparse(work, False)


def estimate_step(scene, work, step, known):
    """The error of the step into DEVIATION; ``known``: whether there was a step before."""
    motion, loads = work.motion, work.loads
    accelerations(work, DEVIATION, step, known)
    for body in range(motion.shape[1]):
        for axis in range(3):
            place = VELOCITY + axis
            less = motion[BEFORE, body, place] - motion[DEVIATION, body, place]
            loads[REAL, 3 * body + axis] = 0.5 * inertia(scene, body, axis) * less
            motion[CHANGE, body, axis] = motion[START, body, place] - motion[NOW, body, place]
    solve_loads(scene, work, 0.5 * step)
    for body in range(motion.shape[1]):
        free = scene.bodies[body, FREE]
        for axis in range(3):
            speed = loads[REAL, 3 * body + axis].real
            error = free * step * (0.5 * motion[CHANGE, body, axis] + speed)
            motion[DEVIATION, body, axis] = motion[CHANGE, body, axis] = error
            loads[REAL, 3 * body + axis] = inertia(scene, body, axis) / step * speed
    solve_loads(scene, work, 1.0)
    for body in range(motion.shape[1]):
        free = scene.bodies[body, FREE]
        for axis in range(3):
            motion[DEVIATION, body, VELOCITY + axis] = free * loads[REAL, 3 * body + axis].real


@apart
def step_ratio(scene, work, clock, step, known):
    """The error of the step over what is allowed, −1 where it is no number."""
    estimate_step(scene, work, step, known)
    error = error_size(scene, work)
    if not error < 1e300:
        return -1.0
    return error / max(clock[TOLERANCE], rounding_size(scene, work, NOW, step))
