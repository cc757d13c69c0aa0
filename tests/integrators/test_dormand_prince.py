"""The coefficients of the method of Dormand and Prince against what defines them."""

import numpy as np
import pytest

from flocsim.integrators.explicit import ESTIMATE, MATRIX, NODES

EXPLICIT, EXPLICIT_NODES = np.array(MATRIX), np.array(NODES)
HIGHER = EXPLICIT[6]
LOWER = HIGHER - np.array(ESTIMATE)


def trees(matrix, nodes):
    """(order, elementary weights, 1/density) of the rooted trees up to order 5."""
    a, c = matrix, nodes
    yield from ((1, np.ones(7), 1), (2, c, 1 / 2), (3, c**2, 1 / 3), (3, a @ c, 1 / 6))
    yield from ((4, c**3, 1 / 4), (4, c * (a @ c), 1 / 8), (4, a @ c**2, 1 / 12))
    yield from ((4, a @ a @ c, 1 / 24), (5, c**4, 1 / 5), (5, c**2 * (a @ c), 1 / 10))
    yield from ((5, c * (a @ c**2), 1 / 15), (5, c * (a @ a @ c), 1 / 30))
    yield from ((5, (a @ c) ** 2, 1 / 20), (5, a @ c**3, 1 / 20), (5, a @ (c * (a @ c)), 1 / 40))
    yield from ((5, a @ a @ c**2, 1 / 60), (5, a @ a @ a @ c, 1 / 120))


def test_dormand_prince_nodes_are_the_sums_of_its_rows():
    assert EXPLICIT.sum(axis=1) == pytest.approx(EXPLICIT_NODES, abs=1e-14)
    assert not np.triu(EXPLICIT).any()


def test_dormand_prince_meets_all_conditions_of_order_five():
    for _, weights, wanted in trees(EXPLICIT, EXPLICIT_NODES):
        assert HIGHER @ weights == pytest.approx(wanted, rel=1e-13)


def test_its_estimate_compares_with_a_method_of_order_four():
    for order, weights, wanted in trees(EXPLICIT, EXPLICIT_NODES):
        if order < 5:
            assert LOWER @ weights == pytest.approx(wanted, rel=1e-13)
    missed = [LOWER @ weights - wanted for order, weights, wanted in trees(EXPLICIT, EXPLICIT_NODES)
              if order == 5]  # fmt: skip
    assert np.abs(missed).max() > 1e-5
