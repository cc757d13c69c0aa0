"""The coefficients of Radau IIA against what defines them."""

import numpy as np
import pytest

from flocsim.integrators.radau import tableau as radau_tableau

RADAU_NODES = np.array(radau_tableau.NODES)
RADAU = np.array(radau_tableau.MATRIX)


@pytest.mark.parametrize("power", range(1, 6))
def test_radau_quadrature_is_exact_for_polynomials_below_degree_five(power):
    """B(5), the last row being the weights: stiffly accurate."""
    assert RADAU[-1] @ RADAU_NODES ** (power - 1) == pytest.approx(1.0 / power, rel=1e-14)


@pytest.mark.parametrize("power", range(1, 4))
def test_radau_stages_are_exact_for_polynomials_below_degree_three(power):
    """C(3): collocation."""
    found = RADAU @ RADAU_NODES ** (power - 1)
    assert found == pytest.approx(RADAU_NODES**power / power, rel=1e-13)


def test_radau_damps_what_is_infinitely_stiff():
    """R(∞) = 1 − bᵀA⁻¹1 = 0."""
    assert 1.0 - RADAU[-1] @ np.linalg.solve(RADAU, np.ones(3)) == pytest.approx(0.0, abs=1e-14)


def test_radau_eigenvalues_and_their_vectors():
    real, pair = radau_tableau.EIGENVALUES
    assert real.imag == 0.0 and pair.imag > 0.0
    to, back = np.array(radau_tableau.TO_EIGENBASIS), np.array(radau_tableau.FROM_EIGENBASIS)
    inverse = np.linalg.inv(RADAU)
    for which, value in enumerate((real, pair)):
        assert to[which] @ inverse == pytest.approx(value * to[which], rel=1e-12)
        assert inverse @ back[:, which] == pytest.approx(value * back[:, which], rel=1e-12)
    assert to @ back == pytest.approx(np.eye(2), abs=1e-13)


@pytest.mark.parametrize("power", [1, 2, 3])
def test_radau_estimate_vanishes_for_cubics(power):
    """Slope at the start + weighted increments of tᵏ at the nodes."""
    found = np.array(radau_tableau.ESTIMATE) @ RADAU_NODES**power
    assert found + (power == 1) == pytest.approx(0.0, abs=1e-13)
