"""What a step of Radau IIA is likely to be wrong by: its embedded estimate of order 3.

It is divided by 1 − γz twice (Hairer & Wanner, Solving Ordinary Differential Equations II, 1996,
IV.8.20): where a contact is pressed, the forces that it balances are so large that what they are
wrong by would else count as a velocity that lasts.
"""

from flocsim.integrators.radau.carried_error import divide
from flocsim.integrators.radau.systems import solve_for_free
from flocsim.integrators.radau.tableau import EIGENVALUES, ESTIMATE, REAL
from flocsim.integrators.rhs.blocks import subtract_product
from flocsim.integrators.rhs.views import inertia
from flocsim.state.work import CHANGE, FIRST_STAGE, NOW, STEP_ERROR, STIFFNESS


def estimated_rate(of, body, axis, step):
    """Weighted mean of the stages' increments over h, ``of`` places or velocities."""
    now = of[NOW, body, axis]
    total = 0.0
    for stage in range(3):
        total += ESTIMATE[stage] * (of[FIRST_STAGE + stage, body, axis] - now)
    return total / step


def write_error_load(scene, work, step):
    """The load of the estimate; the mean rates of places stay in CHANGE."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            row = 3 * body + axis
            load = work.force[NOW, body, axis]
            load += inertia(scene, body, axis) * estimated_rate(work.velocity, body, axis, step)
            work.loads[REAL, row] = load
            drift = work.velocity[NOW, body, axis]
            work.place[CHANGE, body, axis] = drift + estimated_rate(work.place, body, axis, step)
    subtract_product(work, STIFFNESS, step / EIGENVALUES[REAL].real)


def estimate_error(scene, work, step):
    """Make STEP_ERROR what a step is likely to be wrong by, as it is behind the next one as well:
    what contacts take up at once of an error leads to nothing."""
    write_error_load(scene, work, step)
    solve_for_free(scene, work)
    damped = step / EIGENVALUES[REAL].real
    for body in range(work.place.shape[1]):
        free = scene.bodies[body].free
        for axis in range(3):
            speed = work.loads[REAL, 3 * body + axis].real
            drift = work.place[CHANGE, body, axis]
            work.place[CHANGE, body, axis] = free * damped * (speed + drift)
            work.velocity[CHANGE, body, axis] = free * speed
    divide(scene, work, step, 0.0)
    for body in range(work.place.shape[1]):
        for axis in range(3):
            work.place[STEP_ERROR, body, axis] = work.place[CHANGE, body, axis]
            work.velocity[STEP_ERROR, body, axis] = work.velocity[CHANGE, body, axis]
