"""Sparse systems of many bodies, in blocks of 3 × 3: written, factorised and solved by rows.

Both systems of a Newton step (tableau.py) have one pattern (ordering.py), and are worked on at
once, or the real one alone: a block holds its numbers, then the real and the imaginary parts of the
complex one's. There is no pivoting but inside the blocks on the diagonal: masses and drag make the
systems dominated by them, as far as stiffness does not, which is symmetric and positive all but for
what turning and friction add.

The rows of x and y of a cluster's first body are the sums of all its bodies'. What bodies do to
each other cancels in these, so that they are written without it, and momentum is exact.
"""

import flocsim.arrays as at
from flocsim.hooks import hook
from flocsim.integrators.radau.ordering import NONE, find_pattern, is_leader
from flocsim.integrators.radau.tableau import EIGENVALUES, PAIR, REAL
from flocsim.integrators.rhs.blocks import lower_block, own_block, upper_block
from flocsim.integrators.rhs.views import inertia

REAL_PART, PAIR_RE, PAIR_IM = range(3)
"""Parts of a block: the real system, the complex one's real and imaginary parts."""


def slot_of(e, row, column):
    """Where the block of a row and a column is."""
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


def weights_of(step):
    """h/µ of both systems: real, real and imaginary part."""
    pair = step / EIGENVALUES[PAIR]
    return step / EIGENVALUES[REAL].real, pair.real, pair.imag


def write_into(target, slot, work, block, first_row, last_row, weights, both):
    """Write rows of DAMPING + (h/µ) STIFFNESS of a block, for the real system or for both."""
    of_real, re, im = weights
    for i in range(first_row, last_row):
        for j in range(3):
            damping = work.jacobian[at.DAMPING, block, i, j]
            stiffness = work.jacobian[at.STIFFNESS, block, i, j]
            target[slot, REAL_PART, i, j] = damping + of_real * stiffness
            if both:
                target[slot, PAIR_RE, i, j] = damping + re * stiffness
                target[slot, PAIR_IM, i, j] = im * stiffness


def add_inertia(scene, target, slot, body, first_axis, last_axis, step):
    """Add (µ/h) M to the diagonal of a block."""
    for axis in range(first_axis, last_axis):
        mass = inertia(scene, body, axis) / step
        target[slot, REAL_PART, axis, axis] += EIGENVALUES[REAL].real * mass
        target[slot, PAIR_RE, axis, axis] += EIGENVALUES[PAIR].real * mass
        target[slot, PAIR_IM, axis, axis] += EIGENVALUES[PAIR].imag * mass


def write_momentum(scene, work, body, weights, step, both):
    """Write a body's share of the momentum balance of its cluster."""
    e = work.elimination
    leader, place = e.place[work.cluster[body]], e.place[body]
    own = own_block(work, body)
    if leader == place:
        write_into(e.pivot, place, work, own, 0, 2, weights, both)
        add_inertia(scene, e.pivot, place, body, 0, 2, step)
    else:
        slot = slot_of(e, leader, place)
        write_into(e.blocks, slot, work, own, 0, 2, weights, both)
        add_inertia(scene, e.blocks, slot, body, 0, 2, step)


def write_coupling(work, body, other, block, weights, both):
    """Write the derivatives of a body's forces by another one's coordinates."""
    e = work.elimination
    row, column = e.place[body], e.place[other]
    if row != NONE and column != NONE:
        first = 2 if is_leader(work, body) else 0
        write_into(e.blocks, slot_of(e, row, column), work, block, first, 3, weights, both)


def write_systems(scene, work, step, both):
    """(µ/h) M + DAMPING + (h/µ) STIFFNESS of the real system, or of both, in the pattern."""
    e, weights = work.elimination, weights_of(step)
    n = work.bodies.shape[0]
    for slot in range(e.lower[n]):
        for part in range(3 if both else 1):
            for i in range(3):
                for j in range(3):
                    e.blocks[slot, part, i, j] = 0.0
    for body in range(n):
        place = e.place[body]
        if place != NONE:
            first = 2 if is_leader(work, body) else 0
            write_into(e.pivot, place, work, body, first, 3, weights, both)
            add_inertia(scene, e.pivot, place, body, first, 3, step)
            write_momentum(scene, work, body, weights, step, both)
    for pair in range(work.tally[at.PAIRS]):
        if e.pairs[pair] == 1:
            a, b = work.pairs[pair, at.LATER], work.pairs[pair, at.EARLIER]
            write_coupling(work, a, b, lower_block(work, pair), weights, both)
            write_coupling(work, b, a, upper_block(work, pair), weights, both)


def copy_block(target, to, source, slot, both):
    for part in range(3 if both else 1):
        for i in range(3):
            for j in range(3):
                target[to, part, i, j] = source[slot, part, i, j]


def take_product(target, to, left, one, right, other, both, subtracts):
    """Write a product of two blocks, of the real system or of both, or subtract it."""
    for i in range(3):
        for j in range(3):
            real = 0.0
            for k in range(3):
                real += left[one, REAL_PART, i, k] * right[other, REAL_PART, k, j]
            put_number(target, to, REAL_PART, i, j, real, subtracts)
            if not both:
                continue
            re, im = 0.0, 0.0
            for k in range(3):
                a, b = left[one, PAIR_RE, i, k], left[one, PAIR_IM, i, k]
                c, d = right[other, PAIR_RE, k, j], right[other, PAIR_IM, k, j]
                re += a * c - b * d
                im += a * d + b * c
            put_number(target, to, PAIR_RE, i, j, re, subtracts)
            put_number(target, to, PAIR_IM, i, j, im, subtracts)


def subtract_row(e, slot, above, both):
    """Subtract from the row that is worked on the block of a slot times the row above it, of the
    real system or of both."""
    if both:
        for each in range(e.upper[above], e.lower[above + 1]):
            take_product(e.row, e.column[each], e.blocks, slot, e.blocks, each, both, True)
        return
    # The same of the real one, with its block read once: the most of what a large island costs.
    m = e.blocks[slot, REAL_PART]
    a, b, c = m[0, 0], m[0, 1], m[0, 2]
    d, f, g = m[1, 0], m[1, 1], m[1, 2]
    p, q, r = m[2, 0], m[2, 1], m[2, 2]
    for each in range(e.upper[above], e.lower[above + 1]):
        right, target = e.blocks[each, REAL_PART], e.row[e.column[each], REAL_PART]
        for j in range(3):
            x, y, z = right[0, j], right[1, j], right[2, j]
            target[0, j] -= a * x + b * y + c * z
            target[1, j] -= d * x + f * y + g * z
            target[2, j] -= p * x + q * y + r * z


def put_number(target, to, part, i, j, number, subtracts):
    target[to, part, i, j] = target[to, part, i, j] - number if subtracts else number


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


def entry(blocks, slot, i, j):
    """A number of the complex system."""
    return complex(blocks[slot, PAIR_RE, i, j], blocks[slot, PAIR_IM, i, j])


def invert(blocks, slot, both):
    """Replace a block by its inverse, of the real system or of both; False where it has none."""
    m = blocks[slot, REAL_PART]
    found = inverse(m[0, 0], m[0, 1], m[0, 2], m[1, 0], m[1, 1], m[1, 2], m[2, 0], m[2, 1], m[2, 2])
    if not abs(found[0]) > 0.0:
        return False
    share = 1.0 / found[0]
    for k in range(9):
        m[k // 3, k % 3] = share * found[1 + k]
    if not both:
        return True
    pair = inverse(
        entry(blocks, slot, 0, 0), entry(blocks, slot, 0, 1), entry(blocks, slot, 0, 2),
        entry(blocks, slot, 1, 0), entry(blocks, slot, 1, 1), entry(blocks, slot, 1, 2),
        entry(blocks, slot, 2, 0), entry(blocks, slot, 2, 1), entry(blocks, slot, 2, 2),
    )  # fmt: skip
    if pair[0] == 0.0:
        return False
    part = 1.0 / pair[0]
    for k in range(9):
        number = part * pair[1 + k]
        blocks[slot, PAIR_RE, k // 3, k % 3] = number.real
        blocks[slot, PAIR_IM, k // 3, k % 3] = number.imag
    return True


def factorise_row(e, row, both):
    """Subtract the rows above from a row; False where its pivot is singular."""
    for slot in range(e.lower[row], e.lower[row + 1]):
        copy_block(e.row, e.column[slot], e.blocks, slot, both)
    copy_block(e.row, row, e.pivot, row, both)
    for slot in range(e.lower[row], e.upper[row]):
        above = e.column[slot]
        take_product(e.blocks, slot, e.row, above, e.pivot, above, both, False)
        subtract_row(e, slot, above, both)
    for slot in range(e.upper[row], e.lower[row + 1]):
        copy_block(e.blocks, slot, e.row, e.column[slot], both)
    copy_block(e.pivot, row, e.row, row, both)
    return invert(e.pivot, row, both)


@hook
def factorise_sparse(scene, work, step, both):
    """Write and factorise the real system, or both; False where one is singular, or where there is
    no room."""
    if not find_pattern(scene, work):
        return False
    write_systems(scene, work, step, both)
    e = work.elimination
    for row in range(work.bodies.shape[0]):
        if e.body[row] != NONE and not factorise_row(e, row, both):
            return False
    return True


def subtract_real(e, loads, slot, row, column):
    """Subtract a block's share in a row of the real system."""
    for i in range(3):
        total = loads[REAL, row + i].real
        for j in range(3):
            total -= e.blocks[slot, REAL_PART, i, j] * loads[REAL, column + j].real
        loads[REAL, row + i] = total


def subtract_pair(e, loads, slot, row, column):
    """The same of the complex one."""
    for i in range(3):
        re, im = loads[PAIR, row + i].real, loads[PAIR, row + i].imag
        for j in range(3):
            a, b = e.blocks[slot, PAIR_RE, i, j], e.blocks[slot, PAIR_IM, i, j]
            c, d = loads[PAIR, column + j].real, loads[PAIR, column + j].imag
            re -= a * c - b * d
            im -= a * d + b * c
        loads[PAIR, row + i] = complex(re, im)


def divide_real(e, loads, place, row):
    """Divide by the block on the diagonal, of the real system."""
    x, y, z = loads[REAL, row].real, loads[REAL, row + 1].real, loads[REAL, row + 2].real
    for i in range(3):
        m = e.pivot[place, REAL_PART]
        loads[REAL, row + i] = m[i, 0] * x + m[i, 1] * y + m[i, 2] * z


def divide_pair(e, loads, place, row):
    """The same of the complex one."""
    x, y, z = loads[PAIR, row], loads[PAIR, row + 1], loads[PAIR, row + 2]
    for i in range(3):
        total = entry(e.pivot, place, i, 0) * x
        total += entry(e.pivot, place, i, 1) * y
        loads[PAIR, row + i] = total + entry(e.pivot, place, i, 2) * z


def subtract_others(e, loads, place, first, last, both):
    """Subtract the shares of a row's blocks from ``first`` to before ``last``."""
    row = 3 * e.body[place]
    for slot in range(first, last):
        other = 3 * e.body[e.column[slot]]
        subtract_real(e, loads, slot, row, other)
        if both:
            subtract_pair(e, loads, slot, row, other)


@hook
def solve_sparse(work, both):
    """Replace the load of the real system, or of ``both``, by the solution."""
    e, loads = work.elimination, work.loads
    n = work.bodies.shape[0]
    for place in range(n):
        if e.body[place] != NONE:
            subtract_others(e, loads, place, e.lower[place], e.upper[place], both)
    for place in range(n - 1, -1, -1):
        body = e.body[place]
        if body != NONE:
            subtract_others(e, loads, place, e.upper[place], e.lower[place + 1], both)
            divide_real(e, loads, place, 3 * body)
            if both:
                divide_pair(e, loads, place, 3 * body)
