"""Nearly singular blocks, as those of stiff contacts are, and the momentum of clusters."""

from types import SimpleNamespace

import numpy as np
import pytest

from flocsim import Body, Sphere
from flocsim.body import Fluid, scene_of
from flocsim.integrators.radau.elimination import (
    COMPLEX_IM,
    COMPLEX_RE,
    REAL_PART,
    divide_complex,
    divide_load,
    divide_real,
    factorise_blocks,
    factorise_diagonal,
    solve_balanced,
)
from flocsim.integrators.radau.tableau import COMPLEX, EIGENVALUES, REAL
from flocsim.integrators.rhs.blocks import lower_block, own_block, upper_block
from flocsim.state.work import DAMPING, STIFFNESS, work_of


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
    blocks = np.zeros((3, 3, 3, 4))
    for place, (of_real, of_pair) in ((0, diagonal), (2, beside)):
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
        pair = e.blocks[COMPLEX_RE, 2, :, :3] + 1j * e.blocks[COMPLEX_IM, 2, :, :3]
        for which, quotient in ((REAL, e.blocks[REAL_PART, 2, :, :3]), (COMPLEX, pair)):
            whole = diagonal[which]
            rounding = 1e-14 * np.abs(whole).max()
            left = whole @ loads[which] - given[which]
            assert np.abs(left).max() < rounding * np.abs(loads[which]).max()
            left = quotient @ whole - beside[which]
            assert np.abs(left).max() < rounding * np.abs(quotient).max()


def test_a_singular_block_is_told():
    diagonal = np.zeros((2, 3, 3), dtype=complex)
    assert not factorise_diagonal(elimination_of(diagonal, diagonal), REAL, 0)


STEP = 1e-3
"""Step of the chain below [s]."""


def stiff_chain(rng, stiffness):
    """Return scene, work and masses of four discs that touch in a row, with drag of their own.

    ``stiffness`` is h² K/M of the contacts.
    """
    radii = 1e-6 * rng.uniform(1.0, 8.0, 4)
    bodies = [Body(Sphere(radius), density=2650.0) for radius in radii]
    scene, n = scene_of(bodies, Fluid(), []), len(bodies)
    work = work_of(scene, np.zeros((n, 3)), np.zeros((n, 3)))
    work.cluster[:] = 0
    masses = np.array([body.mass for body in bodies])
    for body in range(n):
        # As strong in all directions, about a point beside the centroid.
        drag = rng.uniform(0.1, 2.0) * np.eye(3)
        drag[:2, 2] = drag[2, :2] = 0.1 * radii[body] * rng.normal(size=2)
        drag[2, 2] = radii[body] ** 2
        work.jacobian[DAMPING, [body, own_block(work, body)]] = masses[body] / STEP * drag
    for pair in range(work.tally.pairs):
        a, b = work.pairs[pair].later, work.pairs[pair].earlier
        work.pairs[pair].acting = a == b + 1
        if a == b + 1:
            angle = rng.uniform(0.0, 2.0 * np.pi)
            normal, arms = np.array([np.cos(angle), np.sin(angle)]), rng.normal(size=2)
            of_a, of_b = (
                np.append(normal, arms[0] * radii[a]),
                np.append(-normal, arms[1] * radii[b]),
            )
            spring = stiffness * masses[a] / STEP**2
            work.jacobian[STIFFNESS, a] += spring * np.outer(of_a, of_a)
            work.jacobian[STIFFNESS, b] += spring * np.outer(of_b, of_b)
            work.jacobian[STIFFNESS, lower_block(work, pair)] = spring * np.outer(of_a, of_b)
            work.jacobian[STIFFNESS, upper_block(work, pair)] = spring * np.outer(of_b, of_a)
    return scene, work, masses


@pytest.mark.parametrize("stiffness", [1.0, 1e4, 1e8])
def test_momentum_of_a_cluster_is_kept_to_rounding(stiffness):
    """Only mass and drag change it, however large the loads of the contacts are."""
    rng = np.random.default_rng(7)
    for _ in range(20):
        scene, work, masses = stiff_chain(rng, stiffness)
        assert factorise_blocks(scene, work, STEP, True)
        n = len(masses)
        loads = masses.mean() / STEP * rng.normal(size=(2, n, 3)) * [1.0, 1.0, 1e-6]
        loads[:, 1:] *= stiffness
        work.loads[:, : 3 * n] = loads.reshape(2, 3 * n)
        solve_balanced(work, True)
        for which in (REAL, COMPLEX):
            terms = np.zeros((n, 2), complex)
            for body in range(n):
                moved = work.loads[which, 3 * body : 3 * body + 3]
                terms[body] = work.jacobian[DAMPING, own_block(work, body), :2] @ moved
                terms[body] += EIGENVALUES[which] / STEP * masses[body] * moved[:2]
            left = terms.sum(axis=0) - loads[which, 0, :2]
            assert np.abs(left).max() < 4.0 * np.finfo(float).eps * np.abs(terms).sum()
