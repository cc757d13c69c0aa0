"""Roots, barriers and critical damping against MODEL sections 5 and 7."""

import numpy as np
import pytest
from scipy.special import lambertw

from tests.reference.closed_forms import (
    balance,
    greatest_repulsion,
    stokes_drag,
    zone_gaps,
)
from tests.reference.forces import Contact, DoubleLayer, VanDerWaals, reduced
from tests.reference.samples import CENTRES, VISCOSITY


@pytest.mark.parametrize(
    ("hamaker", "potential", "debye_length", "inner", "outer", "rel"),
    [
        (1e-18, 15e-3, 0.98e-6, 343.52e-9, 5924.98e-9, 2e-5),
        (1e-18, 25e-3, 98e-9, 83.9e-9, 380e-9, 2e-3),
        (4.7e-20, 15e-3, 9.6e-9, 10.9e-9, 30.9e-9, 3e-3),
        (1e-20, 25e-3, 0.98e-9, 0.839e-9, 3.80e-9, 2e-3),
    ],
)
def test_zone_roots(hamaker, potential, debye_length, inner, outer, rel):
    gaps = zone_gaps(hamaker, potential, debye_length)
    assert gaps == pytest.approx((inner, outer), rel=rel)
    half = -np.sqrt(balance(hamaker, potential, debye_length)) / 2
    lambert = [-2 * debye_length * lambertw(half, branch).real for branch in (0, -1)]
    assert gaps == pytest.approx(lambert, rel=1e-9)
    for d in gaps:
        attraction = -VanDerWaals(hamaker, d_min=1e-12).repulsion(d, 1e-6)
        assert attraction == pytest.approx(DoubleLayer(potential, debye_length).repulsion(d, 1e-6))


def test_zone_that_does_not_exist():
    assert balance(1e-18, 15e-3, 0.98e-9) == pytest.approx(86.5, rel=1e-3)
    assert zone_gaps(1e-18, 15e-3, 0.98e-9) is None
    assert zone_gaps(1e-18, 15e-3, 98e-9) is None


def test_barrier_of_type_three_outruns_settling():
    radii, gaps = (4.62e-6, 4.95e-6), zone_gaps(1e-18, 15e-3, 0.98e-6)
    force = greatest_repulsion(*CENTRES, reduced(*radii), gaps)
    drift = force * sum(1 / stokes_drag(VISCOSITY, r) for r in radii)
    assert drift == pytest.approx(38e-6, rel=0.02)


@pytest.mark.parametrize(
    ("stiffness", "damping", "mass"),
    [(20.0, 2.1e5, 1.81e-9), (20.0, 7.4e5, 1.46e-10), (20.0, 1.2e6, 5.56e-11)],
)
def test_table_one_damping_is_critical(stiffness, damping, mass):
    assert Contact(stiffness, 2.0).damping(mass)[0] == pytest.approx(damping, rel=5e-3)
