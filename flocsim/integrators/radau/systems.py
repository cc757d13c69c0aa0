"""The linear systems of a Newton step: from what the stages fail to balance to new velocities.

Radau's stages are decoupled along two eigenvectors (tableau.py), in frames that go along with the
contacts (contact_frames.py). Their small dense complex systems are factorised in place here, which
compiles fast, unlike numpy.linalg in a kernel; system k is (m, m + 1): the matrix, then its
factors; the load, then the solution.
"""

from flocsim.arrays import (
    CHANGE,
    DAMPING,
    FIRST_STAGE,
    FORCE,
    FREE,
    NOW,
    SPIN,
    STIFFNESS,
    VELOCITY,
    VX,
    VY,
)
from flocsim.integrators.radau.contact_frames import add_shifts, force_back, velocity_on
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
from flocsim.integrators.rhs.views import inertia


def magnitude(value):
    """|re| + |im|, which tells pivots apart as well as the modulus does, without its root."""
    return abs(value.real) + abs(value.imag)


def factorise(system, pivots, which):
    """Factorise a matrix with row pivoting (pivots (2, m)); False where it is singular.

    In the places of the pivots are their reciprocals: complex division takes long.
    """
    size = system.shape[1]
    for pivot in range(size):
        best = pivot
        largest = magnitude(system[which, best, pivot])
        for row in range(pivot + 1, size):
            entry = magnitude(system[which, row, pivot])
            if entry > largest:
                best = row
                largest = entry
        if not largest > 0.0:
            return False
        pivots[which, pivot] = best
        if best != pivot:
            for column in range(size):
                kept = system[which, pivot, column]
                system[which, pivot, column] = system[which, best, column]
                system[which, best, column] = kept
        # Subtract the pivot's row from all below it, and keep the shares in their places.
        reciprocal = 1.0 / system[which, pivot, pivot]
        system[which, pivot, pivot] = reciprocal
        for row in range(pivot + 1, size):
            if system[which, row, pivot] != 0.0:
                share = system[which, row, pivot] * reciprocal
                system[which, row, pivot] = share
                for column in range(pivot + 1, size):
                    system[which, row, column] -= share * system[which, pivot, column]
    return True


def solve(system, pivots, which):
    """Replace the load of a factorised system by the solution."""
    size = system.shape[1]
    for row in range(size):
        other = pivots[which, row]
        kept = system[which, row, size]
        system[which, row, size] = system[which, other, size]
        system[which, other, size] = kept
    for row in range(size):
        for column in range(row):
            system[which, row, size] -= system[which, row, column] * system[which, column, size]
    for row in range(size - 1, -1, -1):
        for column in range(row + 1, size):
            system[which, row, size] -= system[which, row, column] * system[which, column, size]
        system[which, row, size] *= system[which, row, row]


def write_matrix(scene, work, which, step):
    """(µ/h) M + DAMPING + (h/µ) STIFFNESS for one eigenvalue µ; fixed bodies stay."""
    value = EIGENVALUES[which]
    for row in range(work.jacobian.shape[1]):
        moves = scene.bodies[row // 3, FREE]
        for column in range(work.jacobian.shape[1]):
            entry = work.jacobian[DAMPING, row, column]
            entry = entry + step / value * work.jacobian[STIFFNESS, row, column]
            work.system[which, row, column] = moves * entry
        mass = inertia(scene, row // 3, row % 3)
        work.system[which, row, row] += value / step * mass if moves == 1.0 else 1.0
    sum_over_clusters(work, which, 0, work.jacobian.shape[1])


def sum_over_clusters(work, which, first, last):
    """Put the balance of a cluster's momentum in the place of that of its first body's.

    Mutual forces cancel in it, so that rounding in the solution of the rest leaves momentum alone.
    """
    for body in range(work.bodies.shape[0]):
        leader = work.cluster[body]
        if leader != body:
            for axis in range(2):
                for column in range(first, last):
                    entry = work.system[which, 3 * body + axis, column]
                    work.system[which, 3 * leader + axis, column] += entry


def factorise_systems(scene, work, step):
    """Write and factorise both systems; False where one is singular."""
    for which in range(2):
        write_matrix(scene, work, which, step)
        if not factorise(work.system, work.pivots, which):
            return False
    return True


def momentum_rate(scene, work, body, axis, stage, step):
    """Mass times acceleration at a stage, from the stages' velocities."""
    v = work.motion
    first, second, third = INVERSE[stage]
    now = v[NOW, body, VELOCITY + axis]
    change = first * (v[FIRST_STAGE, body, VELOCITY + axis] - now)
    change += second * (v[SECOND_STAGE, body, VELOCITY + axis] - now)
    change += third * (v[THIRD_STAGE, body, VELOCITY + axis] - now)
    return inertia(scene, body, axis) * change / step


def imbalance(scene, work, body, axis, stage, step):
    """Force less mass times acceleration at a stage."""
    rate = momentum_rate(scene, work, body, axis, stage, step)
    return work.rates[FIRST_STAGE + stage, body, FORCE + axis] - rate


def cluster_imbalance(scene, work, leader, axis, stage, step):
    """The same for all bodies of a cluster; forces first, so that what is mutual cancels."""
    force, rate = 0.0, 0.0
    for body in range(leader, work.bodies.shape[0]):
        if work.cluster[body] == leader:
            force += work.rates[FIRST_STAGE + stage, body, FORCE + axis]
            rate += momentum_rate(scene, work, body, axis, stage, step)
    return force - rate


def stage_load(scene, work, body, stage, step):
    """What a stage fails to balance on a body, its cluster's momentum where that comes first."""
    x = imbalance(scene, work, body, 0, stage, step)
    y = imbalance(scene, work, body, 1, stage, step)
    torque = imbalance(scene, work, body, 2, stage, step)
    x, y, torque = force_back(work, body, stage, x, y, torque)
    if work.cluster[body] == body:
        x = cluster_imbalance(scene, work, body, 0, stage, step)
        y = cluster_imbalance(scene, work, body, 1, stage, step)
        x, y, _ = force_back(work, body, stage, x, y, 0.0)
    return x, y, torque


def write_loads(scene, work, step):
    """What the stages fail to balance, in the start's frames, along both eigenvectors."""
    size = work.jacobian.shape[1]
    for body in range(work.motion.shape[1]):
        for axis in range(3):
            for which in range(2):
                work.system[which, 3 * body + axis, size] = 0.0
        if scene.bodies[body, FREE] == 1.0:
            for stage in range(3):
                load = stage_load(scene, work, body, stage, step)
                for axis in range(3):
                    for which in range(2):
                        share = TO_VECTORS[which][stage] * load[axis]
                        work.system[which, 3 * body + axis, size] += share


def stage_change(work, row, stage):
    """The solution for one coordinate of one stage, taken back from the eigenvectors."""
    size = work.jacobian.shape[1]
    of_real, of_pair = FROM_VECTORS[stage]
    real, pair = work.system[REAL, row, size], work.system[PAIR, row, size]
    return (of_real * real).real + 2.0 * (of_pair * pair).real


def write_changes(scene, work, stage):
    """The solutions for one stage, as changes of its velocities in CHANGE."""
    changes = work.motion
    for body in range(changes.shape[1]):
        x, y = stage_change(work, 3 * body, stage), stage_change(work, 3 * body + 1, stage)
        x, y = velocity_on(work, body, stage, x, y)
        changes[CHANGE, body, VX] = x
        changes[CHANGE, body, VY] = y
        changes[CHANGE, body, SPIN] = stage_change(work, 3 * body + 2, stage)
    add_shifts(scene, work, stage)
