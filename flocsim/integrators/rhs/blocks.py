"""The derivatives as blocks of 3 × 3: one for each body, two for each pair that is watched.

Blocks 0 to n of ``Work.jacobian`` are those on the diagonal; n to 2 n are the parts of them that no
other free body has a share in (forces of the fluid, of walls), the only ones that can change the
momentum of bodies that act on each other; then two for each row of ``Work.pairs``.
"""

from flocsim.state.work import CHANGE


def block_count(work):
    """How many blocks there are."""
    return 2 * work.poses.shape[0] + 2 * work.tally.pairs


def own_block(work, body):
    """The block of a body's forces in which no other free body has a share."""
    return work.poses.shape[0] + body


def upper_block(work, pair):
    """The block of the earlier body's force, by the coordinates of the later one."""
    return 2 * work.poses.shape[0] + 2 * pair


def lower_block(work, pair):
    """The block of the later body's force, by the coordinates of the earlier one."""
    return 2 * work.poses.shape[0] + 2 * pair + 1


def subtract(work, which, weight, block, body, other):
    """Subtract from a body's load a block, times a weight, times the other body's CHANGE."""
    jacobian = work.jacobian
    for i in range(3):
        load = work.loads[0, 3 * body + i]
        for j in range(3):
            load -= weight * jacobian[which, block, i, j] * work.place[CHANGE, other, j]
        work.loads[0, 3 * body + i] = load


def subtract_product(work, which, weight):
    """Subtract a matrix, times a weight, times the places in CHANGE from the loads; every row in
    the order of its columns."""
    for pair in range(work.tally.pairs):
        later, earlier = work.pairs[pair].later, work.pairs[pair].earlier
        subtract(work, which, weight, lower_block(work, pair), later, earlier)
    for body in range(work.poses.shape[0]):
        subtract(work, which, weight, body, body, body)
    for pair in range(work.tally.pairs):
        later, earlier = work.pairs[pair].later, work.pairs[pair].earlier
        subtract(work, which, weight, upper_block(work, pair), earlier, later)
