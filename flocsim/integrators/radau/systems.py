"""The linear systems of a Newton step: from what the stages fail to balance to new velocities.

Radau's stages are decoupled along two eigenvectors (tableau.py), in frames that go along with the
contacts (contact_frames.py). The systems of few bodies are factorised as they stand (dense.py),
those of many in an order in which little fills in (elimination.py).
"""

from flocsim.compiler.linker import apart
from flocsim.integrators.radau.contact_frames import add_shifts, force_back, velocity_on
from flocsim.integrators.radau.dense import factorise, solve_dense
from flocsim.integrators.radau.elimination import factorise_sparse, solve_sparse
from flocsim.integrators.radau.tableau import (
    EIGENVALUES,
    FROM_VECTORS,
    INVERSE,
    PAIR,
    REAL,
    SECOND_STAGE,
    THIRD_STAGE,
    TO_VECTORS,
)
from flocsim.integrators.rhs.blocks import lower_block, upper_block
from flocsim.integrators.rhs.views import inertia
from flocsim.state.bodies import ANGLE, X, Y
from flocsim.state.work import CHANGE, DAMPING, DENSE, FIRST_STAGE, NOW, STIFFNESS


def is_dense(work):
    """Whether the systems are small."""
    return work.poses.shape[0] <= DENSE


def write_block(scene, work, which, step, block, body, other):
    """Write a block of DAMPING + (h/µ) STIFFNESS to the dense system; fixed bodies stay."""
    value, moves = EIGENVALUES[which], scene.bodies[body].free
    for i in range(3):
        for j in range(3):
            entry = work.jacobian[DAMPING, block, i, j]
            entry = entry + step / value * work.jacobian[STIFFNESS, block, i, j]
            work.system[which, 3 * body + i, 3 * other + j] = moves * entry


def write_matrix(scene, work, which, step):
    """(µ/h) M + DAMPING + (h/µ) STIFFNESS for one eigenvalue µ, dense."""
    value = EIGENVALUES[which]
    for body in range(work.poses.shape[0]):
        write_block(scene, work, which, step, body, body, body)
        for axis in range(3):
            row, mass = 3 * body + axis, inertia(scene, body, axis)
            moves = scene.bodies[body].free
            work.system[which, row, row] += value / step * mass if moves == 1.0 else 1.0
    for pair in range(work.tally.pairs):
        a, b = work.pairs[pair].later, work.pairs[pair].earlier
        write_block(scene, work, which, step, lower_block(work, pair), a, b)
        write_block(scene, work, which, step, upper_block(work, pair), b, a)
    sum_matrix(work, which)


def sum_matrix(work, which):
    """Put the balance of a cluster's momentum in the place of that of its first body's.

    Mutual forces cancel in it, so that rounding in the solution of the rest leaves momentum alone.
    """
    for body in range(work.poses.shape[0]):
        leader = work.cluster[body]
        if leader != body:
            for axis in range(2):
                for column in range(work.system.shape[1]):
                    entry = work.system[which, 3 * body + axis, column]
                    work.system[which, 3 * leader + axis, column] += entry


def sum_loads(work, which):
    """The same of a load."""
    for body in range(work.poses.shape[0]):
        leader = work.cluster[body]
        if leader != body:
            for axis in range(2):
                work.loads[which, 3 * leader + axis] += work.loads[which, 3 * body + axis]


def factorise_these(scene, work, step, both):
    """Write and factorise the real system, or both; False where one is singular, or where there is
    no room."""
    if not is_dense(work):
        return factorise_sparse(scene, work, step, both)
    for which in range(2 if both else 1):
        write_matrix(scene, work, which, step)
        if not factorise(work.system, work.pivots, which):
            return False
    return True


def factorise_systems(scene, work, step):
    """The same of both systems."""
    return factorise_these(scene, work, step, True)


@apart
def factorise_euler(scene, work, step):
    """The same of the system of a step of backward Euler, M/h + DAMPING + h STIFFNESS: Radau's real
    one for a step that is µ times as long."""
    return factorise_these(scene, work, EIGENVALUES[REAL].real * step, False)


def solve_real(work):
    """Replace the load of the real system by the solution."""
    if is_dense(work):
        solve_dense(work.system, work.pivots, work.loads, REAL)
    else:
        solve_sparse(work, False)


def balance_load(scene, work):
    """Make the load of the real system none for fixed bodies, and the cluster's sum for first
    ones."""
    for body in range(work.poses.shape[0]):
        for axis in range(3):
            work.loads[REAL, 3 * body + axis] *= scene.bodies[body].free
    sum_loads(work, REAL)


def solve_for_free(scene, work):
    """The solution of the real system for its load, balanced."""
    balance_load(scene, work)
    solve_real(work)


def solve_both(work):
    """Replace the loads of both systems by the solutions."""
    if is_dense(work):
        for which in range(2):
            solve_dense(work.system, work.pivots, work.loads, which)
    else:
        solve_sparse(work, True)


def momentum_rate(scene, work, body, axis, stage, step):
    """Mass times acceleration at a stage, from the stages' velocities."""
    first, second, third = INVERSE[stage]
    now = work.velocity[NOW, body, axis]
    change = first * (work.velocity[FIRST_STAGE, body, axis] - now)
    change += second * (work.velocity[SECOND_STAGE, body, axis] - now)
    change += third * (work.velocity[THIRD_STAGE, body, axis] - now)
    return inertia(scene, body, axis) * change / step


def imbalance(scene, work, body, axis, stage, step):
    """Force less mass times acceleration at a stage."""
    rate = momentum_rate(scene, work, body, axis, stage, step)
    return work.force[FIRST_STAGE + stage, body, axis] - rate


def sum_balances(scene, work, stage, step):
    """Forces, and masses times accelerations, of every cluster at a stage into its first body's
    Cluster; forces and rates apart, so that what is mutual cancels."""
    for body in range(work.poses.shape[0]):
        cluster = work.clusters[body]
        cluster.force_x = cluster.force_y = cluster.rate_x = cluster.rate_y = 0.0
    for body in range(work.poses.shape[0]):
        cluster, state = work.clusters[work.cluster[body]], FIRST_STAGE + stage
        cluster.force_x += work.force[state, body, X]
        cluster.force_y += work.force[state, body, Y]
        cluster.rate_x += momentum_rate(scene, work, body, 0, stage, step)
        cluster.rate_y += momentum_rate(scene, work, body, 1, stage, step)


def stage_load(scene, work, body, stage, step):
    """What a stage fails to balance on a body, its cluster's momentum where that comes first."""
    x = imbalance(scene, work, body, 0, stage, step)
    y = imbalance(scene, work, body, 1, stage, step)
    torque = imbalance(scene, work, body, 2, stage, step)
    x, y, torque = force_back(work, body, stage, x, y, torque)
    if work.cluster[body] == body:
        x = work.clusters[body].force_x - work.clusters[body].rate_x
        y = work.clusters[body].force_y - work.clusters[body].rate_y
        x, y, _ = force_back(work, body, stage, x, y, 0.0)
    return x, y, torque


def write_loads(scene, work, step):
    """What the stages fail to balance, in the start's frames, along both eigenvectors."""
    for which in range(2):
        for row in range(work.loads.shape[1]):
            work.loads[which, row] = 0.0
    for stage in range(3):
        sum_balances(scene, work, stage, step)
        for body in range(work.place.shape[1]):
            if scene.bodies[body].free == 1.0:
                load = stage_load(scene, work, body, stage, step)
                for axis in range(3):
                    for which in range(2):
                        share = TO_VECTORS[which][stage] * load[axis]
                        work.loads[which, 3 * body + axis] += share


def stage_change(work, row, stage):
    """The solution for one coordinate of one stage, taken back from the eigenvectors."""
    of_real, of_pair = FROM_VECTORS[stage]
    real, pair = work.loads[REAL, row], work.loads[PAIR, row]
    return (of_real * real).real + 2.0 * (of_pair * pair).real


def write_changes(scene, work, stage):
    """The solutions for one stage, as changes of its velocities in CHANGE."""
    for body in range(work.place.shape[1]):
        x, y = stage_change(work, 3 * body, stage), stage_change(work, 3 * body + 1, stage)
        x, y = velocity_on(work, body, stage, x, y)
        work.velocity[CHANGE, body, X] = x
        work.velocity[CHANGE, body, Y] = y
        work.velocity[CHANGE, body, ANGLE] = stage_change(work, 3 * body + 2, stage)
    add_shifts(scene, work, stage)
