"""Embedded error estimate of order 3 of a Radau IIA step.

    e = (1 − γz)⁻¹ (γh F₀/M + Σ e_i (Y_i − y₀)),  filtered once more by (1 − γz)⁻¹

(Hairer & Wanner, Solving Ordinary Differential Equations II, 1996, IV.8.19 and IV.8.20; z is h
times the Jacobian, γ = 1/µ). The second filter always applies here: a pressed contact balances
forces so large that their error would count as a velocity that persists. With it rolling doublets
take half as many steps. Estimates that are less pessimistic in impacts were tried and rejected:
they saved 5 to 20 % of the steps, for more flipped outcomes or more Newton iterations
(docs/evidence/engine.md).
"""

from flocsim.integrators.radau.carried_error import apply_resolvent
from flocsim.integrators.radau.systems import solve_prepared
from flocsim.integrators.radau.tableau import EIGENVALUES, ESTIMATE, REAL
from flocsim.integrators.rhs.blocks import subtract_product
from flocsim.integrators.rhs.views import inertia
from flocsim.state.work import CHANGE, FIRST_STAGE, NOW, STEP_ERROR, STIFFNESS


def embedded_rate(of, body, axis, step):
    """Return Σ e_i (Y_i − y₀)/(γ h) of positions or velocities, given as the array ``of``."""
    now = of[NOW, body, axis]
    total = 0.0
    for stage in range(3):
        total += ESTIMATE[stage] * (of[FIRST_STAGE + stage, body, axis] - now)
    return total / step


def write_error_load(scene, work, step):
    """Write the load of the estimate; leave the estimate's rates of the positions in CHANGE."""
    for body in range(work.place.shape[1]):
        for axis in range(3):
            row = 3 * body + axis
            load = work.force[NOW, body, axis]
            load += inertia(scene, body, axis) * embedded_rate(work.velocity, body, axis, step)
            work.loads[REAL, row] = load
            drift = work.velocity[NOW, body, axis]
            work.place[CHANGE, body, axis] = drift + embedded_rate(work.place, body, axis, step)
    subtract_product(work, STIFFNESS, step / EIGENVALUES[REAL].real)


def estimate_error(scene, work, step):
    """Write the estimated error of the step to STEP_ERROR, without the part that contacts damp at
    once."""
    write_error_load(scene, work, step)
    solve_prepared(scene, work)
    # First filter: velocities from the solved system, positions from them (γh = h/µ).
    damped = step / EIGENVALUES[REAL].real
    for body in range(work.place.shape[1]):
        free = scene.bodies[body].free
        for axis in range(3):
            speed = work.loads[REAL, 3 * body + axis].real
            drift = work.place[CHANGE, body, axis]
            work.place[CHANGE, body, axis] = free * damped * (speed + drift)
            work.velocity[CHANGE, body, axis] = free * speed
    # Second filter, without the source term.
    apply_resolvent(scene, work, step, 0.0)
    for body in range(work.place.shape[1]):
        for axis in range(3):
            work.place[STEP_ERROR, body, axis] = work.place[CHANGE, body, axis]
            work.velocity[STEP_ERROR, body, axis] = work.velocity[CHANGE, body, axis]
