"""The error of a run as a vector: carried on by every step as a small change of its start would be.

    M δv̇ = −D δv − K δx,   δẋ = δv,

with the forces' own derivatives (D, K: DAMPING and STIFFNESS), over a step by the L-stable method
SDIRK2 (Alexander 1977), whose two stages have one matrix. Contacts thus take up what they resist, a
doublet that tips over lets an error grow, and errors of opposite signs cancel. Behind each step its
own estimated error is added; what switches do is added by rhs/stated_error.py.
"""

from flocsim.arrays import CARRIED, DAMPING, DEVIATION, FREE, MOTION_COLUMNS, STIFFNESS, VELOCITY
from flocsim.integrators.radau.systems import factorise, solve
from flocsim.integrators.radau.tableau import REAL
from flocsim.integrators.rhs.stated_error import bound_carried
from flocsim.integrators.rhs.views import inertia

GAMMA = 1.0 - 0.5**0.5
"""The share of the step in each stage's matrix."""


def write_carrying(scene, work, part):
    """M + part DAMPING + part² STIFFNESS, ``part`` being GAMMA of the step; fixed bodies stay."""
    size = work.jacobian.shape[1]
    for row in range(size):
        moves = scene.bodies[row // 3, FREE]
        for column in range(size):
            entry = work.jacobian[DAMPING, row, column]
            entry += part * work.jacobian[STIFFNESS, row, column]
            work.system[REAL, row, column] = moves * part * entry
        mass = inertia(scene, row // 3, row % 3)
        work.system[REAL, row, row] += mass if moves == 1.0 else 1.0


def solve_stage(scene, work, part):
    """A stage's δv̇, as the solution of the system, from where CARRIED has come to."""
    carried, size = work.motion, work.jacobian.shape[1]
    for row in range(size):
        load = 0.0
        for column in range(size):
            body, axis = column // 3, column % 3
            speed = carried[CARRIED, body, VELOCITY + axis]
            place = carried[CARRIED, body, axis] + part * speed
            load -= work.jacobian[DAMPING, row, column] * speed
            load -= work.jacobian[STIFFNESS, row, column] * place
        work.system[REAL, row, size] = load * scene.bodies[row // 3, FREE]
    solve(work.system, work.pivots, REAL)


def move_carried(work, part, way):
    """Go on by ``way`` [s] with a stage's rates."""
    carried, size = work.motion, work.jacobian.shape[1]
    for row in range(size):
        body, axis = row // 3, row % 3
        change = work.system[REAL, row, size].real
        speed = carried[CARRIED, body, VELOCITY + axis] + part * change
        carried[CARRIED, body, axis] += way * speed
        carried[CARRIED, body, VELOCITY + axis] += way * change


def add_step(work):
    """Add the error that the step itself is likely to have made."""
    for body in range(work.motion.shape[1]):
        for axis in range(MOTION_COLUMNS):
            work.motion[CARRIED, body, axis] += work.motion[DEVIATION, body, axis]


def carry_error(scene, work, step):
    """Carry the error over an accepted step; the largest one of a body's outline [m]."""
    bound_carried(scene, work)
    part = GAMMA * step
    write_carrying(scene, work, part)
    if factorise(work.system, work.pivots, REAL):
        for way in (step - part, part):
            solve_stage(scene, work, part)
            move_carried(work, part, way)
    add_step(work)
    return bound_carried(scene, work)
