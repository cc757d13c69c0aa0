"""The sparse system of a Newton step of backward Euler, M/h + D + h K.

The real part alone of what radau/elimination.py holds, in the same pattern and order, with the
momentum of a cluster in the rows of its first body.
"""

from flocsim.arrays import (
    DAMPING,
    EARLIER,
    LATER,
    PAIRS,
    STIFFNESS,
)
from flocsim.compiler.composer import apart
from flocsim.integrators.radau.elimination import REAL_PART, inverse, slot_of
from flocsim.integrators.radau.ordering import NONE, find_pattern, is_leader
from flocsim.integrators.rhs.blocks import lower_block, own_block, upper_block
from flocsim.integrators.rhs.views import inertia


def write_real(target, slot, work, block, first_row, last_row, step):
    """Write rows of D + h K of a block."""
    for i in range(first_row, last_row):
        for j in range(3):
            stiffness = work.jacobian[STIFFNESS, block, i, j]
            target[slot, REAL_PART, i, j] = work.jacobian[DAMPING, block, i, j] + step * stiffness


def add_mass(scene, target, slot, body, first_axis, last_axis, step):
    """Add M/h to the diagonal of a block."""
    for axis in range(first_axis, last_axis):
        target[slot, REAL_PART, axis, axis] += inertia(scene, body, axis) / step


def write_share(scene, work, body, step):
    """Write a body's share of the momentum balance of its cluster."""
    e = work.elimination
    leader, place = e.place[work.cluster[body]], e.place[body]
    own = own_block(work, body)
    if leader == place:
        write_real(e.pivot, place, work, own, 0, 2, step)
        add_mass(scene, e.pivot, place, body, 0, 2, step)
    else:
        slot = slot_of(e, leader, place)
        write_real(e.blocks, slot, work, own, 0, 2, step)
        add_mass(scene, e.blocks, slot, body, 0, 2, step)


def write_tie(work, body, other, block, step):
    """Write the derivatives of a body's forces by another one's coordinates."""
    e = work.elimination
    row, column = e.place[body], e.place[other]
    if row != NONE and column != NONE:
        first = 2 if is_leader(work, body) else 0
        write_real(e.blocks, slot_of(e, row, column), work, block, first, 3, step)


@apart
def write_system(scene, work, step):
    """M/h + D + h K in the pattern."""
    e, n = work.elimination, work.bodies.shape[0]
    for slot in range(e.lower[n]):
        for i in range(3):
            for j in range(3):
                e.blocks[slot, REAL_PART, i, j] = 0.0
    for body in range(n):
        place = e.place[body]
        if place != NONE:
            first = 2 if is_leader(work, body) else 0
            write_real(e.pivot, place, work, body, first, 3, step)
            add_mass(scene, e.pivot, place, body, first, 3, step)
            write_share(scene, work, body, step)
    for pair in range(work.tally[PAIRS]):
        if e.pairs[pair] == 1:
            a, b = work.pairs[pair, LATER], work.pairs[pair, EARLIER]
            write_tie(work, a, b, lower_block(work, pair), step)
            write_tie(work, b, a, upper_block(work, pair), step)


def copy_real(target, to, source, slot):
    for i in range(3):
        for j in range(3):
            target[to, REAL_PART, i, j] = source[slot, REAL_PART, i, j]


def multiply(target, to, left, one, right, other):
    """A product of two blocks."""
    for i in range(3):
        a, b, c = left[one, REAL_PART, i, 0], left[one, REAL_PART, i, 1], left[one, REAL_PART, i, 2]
        for j in range(3):
            total = a * right[other, REAL_PART, 0, j] + b * right[other, REAL_PART, 1, j]
            target[to, REAL_PART, i, j] = total + c * right[other, REAL_PART, 2, j]


def subtract(target, to, left, one, right, other):
    """Subtract a product of two blocks."""
    for i in range(3):
        a, b, c = left[one, REAL_PART, i, 0], left[one, REAL_PART, i, 1], left[one, REAL_PART, i, 2]
        for j in range(3):
            total = a * right[other, REAL_PART, 0, j] + b * right[other, REAL_PART, 1, j]
            target[to, REAL_PART, i, j] -= total + c * right[other, REAL_PART, 2, j]


def invert_real(blocks, slot):
    """Replace a block by its inverse; False where it has none."""
    m = blocks[slot, REAL_PART]
    found = inverse(m[0, 0], m[0, 1], m[0, 2], m[1, 0], m[1, 1], m[1, 2], m[2, 0], m[2, 1], m[2, 2])
    if not abs(found[0]) > 0.0:
        return False
    share = 1.0 / found[0]
    for k in range(9):
        m[k // 3, k % 3] = share * found[1 + k]
    return True


def factorise_real_row(e, row):
    """Subtract the rows above from a row; False where its pivot is singular."""
    for slot in range(e.lower[row], e.lower[row + 1]):
        copy_real(e.row, e.column[slot], e.blocks, slot)
    copy_real(e.row, row, e.pivot, row)
    for slot in range(e.lower[row], e.upper[row]):
        above = e.column[slot]
        multiply(e.blocks, slot, e.row, above, e.pivot, above)
        for each in range(e.upper[above], e.lower[above + 1]):
            subtract(e.row, e.column[each], e.blocks, slot, e.blocks, each)
    for slot in range(e.upper[row], e.lower[row + 1]):
        copy_real(e.blocks, slot, e.row, e.column[slot])
    copy_real(e.pivot, row, e.row, row)
    return invert_real(e.pivot, row)


@apart
def factorise_real(scene, work, step):
    """Write and factorise the system; False where it is singular, or where there is no room."""
    if not find_pattern(scene, work):
        return False
    write_system(scene, work, step)
    e = work.elimination
    for row in range(work.bodies.shape[0]):
        if e.body[row] != NONE and not factorise_real_row(e, row):
            return False
    return True
