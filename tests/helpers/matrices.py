"""The derivatives of a scene as whole matrices."""

import numpy as np

from flocsim.integrators.rhs.blocks import lower_block, upper_block


def whole_matrix(work, which):
    """DAMPING or STIFFNESS (3 n, 3 n), from its blocks."""
    n, blocks = len(work.poses), work.jacobian[which]
    matrix = np.zeros((n, 3, n, 3))
    for body in range(n):
        matrix[body, :, body] = blocks[body]
    for pair in range(work.tally.pairs):
        a, b = work.pairs[pair].later, work.pairs[pair].earlier
        matrix[a, :, b] = blocks[lower_block(work, pair)]
        matrix[b, :, a] = blocks[upper_block(work, pair)]
    return matrix.reshape(3 * n, 3 * n)
