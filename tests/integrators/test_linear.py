"""Elimination in place against numpy."""

import numpy as np
import pytest

from flocsim.integrators.linear import solve_in_place


@pytest.mark.parametrize("size", [1, 2, 3, 6, 9, 15])
@pytest.mark.parametrize("which", [0, 1])
def test_random_systems_agree_with_numpy(size, which):
    rng = np.random.default_rng(size)
    for _ in range(20):
        system = rng.normal(size=(2, size, size + 1))
        matrix, load = system[which, :, :-1].copy(), system[which, :, -1].copy()
        untouched = system[1 - which].copy()
        assert solve_in_place(system, which)
        expected = np.linalg.solve(matrix, load)
        grain = np.linalg.cond(matrix) * np.finfo(float).eps * np.abs(expected).max()
        assert np.abs(system[which, :, -1] - expected).max() <= 10.0 * grain
        assert np.array_equal(system[1 - which], untouched)


def test_zero_on_the_diagonal_needs_pivoting():
    system = np.array([[[0.0, 2.0, 4.0], [3.0, 0.0, 9.0]]])
    assert solve_in_place(system, 0)
    assert system[0, :, -1].tolist() == [3.0, 2.0]


def test_rows_of_masses_and_inertias_lie_many_orders_apart():
    """Kilograms beside kg m²: the solution stays exact to its own scale."""
    rng = np.random.default_rng(3)
    scales = np.array([1e-10, 1e-10, 1e-21])
    matrix = np.diag(scales) + 0.1 * np.sqrt(np.outer(scales, scales)) * rng.normal(size=(3, 3))
    exact = np.array([1e-3, -2e-3, 50.0])
    system = np.column_stack([matrix, matrix @ exact])[None].copy()
    assert solve_in_place(system, 0)
    assert system[0, :, -1] == pytest.approx(exact, rel=1e-8)


@pytest.mark.parametrize(
    "matrix", [np.zeros((2, 2)), [[1.0, 2.0], [2.0, 4.0]], [[np.nan, 1.0], [1.0, 1.0]]]
)
def test_singular_and_undefined_systems_are_refused(matrix):
    system = np.column_stack([np.array(matrix), [1.0, 1.0]])[None].copy()
    assert not solve_in_place(system, 0)
