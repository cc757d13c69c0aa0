"""What a step of backward Euler is likely to be wrong by.

To first order its end is off by ½ h times how much the rates have changed in it, whether smoothly
or, where contacts have closed or opened somewhere in it, at once. As Hairer & Wanner (II, 1996,
IV.8) have it, that is sent through the step's own matrix, which leaves of it what the step would
not have damped: of a body that lands, what it goes on along the other body.

    e_v = (M/h + D + h K)⁻¹ ½ (M (a₀ − a₁) − h K (v₀ − v₁)),   e_x = ½ h (v₀ − v₁) + h e_v

a₁ being the acceleration of the step and a₀ that of the last one: what the forces were before. The
error of velocity is sent through once more, for what the next step leaves of it.
"""

import flocsim.arrays as at
from flocsim.compiler.linker import apart
from flocsim.integrators.radau.systems import solve_for_free
from flocsim.integrators.radau.tableau import REAL
from flocsim.integrators.rhs.blocks import subtract_product
from flocsim.integrators.rhs.views import inertia


def write_rates(work, step):
    """Write the accelerations of the step, which has begun in START, into LAST_RATES."""
    for body in range(work.motion.shape[1]):
        for axis in range(at.VELOCITY, at.VELOCITY + 3):
            change = work.motion[at.NOW, body, axis] - work.motion[at.START, body, axis]
            work.motion[at.LAST_RATES, body, axis] = change / step


@apart
def solve_loads(scene, work, weight):
    """The solution of the system for the loads less ``weight`` K CHANGE."""
    subtract_product(work, at.STIFFNESS, weight)
    solve_for_free(scene, work)


@apart
def estimate_step(scene, work, clock, step):
    """The error of the step, whose end stands in NOW, into DEVIATION."""
    motion, loads = work.motion, work.loads
    if clock[at.RATES_KNOWN] == 0.0:
        write_rates(work, step)
    for body in range(motion.shape[1]):
        for axis in range(3):
            place = at.VELOCITY + axis
            less = motion[at.START, body, place] - motion[at.NOW, body, place]
            slower = motion[at.LAST_RATES, body, place] + less / step
            loads[REAL, 3 * body + axis] = 0.5 * inertia(scene, body, axis) * slower
            motion[at.CHANGE, body, axis] = less
    solve_loads(scene, work, 0.5 * step)
    for body in range(motion.shape[1]):
        free = scene.bodies[body, at.FREE]
        for axis in range(3):
            speed = loads[REAL, 3 * body + axis].real
            error = free * step * (0.5 * motion[at.CHANGE, body, axis] + speed)
            motion[at.DEVIATION, body, axis] = motion[at.CHANGE, body, axis] = error
            loads[REAL, 3 * body + axis] = inertia(scene, body, axis) / step * speed
    solve_loads(scene, work, 1.0)
    for body in range(motion.shape[1]):
        free = scene.bodies[body, at.FREE]
        for axis in range(3):
            motion[at.DEVIATION, body, at.VELOCITY + axis] = (
                free * loads[REAL, 3 * body + axis].real
            )
