"""Linear systems of a Newton iteration: from the residuals of the stages to velocity corrections.

With residuals r of the three stages, the correction δV of their velocities solves

    (A⁻¹ M/h + D + h A K) δV = r,  D = −∂F/∂v (DAMPING), K = −∂F/∂x (STIFFNESS).

With A⁻¹ = T Λ T⁻¹ this decouples into one system for each eigenvalue µ (tableau.py),

    ((µ/h) M + D + (h/µ) K) δW = T⁻¹ r,  δV = T δW,

in the frames of contact_frames.py. The systems are sparse, and eliminated in an order with little
fill-in (elimination.py).
"""

from flocsim.compiler.linker import apart
from flocsim.integrators.radau.contact_frames import add_shifts, force_at_start, velocity_at_stage
from flocsim.integrators.radau.elimination import factorise_blocks, solve_blocks
from flocsim.integrators.radau.tableau import (
    COMPLEX,
    EIGENVALUES,
    FROM_EIGENBASIS,
    INVERSE,
    REAL,
    SECOND_STAGE,
    THIRD_STAGE,
    TO_EIGENBASIS,
)
from flocsim.integrators.rhs.views import inertia
from flocsim.state.bodies import ANGLE, X, Y
from flocsim.state.work import CHANGE, FIRST_STAGE, NOW


def sum_cluster_loads(work, which):
    """Sum the loads of each cluster into its first body's, whose row is the momentum balance."""
    # The sum replaces the first body's own balance: mutual forces cancel, momentum is exact.
    for body in range(work.poses.shape[0]):
        leader = work.cluster[body]
        if leader != body:
            for axis in range(2):
                work.loads[which, 3 * leader + axis] += work.loads[which, 3 * body + axis]


def factorise_systems(scene, work, step):
    """Write and factorise both systems; return False if one is singular or lacks room."""
    return factorise_blocks(scene, work, step, True)


@apart
def factorise_euler(scene, work, step):
    """Write and factorise the system of backward Euler, M/h + D + h K; return False if that fails.

    It is Radau's real system for a step that is µ times as long.
    """
    return factorise_blocks(scene, work, EIGENVALUES[REAL].real * step, False)


def prepare_load(scene, work):
    """Zero the real load of fixed bodies, and sum each cluster's into that of its first body."""
    for body in range(work.poses.shape[0]):
        for axis in range(3):
            work.loads[REAL, 3 * body + axis] *= scene.bodies[body].free
    sum_cluster_loads(work, REAL)


def solve_prepared(scene, work):
    """Solve the real system for its load, after prepare_load."""
    prepare_load(scene, work)
    solve_blocks(work, False)


def solve_both(work):
    """Replace the loads of both systems by the solutions."""
    solve_blocks(work, True)


def momentum_rate(scene, work, body, axis, stage, step):
    """Return mass times acceleration at a stage, M A⁻¹ (V − v₀)/h [N or N m]."""
    # The stages obey V = v₀ + h A V̇, so that V̇ = A⁻¹ (V − v₀)/h.
    first, second, third = INVERSE[stage]
    now = work.velocity[NOW, body, axis]
    change = first * (work.velocity[FIRST_STAGE, body, axis] - now)
    change += second * (work.velocity[SECOND_STAGE, body, axis] - now)
    change += third * (work.velocity[THIRD_STAGE, body, axis] - now)
    return inertia(scene, body, axis) * change / step


def residual(scene, work, body, axis, stage, step):
    """Return force minus mass times acceleration at a stage [N or N m]."""
    rate = momentum_rate(scene, work, body, axis, stage, step)
    return work.force[FIRST_STAGE + stage, body, axis] - rate


def sum_cluster_residuals(scene, work, stage, step):
    """Sum forces, and masses times accelerations, of each cluster at a stage into its first body's
    record.

    Forces are summed apart from accelerations: mutual forces then cancel exactly.
    """
    for body in range(work.poses.shape[0]):
        cluster = work.clusters[body]
        cluster.force_x = cluster.force_y = cluster.rate_x = cluster.rate_y = 0.0
    for body in range(work.poses.shape[0]):
        # Each body adds to the record of its cluster's first body; alone, it is that body itself.
        cluster, state = work.clusters[work.cluster[body]], FIRST_STAGE + stage
        cluster.force_x += work.force[state, body, X]
        cluster.force_y += work.force[state, body, Y]
        cluster.rate_x += momentum_rate(scene, work, body, 0, stage, step)
        cluster.rate_y += momentum_rate(scene, work, body, 1, stage, step)


def stage_residual(scene, work, body, stage, step):
    """Return the residual (x, y, rotation) of a body at a stage, in the frame of the step's
    start."""
    x = residual(scene, work, body, 0, stage, step)
    y = residual(scene, work, body, 1, stage, step)
    torque = residual(scene, work, body, 2, stage, step)
    x, y, torque = force_at_start(work, body, stage, x, y, torque)
    # The first body of a cluster stands for the momentum balance of all.
    if work.cluster[body] == body:
        x = work.clusters[body].force_x - work.clusters[body].rate_x
        y = work.clusters[body].force_y - work.clusters[body].rate_y
        x, y, _ = force_at_start(work, body, stage, x, y, 0.0)
    return x, y, torque


def write_residuals(scene, work, step):
    """Write T⁻¹ r, the residuals in the frame of the step's start, to the loads of both systems."""
    for which in range(2):
        for row in range(work.loads.shape[1]):
            work.loads[which, row] = 0.0
    # Transform to the eigenbasis, stage by stage. Fixed bodies have no load.
    for stage in range(3):
        sum_cluster_residuals(scene, work, stage, step)
        for body in range(work.place.shape[1]):
            if scene.bodies[body].free == 1.0:
                load = stage_residual(scene, work, body, stage, step)
                for axis in range(3):
                    for which in range(2):
                        component = TO_EIGENBASIS[which][stage] * load[axis]
                        work.loads[which, 3 * body + axis] += component


def stage_solution(work, row, stage):
    """Return one coordinate of one stage's correction, T δW; conjugate eigenvectors add twice the
    real part."""
    of_real, of_pair = FROM_EIGENBASIS[stage]
    real, pair = work.loads[REAL, row], work.loads[COMPLEX, row]
    return (of_real * real).real + 2.0 * (of_pair * pair).real


def write_stage_changes(scene, work, stage):
    """Write the velocity corrections of one stage, in its own frame, to CHANGE."""
    for body in range(work.place.shape[1]):
        x, y = stage_solution(work, 3 * body, stage), stage_solution(work, 3 * body + 1, stage)
        # Rotate to the stage, then move the reference point with the contacts.
        x, y = velocity_at_stage(work, body, stage, x, y)
        work.velocity[CHANGE, body, X] = x
        work.velocity[CHANGE, body, Y] = y
        work.velocity[CHANGE, body, ANGLE] = stage_solution(work, 3 * body + 2, stage)
    add_shifts(scene, work, stage)
