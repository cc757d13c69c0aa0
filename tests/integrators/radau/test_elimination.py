"""Blocks that are nearly singular, as those of a stiff contact are, against numpy's solutions."""

from types import SimpleNamespace

import numpy as np
import pytest

from flocsim.integrators.radau.elimination import (
    COMPLEX_IM,
    COMPLEX_RE,
    REAL_PART,
    divide_complex,
    divide_load,
    divide_real,
    factorise_diagonal,
)
from flocsim.integrators.radau.tableau import COMPLEX, REAL


def stiff_blocks(rng, stiffness):
    """Return a mass and a stiffness along two directions, and a block beside it, real and
    complex."""
    along = rng.normal(size=(3, 2))
    spring = stiffness * along @ along.T
    diagonal = np.array([np.eye(3) + spring, (1.0 + 0.5j) * np.eye(3) + (0.7 - 0.4j) * spring])
    beside = np.array([spring, (0.7 - 0.4j) * spring]) + rng.normal(size=(2, 3, 3))
    return diagonal, beside


def elimination_of(diagonal, beside):
    """Return these two blocks as an elimination of one body has them."""
    blocks = np.zeros((3, 2, 3, 4))
    for place, (of_real, of_pair) in enumerate((diagonal, beside)):
        blocks[REAL_PART, place, :, :3] = of_real.real
        blocks[COMPLEX_RE, place, :, :3] = of_pair.real
        blocks[COMPLEX_IM, place, :, :3] = of_pair.imag
    body, column = np.zeros(1, int), np.zeros(1, int)
    return SimpleNamespace(blocks=blocks, body=body, column=column, pivots=np.zeros((2, 1, 3), int))


@pytest.mark.parametrize("stiffness", [1.0, 1e6, 1e12])
def test_quotients_leave_residuals_of_rounding_alone(stiffness):
    """With inverses in their place, residuals at 1e12 are as large as the loads."""
    rng = np.random.default_rng(5)
    for _ in range(20):
        diagonal, beside = stiff_blocks(rng, stiffness)
        e = elimination_of(diagonal, beside)
        loads = rng.normal(size=(2, 3)).astype(complex)
        loads[REAL] = loads[REAL].real
        given = loads.copy()
        for which in (REAL, COMPLEX):
            assert factorise_diagonal(e, which, 0)
            divide_load(e, loads, which, 0, 0)
        divide_real(e, 0)
        divide_complex(e, 0)
        pair = e.blocks[COMPLEX_RE, 1, :, :3] + 1j * e.blocks[COMPLEX_IM, 1, :, :3]
        for which, quotient in ((REAL, e.blocks[REAL_PART, 1, :, :3]), (COMPLEX, pair)):
            whole = diagonal[which]
            rounding = 1e-14 * np.abs(whole).max()
            left = whole @ loads[which] - given[which]
            assert np.abs(left).max() < rounding * np.abs(loads[which]).max()
            left = quotient @ whole - beside[which]
            assert np.abs(left).max() < rounding * np.abs(quotient).max()


def test_a_singular_block_is_told():
    diagonal = np.zeros((2, 3, 3), dtype=complex)
    assert not factorise_diagonal(elimination_of(diagonal, diagonal), REAL, 0)
