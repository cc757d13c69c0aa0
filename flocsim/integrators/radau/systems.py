"""Linear systems of a Newton iteration: from the residuals of the stages to velocity corrections.

With residuals r of the three stages, the correction δV of their velocities solves

    (A⁻¹ M/h + D + h A K) δV = r,  D = −∂F/∂v (DAMPING), K = −∂F/∂x (STIFFNESS).

With A⁻¹ = T Λ T⁻¹ this decouples into one system for each eigenvalue µ (tableau.py),

    ((µ/h) M + D + (h/µ) K) δW = T⁻¹ r,  δV = T δW,

in the frames of contact_frames.py. Systems of few bodies are dense (dense.py), those of many are
sparse, in an order with little fill-in (elimination.py).
"""

from flocsim.compiler.linker import apart
from flocsim.integrators.radau.contact_frames import add_shifts, force_at_start, velocity_at_stage
from flocsim.integrators.radau.dense import factorise_dense, solve_dense
from flocsim.integrators.radau.elimination import factorise_sparse, solve_sparse
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
from flocsim.integrators.rhs.blocks import lower_block, upper_block
from flocsim.integrators.rhs.views import inertia
from flocsim.state.bodies import ANGLE, X, Y
from flocsim.state.work import CHANGE, DAMPING, DENSE, FIRST_STAGE, NOW, STIFFNESS


def is_dense(work):
    """Return True if the systems are small enough for dense factors."""
    return work.poses.shape[0] <= DENSE


def write_dense_block(scene, work, which, step, block, body, other):
    """Write a block of D + (h/µ) K to a dense system; rows of a fixed body stay zero."""
    value, moves = EIGENVALUES[which], scene.bodies[body].free
    for i in range(3):
        for j in range(3):
            entry = work.jacobian[DAMPING, block, i, j]
            entry = entry + step / value * work.jacobian[STIFFNESS, block, i, j]
            work.system[which, 3 * body + i, 3 * other + j] = moves * entry


def write_dense_matrix(scene, work, which, step):
    """Write (µ/h) M + D + (h/µ) K for one eigenvalue µ as a dense matrix."""
    value = EIGENVALUES[which]
    for body in range(work.poses.shape[0]):
        write_dense_block(scene, work, which, step, body, body, body)
        for axis in range(3):
            # A fixed body gets the identity: its velocity stays zero.
            row, mass = 3 * body + axis, inertia(scene, body, axis)
            moves = scene.bodies[body].free
            work.system[which, row, row] += value / step * mass if moves == 1.0 else 1.0
    for pair in range(work.tally.pairs):
        a, b = work.pairs[pair].later, work.pairs[pair].earlier
        write_dense_block(scene, work, which, step, lower_block(work, pair), a, b)
        write_dense_block(scene, work, which, step, upper_block(work, pair), b, a)
    # Momentum is conserved to rounding by this change of equations.
    sum_cluster_rows(work, which)


def sum_cluster_rows(work, which):
    """Replace the force balance of a cluster's first body by the momentum balance of the cluster.

    Mutual forces cancel in the sum of rows. So rounding of the solution cannot change momentum.
    """
    for body in range(work.poses.shape[0]):
        leader = work.cluster[body]
        if leader != body:
            for axis in range(2):
                for column in range(work.system.shape[1]):
                    entry = work.system[which, 3 * body + axis, column]
                    work.system[which, 3 * leader + axis, column] += entry


def sum_cluster_loads(work, which):
    """Sum the loads of each cluster into its first body's, as sum_cluster_rows does with the
    rows."""
    for body in range(work.poses.shape[0]):
        leader = work.cluster[body]
        if leader != body:
            for axis in range(2):
                work.loads[which, 3 * leader + axis] += work.loads[which, 3 * body + axis]


def write_and_factorise(scene, work, step, both):
    """Write and factorise the real system, or both; return False if one is singular or lacks
    room."""
    if not is_dense(work):
        return factorise_sparse(scene, work, step, both)
    for which in range(2 if both else 1):
        write_dense_matrix(scene, work, which, step)
        if not factorise_dense(work.system, work.pivots, which):
            return False
    return True


def factorise_systems(scene, work, step):
    """Write and factorise both systems; return False if one is singular or lacks room."""
    return write_and_factorise(scene, work, step, True)


@apart
def factorise_euler(scene, work, step):
    """Write and factorise the system of backward Euler, M/h + D + h K; return False if that fails.

    It is Radau's real system for a step that is µ times as long.
    """
    return write_and_factorise(scene, work, EIGENVALUES[REAL].real * step, False)


def solve_real(work):
    """Replace the load of the real system by the solution."""
    if is_dense(work):
        solve_dense(work.system, work.pivots, work.loads, REAL)
    else:
        solve_sparse(work, False)


def prepare_load(scene, work):
    """Zero the real load of fixed bodies, and sum each cluster's into that of its first body."""
    for body in range(work.poses.shape[0]):
        for axis in range(3):
            work.loads[REAL, 3 * body + axis] *= scene.bodies[body].free
    sum_cluster_loads(work, REAL)


def solve_prepared(scene, work):
    """Solve the real system for its load, after prepare_load."""
    prepare_load(scene, work)
    solve_real(work)


def solve_both(work):
    """Replace the loads of both systems by the solutions."""
    if is_dense(work):
        for which in range(2):
            solve_dense(work.system, work.pivots, work.loads, which)
    else:
        solve_sparse(work, True)


def momentum_rate(scene, work, body, axis, stage, step):
    """Return mass times acceleration at a stage, M A⁻¹ (V − v₀)/h [N or N m]."""
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
