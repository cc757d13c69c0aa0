"""Lubrication: its law, against the plain reference, and the closed forms of an approach."""

import math

import attrs
import numpy as np
import pytest

from flocsim import Body, Fluid, Sphere, System
from flocsim.errors import RangeError
from flocsim.fields import quantity
from flocsim.forces import BodyForce, Contact, Lubrication, VanDerWaals
from flocsim.forces.check import sample_pairs
from flocsim.integrators import Implicit
from tests.helpers.fast_scene import VISCOSITY, FastScene, fast_system, random_case
from tests.reference import forces as plain_forces
from tests.reference.forces import loads

PAIR = sample_pairs(math.inf)[0]._replace(reduced_radius=2.5e-6)
RADIUS, WATER = 5e-6, Fluid(viscosity=8.9e-4)
FILM = 6.0 * math.pi * 8.9e-4 * (RADIUS / 2.0) ** 2
"""6πγ r*² [N s] of two spheres of that radius."""


@attrs.frozen
class Push(BodyForce):
    """A constant force towards −y."""

    force: float = quantity("N", default=1e-12)

    @staticmethod
    def kernel(body, force):
        return 0.0, -force, 0.0


def law(gap, rate, h_min=1e-9, cut=1e-5):
    view = PAIR._replace(gap=gap, gap_rate=rate)
    return Lubrication.kernel(view, 8.9e-4, h_min, cut)


def test_the_law_resists_approach_and_parting_alike():
    assert law(1e-7, -1e-4) == pytest.approx(FILM * 1e-4 / 1e-7, rel=1e-9, abs=0.0)
    assert law(1e-7, 1e-4) == -law(1e-7, -1e-4)
    assert law(1e-7, 0.0) == 0.0


def test_below_the_least_gap_it_stays_and_at_the_cut_it_ends_without_a_jump():
    assert law(5e-10, -1e-4) == law(1e-9, -1e-4) == law(-1e-8, -1e-4)
    assert law(5e-6, -1e-4) == pytest.approx(FILM * 1e-4 / 5e-6, rel=1e-9, abs=0.0)
    assert law(1e-5, -1e-4) == law(2e-5, -1e-4) == 0.0
    gaps = np.linspace(4e-6, 1.2e-5, 10_001)
    found = np.array([law(gap, -1e-4) for gap in gaps])
    assert np.abs(np.diff(found)).max() <= 2.0 * law(5e-6, -1e-4) * 8e-10 / 2.5e-6


@pytest.mark.parametrize("gap", [-1e-8, 5e-10, 2e-9, 1e-7, 4e-6, 6e-6, 9e-6, 1.1e-5])
def test_the_slope_is_the_derivative(gap):
    size = 1e-4 * abs(gap)
    difference = (law(gap + size, -2e-4) - law(gap - size, -2e-4)) / (2.0 * size)
    found = Lubrication.slope(PAIR._replace(gap=gap, gap_rate=-2e-4), 8.9e-4, 1e-9, 1e-5)
    assert found == pytest.approx(difference, rel=1e-5, abs=1e-15)


@pytest.mark.parametrize("seed", range(25))
def test_loads_are_the_references(seed):
    case = random_case(seed)
    system = fast_system(case.plain, [Lubrication(h_min=2e-8)], case.fluid, **case.material)
    fast = FastScene(system, jit=False)
    plain = plain_forces.Lubrication(VISCOSITY, 2e-8, smoothing=fast.scene.smoothing)
    found, wanted = fast.loads(), loads(case.plain, [plain])
    scale = np.abs(wanted[:, :2]).max()
    size = max(body.equivalent_radius for body in case.plain.bodies)
    assert scale > 0.0
    assert (np.abs(found - wanted) <= 1e-8 * scale * np.array([1.0, 1.0, size])).all()


def pair(gap):
    """Two spheres a gap apart, one above the other, which is held; next to no inertia."""
    return [
        Body(Sphere(RADIUS), fixed=True, surface_density=1e-3),
        Body(Sphere(RADIUS), (0.0, 2.0 * RADIUS + gap), surface_density=1e-3),
    ]


def gaps_of(run, times):
    return run.at(times).position[:, 1, 1] - 2.0 * RADIUS


@pytest.mark.slow
def test_a_constant_push_closes_the_gap_exponentially():
    """h = h₀ exp(−F t/(6πγ r*²)), over four orders of the gap."""
    push, start = 1e-12, 4e-6
    until = 8.0 * FILM / push
    run = System(pair(start), [Push(push), Lubrication()], Implicit(1e-11), WATER)
    run = run.run(until, jit=False)
    times = np.linspace(0.05, 1.0, 20) * until
    wanted = start * np.exp(-push * times / FILM)
    np.testing.assert_allclose(gaps_of(run, times), wanted, rtol=1e-3)


def test_attraction_alone_closes_it_as_a_root():
    """h² = h₀² − H_A t/(18πγ r*)."""
    hamaker, start = 1e-19, 5e-8
    rate = hamaker / (18.0 * math.pi * 8.9e-4 * RADIUS / 2.0)
    until = 0.99 * start**2 / rate
    forces = [VanDerWaals(hamaker, gap="surface"), Lubrication()]
    run = System(pair(start), forces, Implicit(1e-12), WATER).run(until, jit=False)
    times = np.linspace(0.05, 1.0, 20) * until
    wanted = np.sqrt(start**2 - rate * times)
    np.testing.assert_allclose(gaps_of(run, times), wanted, rtol=2e-3)


@pytest.mark.slow
def test_the_least_gap_lets_bodies_touch_in_a_known_time():
    """From h₀ to h_min takes 6πγ r*²/F ln(h₀/h_min), from there to touching 6πγ r*²/F more."""
    push, start, least = 1e-10, 1e-6, 1e-8
    expected = FILM / push * (math.log(start / least) + 1.0)
    forces = [Push(push), Lubrication(h_min=least), Contact(k_n=1.0, k_t=0.0)]
    run = System(pair(start), forces, Implicit(1e-10), WATER).run(1.2 * expected, jit=False)
    times = np.linspace(0.8, 1.2, 401) * expected
    touch = np.interp(0.0, -gaps_of(run, times), times)
    assert touch == pytest.approx(expected, rel=1e-3)


def test_keys_are_checked():
    with pytest.raises(RangeError, match="h_min must be at most half of cut"):
        Lubrication(h_min="2 nm", cut="3 nm")
    with pytest.raises(RangeError, match="h_min must be a finite number above 0"):
        Lubrication(h_min=0.0)
