"""The stages of a Radau IIA step: collocation of place, velocity and tangential displacement.

Unknown are the stages' velocities; places and displacements follow from them. Newton's method with
the derivatives of the step's start solves one real and one complex system of 3n equations.
"""

import math

from flocsim.integrators.accuracy import rounding_size, step_tolerance
from flocsim.integrators.collocation import guess_stages
from flocsim.integrators.explicit import locate_and_rate, rate_slips, sum_forces
from flocsim.integrators.linear import factorise, solve
from flocsim.integrators.radau_tableau import (
    EIGENVALUES,
    FROM_VECTORS,
    INVERSE,
    MATRIX,
    NODES,
    TO_VECTORS,
)
from flocsim.integrators.views import inertia, lever
from flocsim.layout import (
    CANDIDATES,
    CLOSED,
    DAMPING,
    FIRST,
    FREE,
    MEMORY,
    NOW,
    PACE,
    SLIP_RATES,
    SOLVES,
    STIFFNESS,
    TIME,
)

MOST_ITERATIONS = 10
"""Newton steps before a step is given up and made smaller."""

FIRST_PACE = 0.5
"""What to expect of the second iteration when only one has been made."""

NEWTON_SHARE = 1e-3
"""Newton's method goes on until what is left is below this share of the tolerance."""


def place_stages(work, step):
    """Places at the stages from the velocities there."""
    motion = work.motion
    for body in range(motion.shape[1]):
        for axis in range(3):
            for stage in range(3):
                weights = MATRIX[stage]
                mean = weights[0] * motion[FIRST, body, 3 + axis]
                mean += weights[1] * motion[FIRST + 1, body, 3 + axis]
                mean += weights[2] * motion[FIRST + 2, body, 3 + axis]
                motion[FIRST + stage, body, axis] = motion[NOW, body, axis] + step * mean


def slip_stages(work, step):
    """Tangential displacements at the stages from their rates there."""
    slip = work.slip
    rates = SLIP_RATES + FIRST
    for row in range(work.tally[CANDIDATES]):
        if work.candidates[row, CLOSED] == 1:
            for stage in range(3):
                weights = MATRIX[stage]
                mean = weights[0] * slip[rates, row] + weights[1] * slip[rates + 1, row]
                mean += weights[2] * slip[rates + 2, row]
                slip[FIRST + stage, row] = slip[NOW, row] + step * mean


def evaluate_states(scene, work, time, step, first, last):
    """Forces in the states from ``first`` to before ``last``; NOW is state 0, the stages follow."""
    for state in range(first, last):
        locate_and_rate(scene, work, state, state)
    if last > FIRST:
        slip_stages(work, step)
    for state in range(first, last):
        node = 0.0 if state == NOW else NODES[state - FIRST]
        sum_forces(scene, work, time + node * step, state, state)


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


def factorise_systems(scene, work, step):
    """Write and factorise both systems; False where one is singular."""
    for which in range(2):
        write_matrix(scene, work, which, step)
        if not factorise(work.system, which):
            return False
    return True


def imbalance(scene, work, body, axis, stage, step):
    """Force less mass times acceleration at a stage, the latter from the stages' velocities."""
    v, weights = work.motion, INVERSE[stage]
    now = v[NOW, body, 3 + axis]
    change = weights[0] * (v[FIRST, body, 3 + axis] - now)
    change += weights[1] * (v[FIRST + 1, body, 3 + axis] - now)
    change += weights[2] * (v[FIRST + 2, body, 3 + axis] - now)
    return work.rates[FIRST + stage, body, 3 + axis] - inertia(scene, body, axis) * change / step


def write_loads(scene, work, step):
    """What the stages' velocities fail to balance, along both eigenvectors."""
    size = work.jacobian.shape[1]
    for row in range(size):
        for which in range(2):
            work.system[which, row, size] = 0.0
        if scene.bodies[row // 3, FREE] == 1.0:
            for stage in range(3):
                missing = imbalance(scene, work, row // 3, row % 3, stage, step)
                for which in range(2):
                    work.system[which, row, size] += TO_VECTORS[which][stage] * missing


def correct_stages(scene, work, step):
    """Add the solutions to the stages' velocities; the largest change it makes in place [m]."""
    largest = 0.0
    size = work.jacobian.shape[1]
    for row in range(size):
        body, axis = row // 3, row % 3
        weight = lever(scene, body, axis) * (step + work.bodies[body, MEMORY])
        real, pair = work.system[0, row, size], work.system[1, row, size]
        for stage in range(3):
            columns = FROM_VECTORS[stage]
            change = (columns[0] * real).real + 2.0 * (columns[1] * pair).real
            work.motion[FIRST + stage, body, 3 + axis] += change
            largest = max(largest, weight * abs(change))
        if not abs(real) < math.inf:
            return math.inf
    return largest


def newton_step(scene, work, time, step):
    """One iteration; the largest change it makes in place [m]."""
    place_stages(work, step)
    evaluate_states(scene, work, time, step, FIRST, FIRST + 3)
    write_loads(scene, work, step)
    for which in range(2):
        solve(work.system, which)
    work.tally[SOLVES] += 1
    return correct_stages(scene, work, step)


def finish_stages(work, step):
    """Places and tangential displacements that go with the last correction of the velocities."""
    place_stages(work, step)
    for state in range(FIRST, FIRST + 3):
        rate_slips(work, state, state)
    slip_stages(work, step)


def solve_stages(scene, work, clock, step):
    """Find the stages' velocities; False where Newton's method does not converge."""
    guess_stages(work, clock, step)
    allowed = step_tolerance(work, clock)
    # Turning makes every other iteration worse, so that the pace is taken over two of them.
    before, earlier = math.inf, math.inf
    for _ in range(MOST_ITERATIONS):
        change = newton_step(scene, work, clock[TIME], step)
        goal = max(NEWTON_SHARE * allowed, rounding_size(scene, work, step))
        pace = (change / earlier) ** 0.5 if earlier < math.inf else change / before
        if before == math.inf:
            pace = FIRST_PACE
        if pace < 1.0 and change * pace <= goal * (1.0 - pace):
            finish_stages(work, step)
            clock[PACE] = pace if before < math.inf else 0.0
            return True
        if not change < math.inf or (earlier < math.inf and pace > 1.0):
            return False
        before, earlier = change, before
    return False
