"""Roots, settling speeds and restitution held against MODEL sections 5 and 7."""

import numpy as np
import pytest
from scipy.special import lambertw

from tests.reference.closed_forms import (
    balance,
    greatest_repulsion,
    impact,
    stokes_drag,
    terminal_velocity,
    zone_gaps,
)
from tests.reference.forces import Contact, DoubleLayer, Drag, Gravity, VanDerWaals, loads, reduced
from tests.reference.samples import CENTRES, VISCOSITY, WATER
from tests.reference.shapes import Scene, make_body


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
    ("radius", "speed"),
    [(4.62, 0.0864e-3), (4.95, 0.0992e-3), (16.41, 1.090e-3), (23.02, 2.146e-3)],
)
def test_settling_speeds(radius, speed):
    body = make_body([[0.0, 0.0]], radius * 1e-6, density=2650.0)
    gravity, drag = Gravity(9.81, WATER), Drag(VISCOSITY)
    g_effective = 9.81 * (1 - WATER / 2650.0)
    terminal = terminal_velocity(body.mass, g_effective, VISCOSITY, body.equivalent_radius)
    assert terminal == pytest.approx(speed, rel=1e-3)
    scene = Scene((body,), np.zeros((1, 3)), np.array([[0.0, -terminal, 0.0]]))
    assert loads(scene, [gravity, drag])[0, 1] == pytest.approx(0.0, abs=1e-12 * body.mass)


@pytest.mark.parametrize(
    ("stiffness", "damping", "mass"),
    [(20.0, 2.1e5, 1.81e-9), (20.0, 7.4e5, 1.46e-10), (20.0, 1.2e6, 5.56e-11)],
)
def test_table_one_damping_is_critical(stiffness, damping, mass):
    assert Contact(stiffness, 2.0).damping(mass)[0] == pytest.approx(damping, rel=5e-3)


@pytest.mark.parametrize(
    ("ratio", "restitution"),
    [
        (0.05, 0.858758),
        (0.1, 0.744079),
        (0.2, 0.571740),
        (0.5, 0.298436),
        (0.7071, 0.207882),
        (1 / np.sqrt(2), np.exp(-np.pi / 2)),
        (0.9, 0.155283),
        (1.0, np.exp(-2)),
        (1.5, 0.075588),
        (3.0, 0.023770),
    ],
)
def test_restitution_with_tension_clipped(ratio, restitution):
    assert impact(ratio, tension=False)[0] == pytest.approx(restitution, abs=6e-7)


@pytest.mark.parametrize("ratio", [0.05, 0.2, 0.5, 0.9])
def test_restitution_with_tension(ratio):
    root = np.sqrt(1 - ratio**2)
    restitution, duration, _ = impact(ratio, tension=True)
    assert restitution == pytest.approx(np.exp(-np.pi * ratio / root), rel=1e-9)
    assert duration == pytest.approx(np.pi / root, rel=1e-9)


def test_greatest_overlap_at_critical_damping():
    assert impact(1.0, tension=True)[2] == pytest.approx(np.exp(-1), rel=1e-9)
    assert impact(1.0, tension=True)[:2] == (0.0, np.inf)
