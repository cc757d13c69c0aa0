"""Radau IIA with three stages, order 5: stiffly accurate, L-stable, stage order 3.

The inverse of its matrix has one real and two conjugate eigenvalues; Newton's method is decoupled
along their vectors, as in RADAU5 (Hairer & Wanner, Solving Ordinary Differential Equations II,
1996, section IV.8).
"""

import numpy as np

from flocsim.arrays import FIRST_STAGE

SECOND_STAGE, THIRD_STAGE = FIRST_STAGE + 1, FIRST_STAGE + 2
"""States of the later stages; the third one is the end of the step."""

ROOT = 6.0**0.5

NODES = ((4.0 - ROOT) / 10.0, (4.0 + ROOT) / 10.0, 1.0)
"""Where the stages lie in the step."""

MATRIX = (
    ((88.0 - 7.0 * ROOT) / 360.0, (296.0 - 169.0 * ROOT) / 1800.0, (-2.0 + 3.0 * ROOT) / 225.0),
    ((296.0 + 169.0 * ROOT) / 1800.0, (88.0 + 7.0 * ROOT) / 360.0, (-2.0 - 3.0 * ROOT) / 225.0),
    ((16.0 - ROOT) / 36.0, (16.0 + ROOT) / 36.0, 1.0 / 9.0),
)
"""Weights of the stages' rates in the stages' increments."""

ESTIMATE = ((-13.0 - 7.0 * ROOT) / 3.0, (-13.0 + 7.0 * ROOT) / 3.0, -1.0 / 3.0)
"""Weights of the stages' increments in the error estimate of order 3 (Hairer & Wanner, IV.8.20)."""


def rows_of(matrix):
    """A matrix as tuples of Python numbers, which kernels may read."""
    return tuple(tuple(value.item() for value in row) for row in matrix)


def decoupled():
    """(eigenvalues, to the eigenvectors, from the eigenvectors): the real one, a complex one."""
    values, vectors = np.linalg.eig(np.linalg.inv(np.array(MATRIX)))
    order = (int(np.argmin(np.abs(values.imag))), int(np.argmax(values.imag)))
    inverse = np.linalg.inv(vectors)
    chosen = tuple(values[k].item() for k in order)
    return chosen, rows_of(inverse[list(order)]), rows_of(vectors[:, list(order)])


REAL, PAIR = range(2)
"""The systems that Newton's method is decoupled into: of the real eigenvalue, of the pair."""

EIGENVALUES, TO_VECTORS, FROM_VECTORS = decoupled()
"""The real eigenvalue and the one of the pair above the axis (all complex numbers); rows that take
stages to them; columns that take them back, the pair's other half being the conjugate."""

INVERSE = rows_of(np.linalg.inv(np.array(MATRIX)))
"""Weights of the stages' increments in the stages' rates."""
