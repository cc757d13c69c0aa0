"""Sparse systems of many bodies, in blocks of 3 × 3: written, factorised and solved by rows.

Both systems of a Newton step (tableau.py) have one pattern (ordering.py), and are worked on at
once, or the real one alone: a block holds its numbers, then the real and the imaginary parts of the
complex one's. There is no pivoting but inside the blocks on the diagonal: masses and drag make the
systems dominated by them, as far as stiffness does not, which is symmetric and positive all but for
what turning and friction add.

The rows of x and y of a cluster's first body are the sums of all its bodies'. What bodies do to
each other cancels in these, so that they are written without it, and momentum is exact.
"""

from flocsim.compiler.linker import loops_apart
from flocsim.hooks import hook
from flocsim.integrators.radau.ordering import NONE, find_pattern, is_leader
from flocsim.integrators.radau.tableau import EIGENVALUES, PAIR, REAL
from flocsim.integrators.rhs.blocks import lower_block, own_block, upper_block
from flocsim.integrators.rhs.views import inertia
from flocsim.state.work import DAMPING, STIFFNESS

REAL_PART, PAIR_RE, PAIR_IM = range(3)
"""Parts of ``blocks``: the real system, the complex one's real and imaginary parts. In each lie the
n blocks on the diagonal, in their order, inverted in the end, and behind them those of all rows, in
the order of ``column``; a row of a block is three numbers and a 0, so that processors which work on
four at once do.
"""


def slot_of(e, row, column):
    """Where the column of a row is listed."""
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
    """The block of a column that is listed."""
    return e.body.shape[0] + slot


def weights_of(step):
    """h/µ of both systems: real, real and imaginary part."""
    pair = step / EIGENVALUES[PAIR]
    return step / EIGENVALUES[REAL].real, pair.real, pair.imag


def write_into(work, to, block, first_row, last_row, weights, both):
    """Write rows of DAMPING + (h/µ) STIFFNESS of a block, for the real system or for both."""
    blocks, (of_real, re, im) = work.elimination.blocks, weights
    for i in range(first_row, last_row):
        for j in range(3):
            damping = work.jacobian[DAMPING, block, i, j]
            stiffness = work.jacobian[STIFFNESS, block, i, j]
            blocks[REAL_PART, to, i, j] = damping + of_real * stiffness
            if both:
                blocks[PAIR_RE, to, i, j] = damping + re * stiffness
                blocks[PAIR_IM, to, i, j] = im * stiffness


def add_inertia(scene, work, to, body, first_axis, last_axis, step):
    """Add (µ/h) M to the diagonal of a block."""
    blocks = work.elimination.blocks
    for axis in range(first_axis, last_axis):
        mass = inertia(scene, body, axis) / step
        blocks[REAL_PART, to, axis, axis] += EIGENVALUES[REAL].real * mass
        blocks[PAIR_RE, to, axis, axis] += EIGENVALUES[PAIR].real * mass
        blocks[PAIR_IM, to, axis, axis] += EIGENVALUES[PAIR].imag * mass


def write_momentum(scene, work, body, weights, step, both):
    """Write a body's share of the momentum balance of its cluster."""
    e = work.elimination
    leader, place = e.place[work.cluster[body]], e.place[body]
    to = place if leader == place else block_of(e, slot_of(e, leader, place))
    write_into(work, to, own_block(work, body), 0, 2, weights, both)
    add_inertia(scene, work, to, body, 0, 2, step)


def write_coupling(work, body, other, block, weights, both):
    """Write the derivatives of a body's forces by another one's coordinates."""
    e = work.elimination
    row, column = e.place[body], e.place[other]
    if row != NONE and column != NONE:
        first = 2 if is_leader(work, body) else 0
        write_into(work, block_of(e, slot_of(e, row, column)), block, first, 3, weights, both)


def write_systems(scene, work, step, both):
    """(µ/h) M + DAMPING + (h/µ) STIFFNESS of the real system, or of both, in the pattern."""
    e, weights = work.elimination, weights_of(step)
    n = work.poses.shape[0]
    for part in range(3 if both else 1):
        for block in range(n + e.lower[n]):
            for i in range(3):
                for j in range(4):
                    e.blocks[part, block, i, j] = 0.0
    for body in range(n):
        place = e.place[body]
        if place != NONE:
            first = 2 if is_leader(work, body) else 0
            write_into(work, place, body, first, 3, weights, both)
            add_inertia(scene, work, place, body, first, 3, step)
            write_momentum(scene, work, body, weights, step, both)
    for pair in range(work.tally.pairs):
        if e.pairs[pair] == 1:
            a, b = work.pairs[pair].later, work.pairs[pair].earlier
            write_coupling(work, a, b, lower_block(work, pair), weights, both)
            write_coupling(work, b, a, upper_block(work, pair), weights, both)


def multiply(m, to, block, keeps, left, one, right, other, sign):
    """Make a block ``keeps`` times what it is, and ``sign`` times the product of two, of some of
    their parts. All that is read of the two is read before anything is written, and four columns
    are worked on alike, so that a processor takes them at once."""
    a, b, c = sign * m[left, one, 0, 0], sign * m[left, one, 0, 1], sign * m[left, one, 0, 2]
    d, f, g = sign * m[left, one, 1, 0], sign * m[left, one, 1, 1], sign * m[left, one, 1, 2]
    p, q, r = sign * m[left, one, 2, 0], sign * m[left, one, 2, 1], sign * m[left, one, 2, 2]
    x0, x1 = m[right, other, 0, 0], m[right, other, 0, 1]
    x2, x3 = m[right, other, 0, 2], m[right, other, 0, 3]
    y0, y1 = m[right, other, 1, 0], m[right, other, 1, 1]
    y2, y3 = m[right, other, 1, 2], m[right, other, 1, 3]
    z0, z1 = m[right, other, 2, 0], m[right, other, 2, 1]
    z2, z3 = m[right, other, 2, 2], m[right, other, 2, 3]
    m[to, block, 0, 0] = keeps * m[to, block, 0, 0] + (a * x0 + b * y0 + c * z0)
    m[to, block, 0, 1] = keeps * m[to, block, 0, 1] + (a * x1 + b * y1 + c * z1)
    m[to, block, 0, 2] = keeps * m[to, block, 0, 2] + (a * x2 + b * y2 + c * z2)
    m[to, block, 0, 3] = keeps * m[to, block, 0, 3] + (a * x3 + b * y3 + c * z3)
    m[to, block, 1, 0] = keeps * m[to, block, 1, 0] + (d * x0 + f * y0 + g * z0)
    m[to, block, 1, 1] = keeps * m[to, block, 1, 1] + (d * x1 + f * y1 + g * z1)
    m[to, block, 1, 2] = keeps * m[to, block, 1, 2] + (d * x2 + f * y2 + g * z2)
    m[to, block, 1, 3] = keeps * m[to, block, 1, 3] + (d * x3 + f * y3 + g * z3)
    m[to, block, 2, 0] = keeps * m[to, block, 2, 0] + (p * x0 + q * y0 + r * z0)
    m[to, block, 2, 1] = keeps * m[to, block, 2, 1] + (p * x1 + q * y1 + r * z1)
    m[to, block, 2, 2] = keeps * m[to, block, 2, 2] + (p * x2 + q * y2 + r * z2)
    m[to, block, 2, 3] = keeps * m[to, block, 2, 3] + (p * x3 + q * y3 + r * z3)


@loops_apart
def add_row(e, slot, to, left, right, sign):
    """Add ``sign`` times the block of a slot times the row above, which it stands below, to its own
    row, of some of their parts: what most of a large island's time goes to."""
    above, one = e.column[slot], block_of(e, slot)
    for each in range(e.upper[above], e.lower[above + 1]):
        block = e.where[e.column[each]]
        multiply(e.blocks, to, block, 1.0, left, one, right, block_of(e, each), sign)
    return 0.0


@loops_apart
def divide_real(e, slot):
    """Divide the block of a slot by the one on the diagonal above it, which is inverted, of the
    real system."""
    block = block_of(e, slot)
    multiply(e.blocks, REAL_PART, block, 0.0, REAL_PART, block, REAL_PART, e.column[slot], 1.0)
    return 0.0


def entry(blocks, block, i, j):
    """A number of the complex system."""
    return complex(blocks[PAIR_RE, block, i, j], blocks[PAIR_IM, block, i, j])


def put_entry(blocks, block, i, j, number):
    blocks[PAIR_RE, block, i, j], blocks[PAIR_IM, block, i, j] = number.real, number.imag


def divide_pair(e, slot):
    """The same of the complex one."""
    block, above = block_of(e, slot), e.column[slot]
    for i in range(3):
        a, b, c = (
            entry(e.blocks, block, i, 0),
            entry(e.blocks, block, i, 1),
            entry(e.blocks, block, i, 2),
        )
        for j in range(3):
            x, y, z = (
                entry(e.blocks, above, 0, j),
                entry(e.blocks, above, 1, j),
                entry(e.blocks, above, 2, j),
            )
            put_entry(e.blocks, block, i, j, a * x + b * y + c * z)


def inverse(a, b, c, d, e, f, g, h, i):
    """The determinant of a matrix and its adjugate."""
    one, two, three = e * i - f * h, f * g - d * i, d * h - e * g
    determinant = a * one + b * two + c * three
    return (
        determinant,
        one, c * h - b * i, b * f - c * e,
        two, a * i - c * g, c * d - a * f,
        three, b * g - a * h, a * e - b * d,
    )  # fmt: skip


def invert(blocks, block, both):
    """Replace a block by its inverse, of the real system or of both; False where it has none."""
    m = blocks[REAL_PART, block]
    found = inverse(m[0, 0], m[0, 1], m[0, 2], m[1, 0], m[1, 1], m[1, 2], m[2, 0], m[2, 1], m[2, 2])
    if not abs(found[0]) > 0.0:
        return False
    share = 1.0 / found[0]
    for k in range(9):
        m[k // 3, k % 3] = share * found[1 + k]
    if not both:
        return True
    pair = inverse(
        entry(blocks, block, 0, 0), entry(blocks, block, 0, 1), entry(blocks, block, 0, 2),
        entry(blocks, block, 1, 0), entry(blocks, block, 1, 1), entry(blocks, block, 1, 2),
        entry(blocks, block, 2, 0), entry(blocks, block, 2, 1), entry(blocks, block, 2, 2),
    )  # fmt: skip
    if pair[0] == 0.0:
        return False
    part = 1.0 / pair[0]
    for k in range(9):
        put_entry(blocks, block, k // 3, k % 3, part * pair[1 + k])
    return True


def factorise_row(e, row, both):
    """Subtract the rows above from a row; False where its block on the diagonal is singular."""
    e.where[row] = row
    for slot in range(e.lower[row], e.lower[row + 1]):
        e.where[e.column[slot]] = block_of(e, slot)
    for slot in range(e.lower[row], e.upper[row]):
        divide_real(e, slot)
        add_row(e, slot, REAL_PART, REAL_PART, REAL_PART, -1.0)
        if both:
            divide_pair(e, slot)
            add_row(e, slot, PAIR_RE, PAIR_RE, PAIR_RE, -1.0)
            add_row(e, slot, PAIR_RE, PAIR_IM, PAIR_IM, 1.0)
            add_row(e, slot, PAIR_IM, PAIR_RE, PAIR_IM, -1.0)
            add_row(e, slot, PAIR_IM, PAIR_IM, PAIR_RE, -1.0)
    return invert(e.blocks, row, both)


@hook
def factorise_sparse(scene, work, step, both):
    """Write and factorise the real system, or both; False where one is singular, or where there is
    no room."""
    if not find_pattern(scene, work):
        return False
    write_systems(scene, work, step, both)
    e = work.elimination
    for row in range(work.poses.shape[0]):
        if e.body[row] != NONE and not factorise_row(e, row, both):
            return False
    return True


def subtract_real(e, loads, block, row, column):
    """Subtract a block's share in a row of the real system."""
    for i in range(3):
        total = loads[REAL, row + i].real
        for j in range(3):
            total -= e.blocks[REAL_PART, block, i, j] * loads[REAL, column + j].real
        loads[REAL, row + i] = total


def subtract_pair(e, loads, block, row, column):
    """The same of the complex one."""
    for i in range(3):
        re, im = loads[PAIR, row + i].real, loads[PAIR, row + i].imag
        for j in range(3):
            a, b = e.blocks[PAIR_RE, block, i, j], e.blocks[PAIR_IM, block, i, j]
            c, d = loads[PAIR, column + j].real, loads[PAIR, column + j].imag
            re -= a * c - b * d
            im -= a * d + b * c
        loads[PAIR, row + i] = complex(re, im)


def divide_real_load(e, loads, place, row):
    """Divide by the block on the diagonal, of the real system."""
    x, y, z = loads[REAL, row].real, loads[REAL, row + 1].real, loads[REAL, row + 2].real
    for i in range(3):
        m = e.blocks[REAL_PART, place]
        loads[REAL, row + i] = m[i, 0] * x + m[i, 1] * y + m[i, 2] * z


def divide_pair_load(e, loads, place, row):
    """The same of the complex one."""
    x, y, z = loads[PAIR, row], loads[PAIR, row + 1], loads[PAIR, row + 2]
    for i in range(3):
        total = entry(e.blocks, place, i, 0) * x
        total += entry(e.blocks, place, i, 1) * y
        loads[PAIR, row + i] = total + entry(e.blocks, place, i, 2) * z


def subtract_others(e, loads, place, first, last, both):
    """Subtract the shares of a row's blocks from ``first`` to before ``last``."""
    row = 3 * e.body[place]
    for slot in range(first, last):
        other = 3 * e.body[e.column[slot]]
        subtract_real(e, loads, block_of(e, slot), row, other)
        if both:
            subtract_pair(e, loads, block_of(e, slot), row, other)


@hook
def solve_sparse(work, both):
    """Replace the load of the real system, or of ``both``, by the solution."""
    e, loads = work.elimination, work.loads
    n = work.poses.shape[0]
    for place in range(n):
        if e.body[place] != NONE:
            subtract_others(e, loads, place, e.lower[place], e.upper[place], both)
    for place in range(n - 1, -1, -1):
        body = e.body[place]
        if body != NONE:
            subtract_others(e, loads, place, e.upper[place], e.lower[place + 1], both)
            divide_real_load(e, loads, place, 3 * body)
            if both:
                divide_pair_load(e, loads, place, 3 * body)
