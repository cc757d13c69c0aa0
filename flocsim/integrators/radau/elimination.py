"""Sparse block LU factors, in blocks of 3 × 3, by rows.

The real and the complex system of a Newton iteration (systems.py) have one sparsity pattern
(ordering.py). They are factorised together, or the real one alone: a block holds the real numbers,
then the real and imaginary parts of the complex ones. There is no pivoting except inside the
diagonal blocks: mass and drag make the systems diagonally dominant, and stiffness is symmetric and
positive except for the small parts of rotation and friction.

Diagonal blocks are factorised, not inverted. A contact that turns with its bodies is stiff along
one direction and moves freely along another; the product of its stiffness with an inverse has the
rounding error of (ω0 h)⁴, its quotient that of (ω0 h)² (Higham, Accuracy and Stability of Numerical
Algorithms, 2002, section 13.3).

The rows of x and y of a cluster's first body are the sums over all its bodies (momentum balance).
Mutual forces cancel in these sums and are never written. Momentum is kept to rounding for that
reason.
"""

import math

from flocsim.compiler.linker import loops_apart
from flocsim.integrators.radau.ordering import NONE, find_pattern, is_edge, is_leader
from flocsim.integrators.radau.tableau import COMPLEX, EIGENVALUES, REAL
from flocsim.integrators.rhs.blocks import lower_block, own_block, upper_block
from flocsim.integrators.rhs.views import inertia
from flocsim.state.work import DAMPING, STIFFNESS

REAL_PART, COMPLEX_RE, COMPLEX_IM = range(3)
"""Parts of ``blocks``: the real system, real and imaginary part of the complex system. Each part
holds the n diagonal blocks in elimination order, factorised in the end, then the other blocks in
the order of ``column``. A row of a block is three numbers and a zero: processors that work on four
numbers at once then do (.38 ms for 583 bodies, .52 ms with rows of three)."""


def slot_of(e, row, column):
    """Return the index in ``column`` at which a row lists a column, by bisection."""
    # Columns ascend, first those left of the diagonal, then those right of it.
    first, last = e.upper[row], e.lower[row + 1]
    if column < row:
        first, last = e.lower[row], e.upper[row]
    while first < last - 1:
        middle = (first + last) // 2
        if e.column[middle] <= column:
            first = middle
        else:
            last = middle
    return first


def block_of(e, slot):
    """Return the index of the block of an entry of ``column``."""
    return e.body.shape[0] + slot


def stiffness_weights(step):
    """Return h/µ of both systems: of the real one, and real and imaginary part of the complex
    one."""
    pair = step / EIGENVALUES[COMPLEX]
    return step / EIGENVALUES[REAL].real, pair.real, pair.imag


def write_into(work, to, block, first_row, last_row, weights, both):
    """Write some rows of D + (h/µ) K of a block, for the real system or for both."""
    blocks, (of_real, re, im) = work.elimination.blocks, weights
    for i in range(first_row, last_row):
        for j in range(3):
            damping = work.jacobian[DAMPING, block, i, j]
            stiffness = work.jacobian[STIFFNESS, block, i, j]
            blocks[REAL_PART, to, i, j] = damping + of_real * stiffness
            if both:
                blocks[COMPLEX_RE, to, i, j] = damping + re * stiffness
                blocks[COMPLEX_IM, to, i, j] = im * stiffness


def add_inertia(scene, work, to, body, first_axis, last_axis, step):
    """Add (µ/h) M to some axes of a diagonal block."""
    blocks = work.elimination.blocks
    for axis in range(first_axis, last_axis):
        mass = inertia(scene, body, axis) / step
        blocks[REAL_PART, to, axis, axis] += EIGENVALUES[REAL].real * mass
        # Where the real system is written alone, nothing reads the complex parts.
        blocks[COMPLEX_RE, to, axis, axis] += EIGENVALUES[COMPLEX].real * mass
        blocks[COMPLEX_IM, to, axis, axis] += EIGENVALUES[COMPLEX].imag * mass


def write_momentum(scene, work, body, weights, step, both):
    """Write a body's part of the momentum balance of its cluster: its external forces and its
    mass."""
    e = work.elimination
    leader, index = e.place[work.cluster[body]], e.place[body]
    # The row of the cluster's first body, and the column of this body.
    to = index if leader == index else block_of(e, slot_of(e, leader, index))
    # Only drag, walls and the like: forces within the cluster cancel in its momentum balance.
    write_into(work, to, own_block(work, body), 0, 2, weights, both)
    add_inertia(scene, work, to, body, 0, 2, step)


def write_coupling(work, body, other, block, weights, both):
    """Write the derivatives of a body's forces by the coordinates of another body."""
    e = work.elimination
    row, column = e.place[body], e.place[other]
    if row != NONE and column != NONE:
        # The first body of a cluster keeps its torque balance alone.
        first = 2 if is_leader(work, body) else 0
        write_into(work, block_of(e, slot_of(e, row, column)), block, first, 3, weights, both)


def write_systems(scene, work, step, both):
    """Write (µ/h) M + D + (h/µ) K of the real system, or of both, into the pattern."""
    e, weights = work.elimination, stiffness_weights(step)
    n = work.poses.shape[0]
    # Clear all blocks, those of fill-in, too.
    for part in range(3 if both else 1):
        for block in range(n + e.lower[n]):
            for i in range(3):
                for j in range(4):
                    e.blocks[part, block, i, j] = 0.0
    # Diagonal blocks, and each body's part of its cluster's momentum balance.
    for body in range(n):
        index = e.place[body]
        if index != NONE:
            first = 2 if is_leader(work, body) else 0
            write_into(work, index, body, first, 3, weights, both)
            add_inertia(scene, work, index, body, first, 3, step)
            write_momentum(scene, work, body, weights, step, both)
    # Couplings of the pairs that act.
    for pair in range(work.tally.pairs):
        if is_edge(scene, work, pair):
            a, b = work.pairs[pair].later, work.pairs[pair].earlier
            write_coupling(work, a, b, lower_block(work, pair), weights, both)
            write_coupling(work, b, a, upper_block(work, pair), weights, both)


def add_product(m, to, block, left, one, right, other, sign):
    """Add ``sign`` times the product of two blocks to a block.

    ``to``, ``left`` and ``right`` select the parts. Everything is read before anything is written,
    and all four columns are treated alike: LLVM makes vector instructions of that.
    """
    a, b, c = sign * m[left, one, 0, 0], sign * m[left, one, 0, 1], sign * m[left, one, 0, 2]
    d, f, g = sign * m[left, one, 1, 0], sign * m[left, one, 1, 1], sign * m[left, one, 1, 2]
    p, q, r = sign * m[left, one, 2, 0], sign * m[left, one, 2, 1], sign * m[left, one, 2, 2]
    x0, x1 = m[right, other, 0, 0], m[right, other, 0, 1]
    x2, x3 = m[right, other, 0, 2], m[right, other, 0, 3]
    y0, y1 = m[right, other, 1, 0], m[right, other, 1, 1]
    y2, y3 = m[right, other, 1, 2], m[right, other, 1, 3]
    z0, z1 = m[right, other, 2, 0], m[right, other, 2, 1]
    z2, z3 = m[right, other, 2, 2], m[right, other, 2, 3]
    m[to, block, 0, 0] += a * x0 + b * y0 + c * z0
    m[to, block, 0, 1] += a * x1 + b * y1 + c * z1
    m[to, block, 0, 2] += a * x2 + b * y2 + c * z2
    m[to, block, 0, 3] += a * x3 + b * y3 + c * z3
    m[to, block, 1, 0] += d * x0 + f * y0 + g * z0
    m[to, block, 1, 1] += d * x1 + f * y1 + g * z1
    m[to, block, 1, 2] += d * x2 + f * y2 + g * z2
    m[to, block, 1, 3] += d * x3 + f * y3 + g * z3
    m[to, block, 2, 0] += p * x0 + q * y0 + r * z0
    m[to, block, 2, 1] += p * x1 + q * y1 + r * z1
    m[to, block, 2, 2] += p * x2 + q * y2 + r * z2
    m[to, block, 2, 3] += p * x3 + q * y3 + r * z3


@loops_apart
def add_row(e, slot, to, left, right, sign):
    """Add ``sign`` times the block of a slot times the row above to the slot's own row.

    Most of the time of a large island is spent here.
    """
    above, one = e.column[slot], block_of(e, slot)
    for each in range(e.upper[above], e.lower[above + 1]):
        # ``where`` holds the block of the current row in each column.
        block = e.where[e.column[each]]
        add_product(e.blocks, to, block, left, one, right, block_of(e, each), sign)
    return 0.0


def divide_real(e, slot):
    """Divide the block of a slot by the factorised diagonal block above it, in the real system."""
    m, block, above = e.blocks, block_of(e, slot), e.column[slot]
    for i in range(3):
        # By U, column after column, then by L, which has ones on its diagonal.
        for j in range(3):
            value = m[REAL_PART, block, i, j]
            for k in range(j):
                value -= m[REAL_PART, block, i, k] * m[REAL_PART, above, k, j]
            m[REAL_PART, block, i, j] = value * m[REAL_PART, above, j, j]
        for j in range(1, -1, -1):
            value = m[REAL_PART, block, i, j]
            for k in range(j + 1, 3):
                value -= m[REAL_PART, block, i, k] * m[REAL_PART, above, k, j]
            m[REAL_PART, block, i, j] = value
    swap_columns(e, REAL, block, above)


def entry(blocks, block, i, j):
    """Return an entry of the complex system."""
    return complex(blocks[COMPLEX_RE, block, i, j], blocks[COMPLEX_IM, block, i, j])


def put_entry(blocks, block, i, j, number):
    blocks[COMPLEX_RE, block, i, j], blocks[COMPLEX_IM, block, i, j] = number.real, number.imag


def divide_complex(e, slot):
    """Divide the block of a slot by the factorised diagonal block above it, in the complex
    system."""
    m, block, above = e.blocks, block_of(e, slot), e.column[slot]
    for i in range(3):
        # As in the real system.
        for j in range(3):
            value = entry(m, block, i, j)
            for k in range(j):
                value -= entry(m, block, i, k) * entry(m, above, k, j)
            put_entry(m, block, i, j, value * entry(m, above, j, j))
        for j in range(1, -1, -1):
            value = entry(m, block, i, j)
            for k in range(j + 1, 3):
                value -= entry(m, block, i, k) * entry(m, above, k, j)
            put_entry(m, block, i, j, value)
    swap_columns(e, COMPLEX, block, above)


def number(blocks, which, block, i, j):
    """Return an entry of a block of one of the systems, as a complex number."""
    if which == REAL:
        return complex(blocks[REAL_PART, block, i, j], 0.0)
    return entry(blocks, block, i, j)


def put_number(blocks, which, block, i, j, value):
    """Write an entry of a block of one of the systems."""
    if which == REAL:
        blocks[REAL_PART, block, i, j] = value.real
    else:
        put_entry(blocks, block, i, j, value)


def pivot_row(blocks, which, block, column):
    """Return the row, from the one of this number on, with the largest entry in a column."""
    found, largest = column, -1.0
    for row in range(column, 3):
        value = number(blocks, which, block, row, column)
        # |Re| + |Im| is within √2 of the modulus, without a square root.
        size = abs(value.real) + abs(value.imag)
        if size > largest:
            found, largest = row, size
    return found


def swap(blocks, which, block, i, j, row, column):
    """Swap two entries of a block, (i, j) and (row, column)."""
    value = number(blocks, which, block, i, j)
    put_number(blocks, which, block, i, j, number(blocks, which, block, row, column))
    put_number(blocks, which, block, row, column, value)


def swap_columns(e, which, block, above):
    """Swap the columns of a block as the rows of a diagonal block were, in the opposite order."""
    for k in range(2, -1, -1):
        for i in range(3):
            swap(e.blocks, which, block, i, k, i, e.pivots[which, above, k])


def factorise_diagonal(e, which, block):
    """Replace a diagonal block of a system by its factors L U; return False if it is singular, or
    too large for that.

    With row pivoting: stiff contacts leave less accuracy to others. The diagonal holds the
    reciprocals of the pivots, as complex division is slow.
    """
    m = e.blocks
    for k in range(3):
        pivot = pivot_row(m, which, block, k)
        e.pivots[which, block, k] = pivot
        for j in range(3):
            swap(m, which, block, k, j, pivot, j)
        # The squared modulus must neither vanish nor overflow, for its reciprocal is taken.
        value = number(m, which, block, k, k)
        size = value.real * value.real + value.imag * value.imag
        if not 0.0 < size < math.inf:
            return False
        reciprocal = complex(value.real / size, -value.imag / size)
        put_number(m, which, block, k, k, reciprocal)
        for i in range(k + 1, 3):
            factor = number(m, which, block, i, k) * reciprocal
            put_number(m, which, block, i, k, factor)
            for j in range(k + 1, 3):
                rest = number(m, which, block, i, j) - factor * number(m, which, block, k, j)
                put_number(m, which, block, i, j, rest)
    return True


def factorise_row(e, row, both):
    """Eliminate the rows above from a row; return False if its diagonal block is singular."""
    # Note where each column of this row is stored.
    e.where[row] = row
    for slot in range(e.lower[row], e.lower[row + 1]):
        e.where[e.column[slot]] = block_of(e, slot)
    for slot in range(e.lower[row], e.upper[row]):
        # Divide the block by the diagonal block above, and subtract L times the finished row above.
        divide_real(e, slot)
        add_row(e, slot, REAL_PART, REAL_PART, REAL_PART, -1.0)
        if both:
            divide_complex(e, slot)
            # Complex product, as four real ones.
            add_row(e, slot, COMPLEX_RE, COMPLEX_RE, COMPLEX_RE, -1.0)
            add_row(e, slot, COMPLEX_RE, COMPLEX_IM, COMPLEX_IM, 1.0)
            add_row(e, slot, COMPLEX_IM, COMPLEX_RE, COMPLEX_IM, -1.0)
            add_row(e, slot, COMPLEX_IM, COMPLEX_IM, COMPLEX_RE, -1.0)
    # Later rows and all solutions are divided by the diagonal block.
    for which in range(2 if both else 1):
        if not factorise_diagonal(e, which, row):
            return False
    return True


def factorise_blocks(scene, work, step, both):
    """Write and factorise the real system, or both; return False if one is singular or lacks
    room."""
    if not find_pattern(scene, work):
        return False
    write_systems(scene, work, step, both)
    e = work.elimination
    for row in range(work.poses.shape[0]):
        if e.body[row] != NONE and not factorise_row(e, row, both):
            return False
    return True


def subtract_real(e, loads, block, row, column):
    """Subtract a block times the solution of its column from the load of a row, in the real
    system."""
    for i in range(3):
        total = loads[REAL, row + i].real
        for j in range(3):
            total -= e.blocks[REAL_PART, block, i, j] * loads[REAL, column + j].real
        loads[REAL, row + i] = total


def subtract_complex(e, loads, block, row, column):
    """Subtract a block times the solution of its column from the load of a row, in the complex
    system."""
    for i in range(3):
        re, im = loads[COMPLEX, row + i].real, loads[COMPLEX, row + i].imag
        for j in range(3):
            a, b = e.blocks[COMPLEX_RE, block, i, j], e.blocks[COMPLEX_IM, block, i, j]
            c, d = loads[COMPLEX, column + j].real, loads[COMPLEX, column + j].imag
            re -= a * c - b * d
            im -= a * d + b * c
        loads[COMPLEX, row + i] = complex(re, im)


def divide_load(e, loads, which, index, row):
    """Divide the load of a row by its factorised diagonal block."""
    for k in range(3):
        other = row + e.pivots[which, index, k]
        loads[which, row + k], loads[which, other] = loads[which, other], loads[which, row + k]
    for i in range(3):
        for k in range(i):
            loads[which, row + i] -= number(e.blocks, which, index, i, k) * loads[which, row + k]
    for i in range(2, -1, -1):
        for k in range(i + 1, 3):
            loads[which, row + i] -= number(e.blocks, which, index, i, k) * loads[which, row + k]
        loads[which, row + i] *= number(e.blocks, which, index, i, i)


def substitute_row(e, loads, index, first, last, both):
    """Subtract the blocks of a row from ``first`` up to but excluding ``last``, times the
    solution."""
    row = 3 * e.body[index]
    for slot in range(first, last):
        other = 3 * e.body[e.column[slot]]
        subtract_real(e, loads, block_of(e, slot), row, other)
        if both:
            subtract_complex(e, loads, block_of(e, slot), row, other)


def solve_blocks(work, both):
    """Replace the load of the real system, or of both, by the solution."""
    e, loads = work.elimination, work.loads
    n = work.poses.shape[0]
    # Forward substitution.
    for index in range(n):
        if e.body[index] != NONE:
            substitute_row(e, loads, index, e.lower[index], e.upper[index], both)
    # Backward substitution.
    for index in range(n - 1, -1, -1):
        body = e.body[index]
        if body != NONE:
            substitute_row(e, loads, index, e.upper[index], e.lower[index + 1], both)
            for which in range(2 if both else 1):
                divide_load(e, loads, which, index, 3 * body)
