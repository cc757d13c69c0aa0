"""Elimination in place against numpy."""

import numpy as np
import pytest

from flocsim.integrators.radau.dense import factorise, solve_dense
from flocsim.integrators.radau.tableau import PAIR, REAL


def systems(matrix, load, which=0):
    """Two systems with their loads and pivots, one of them the given one, the other at random."""
    size = len(load)
    made = np.random.default_rng(size).normal(size=(2, size, size + 1)).astype(complex)
    made[which, :, :size], made[which, :, size] = matrix, load
    return made[:, :, :size].copy(), made[:, :, size].copy(), np.zeros((2, size), dtype=np.int64)


def solved(matrix, load, which=0):
    """The solution; None where it finds the matrix singular."""
    system, loads, pivots = systems(matrix, load, which)
    if not factorise(system, pivots, which):
        return None
    solve_dense(system, pivots, loads, which)
    return loads[which]


def random_numbers(rng, which, *shape):
    """Real ones for the real system, complex ones for the other."""
    real = rng.normal(size=shape)
    return real if which == REAL else real + 1j * rng.normal(size=shape)


@pytest.mark.parametrize("size", [1, 2, 3, 6, 9, 15])
@pytest.mark.parametrize("which", [REAL, PAIR])
def test_random_systems_agree_with_numpy(size, which):
    rng = np.random.default_rng(size)
    for _ in range(20):
        matrix, load = random_numbers(rng, which, size, size), random_numbers(rng, which, size)
        expected = np.linalg.solve(matrix, load)
        grain = np.linalg.cond(matrix) * np.finfo(float).eps * np.abs(expected).max()
        assert np.abs(solved(matrix, load, which) - expected).max() <= 10.0 * grain


def test_zero_on_the_diagonal_needs_pivoting():
    assert solved([[0.0, 2.0], [3.0, 0.0]], [4.0, 9.0]).tolist() == [3.0, 2.0]


def test_rows_of_masses_and_inertias_lie_many_orders_apart():
    """Kilograms beside kg m²: the solution stays exact to its own scale."""
    rng = np.random.default_rng(3)
    scales = np.array([1e-10, 1e-10, 1e-21])
    matrix = np.diag(scales) + 0.1 * np.sqrt(np.outer(scales, scales)) * rng.normal(size=(3, 3))
    exact = np.array([1e-3, -2e-3, 50.0])
    assert solved(matrix, matrix @ exact).real == pytest.approx(exact, rel=1e-8)


@pytest.mark.parametrize(
    "matrix", [np.zeros((2, 2)), [[1.0, 2.0], [2.0, 4.0]], [[np.nan, 1.0], [1.0, 1.0]]]
)
def test_singular_and_undefined_systems_are_refused(matrix):
    assert solved(np.array(matrix), np.array([1.0, 1.0])) is None
