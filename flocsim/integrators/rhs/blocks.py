"""Blocks of 3 × 3 of the Jacobian: one for each body, two for each watched pair of bodies.

Of n bodies, blocks 0 to n of ``Work.jacobian`` are on the diagonal. Blocks n to 2n are the parts of
these that involve no other free body (drag, walls): the only ones that can change the momentum of a
cluster. Then come two off-diagonal blocks for each row of ``Work.pairs``.
"""

from flocsim.state.work import CHANGE


def block_count(work):
    """Return the number of blocks in use."""
    return 2 * work.poses.shape[0] + 2 * work.tally.pairs


def own_block(work, body):
    """Return the block of those forces on a body that involve no other free body."""
    return work.poses.shape[0] + body


def upper_block(work, pair):
    """Return the block of the earlier body's force by the coordinates of the later one."""
    return 2 * work.poses.shape[0] + 2 * pair


def lower_block(work, pair):
    """Return the block of the later body's force by the coordinates of the earlier one."""
    return 2 * work.poses.shape[0] + 2 * pair + 1


def subtract_block_product(work, which, weight, block, body, other):
    """Subtract weight · block · CHANGE of the other body from a body's load."""
    jacobian = work.jacobian
    for i in range(3):
        load = work.loads[0, 3 * body + i]
        for j in range(3):
            load -= weight * jacobian[which, block, i, j] * work.place[CHANGE, other, j]
        work.loads[0, 3 * body + i] = load


def subtract_product(work, which, weight):
    """Subtract weight · matrix · CHANGE (places) from the loads.

    Blocks are visited so that every row sums its columns in order: sparse and dense give equal
    rounding.
    """
    for pair in range(work.tally.pairs):
        later, earlier = work.pairs[pair].later, work.pairs[pair].earlier
        subtract_block_product(work, which, weight, lower_block(work, pair), later, earlier)
    for body in range(work.poses.shape[0]):
        subtract_block_product(work, which, weight, body, body, body)
    for pair in range(work.tally.pairs):
        later, earlier = work.pairs[pair].later, work.pairs[pair].earlier
        subtract_block_product(work, which, weight, upper_block(work, pair), earlier, later)
