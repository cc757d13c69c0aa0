"""Kicks: their place in time, halves that add up, and runs whose steps end where they change."""

import math

import attrs
import numpy as np
import pytest

from flocsim import Body, Fluid, Sphere, System
from flocsim.forces import Contact, Gravity, StokesDrag, Thermal
from flocsim.forces.body_forces import random_key
from flocsim.integrators import DormandPrince54, Implicit, Overdamped, VelocityVerlet
from flocsim.integrators.loop.kicks import mean_noise
from tests.reference.kicks import increment

KEY = (123, 456)
WATER = Fluid(viscosity=0.89e-3)
RADIUS = 1e-6
ZETA = 6.0 * math.pi * 0.89e-3 * RADIUS
KT = 1.380649e-23 * 298.15


def noise(place, span, halvings=6, kick=0.5, body=2):
    return np.array(mean_noise(kick, halvings, place, span, body, KEY))


@pytest.mark.parametrize("span", [64, 32, 8, 1])
def test_the_mean_noise_is_that_of_the_plain_path(span):
    for place in range(0, 3 * 64, 8 * span if span < 8 else span):
        level = 6 - int(math.log2(span))
        wanted = increment(0.5, level, place // span, 2, KEY) / (0.5 / 2**level)
        np.testing.assert_allclose(noise(place, span), wanted, rtol=1e-12)


@pytest.mark.parametrize("span", [2, 16, 64])
def test_halves_add_up_to_the_whole(span):
    halves = noise(64, span // 2) + noise(64 + span // 2, span // 2)
    np.testing.assert_allclose(0.5 * halves, noise(64, span), rtol=1e-12)


def test_halves_are_independent_and_of_the_right_size():
    """Of 1500 kicks of 1/2⁶ of τ = .5 s, neighbours: N(0, 1/T) each, and no more alike than chance
    makes them."""
    values = np.concatenate([noise(place, 1) for place in range(1500)]).reshape(-1, 3)
    values *= math.sqrt(0.5 / 64)
    assert np.abs((values**2).mean(axis=0) - 1.0).max() < 4.5 * math.sqrt(2.0 / 1500)
    for lag in (1, 2, 32, 64):
        assert np.abs((values[lag:] * values[:-lag]).mean(axis=0)).max() < 4.5 / math.sqrt(1400)


def sphere(place=(0.0, 0.0), **more):
    return Body(Sphere(RADIUS), place, density=2650.0, **more)


def lone(method, kick=1e-3, seed=(3, 4), tolerance=None):
    return System([sphere()], [StokesDrag(), Thermal(kick=kick)], method, WATER, seed=seed)


def wanted_path(kicks, kick, seed=(3, 4), body=0):
    """Places (kicks + 1, 3) where a free sphere without inertia is at every kick."""
    size = np.sqrt(2.0 * KT / np.array([ZETA, ZETA, 8.0 * math.pi * 0.89e-3 * RADIUS**3]))
    steps = [increment(kick, 0, place, body, random_key(*seed)) for place in range(kicks)]
    return np.vstack([np.zeros(3), np.cumsum(size * steps, axis=0)])


def test_a_sphere_without_inertia_goes_along_the_plain_path():
    """x_k = Σ √(2 k_B T τ/ζ) ξ: the D of every kick is that of the law."""
    run = lone(Overdamped(1e-9)).run(0.1, jit=False)
    wanted = wanted_path(100, 1e-3)
    places = run.at(np.arange(1, 101) * 1e-3).position[:, 0]
    np.testing.assert_allclose(places, wanted[1:], rtol=1e-7, atol=1e-12)


def test_steps_end_at_kicks_and_only_one_is_taken_in_each():
    run = lone(Overdamped(1e-9)).run(0.02, jit=False)
    assert set(np.arange(21) * 1e-3) <= set(run.t.tolist())
    assert run.rejected == 0 and run.steps <= 24


@pytest.mark.parametrize(
    "method",
    [Implicit(1e-12), DormandPrince54(1e-12), VelocityVerlet(1e-9)],
    ids=lambda method: type(method).__name__,
)
def test_velocities_follow_their_recursion(method):
    """v' = e^(−x) v + (1 − e^(−x)) F/ζ with x = ζτ/m = 1, whatever the method."""
    body = sphere()
    kick = body.mass / ZETA
    system = System([body], [StokesDrag(), Thermal(kick=kick)], method, WATER, seed=9)
    run = system.run(8 * kick, jit=False)
    found = run.at(np.arange(1, 9) * kick).velocity[:, 0, :2]
    speed, wanted = np.zeros(2), []
    for place in range(8):
        force = math.sqrt(2.0 * KT * ZETA) * increment(kick, 0, place, 0, random_key(9))[:2] / kick
        speed = math.exp(-1.0) * speed + (1.0 - math.exp(-1.0)) * force / ZETA
        wanted.append(speed)
    np.testing.assert_allclose(found, wanted, rtol=1e-2, atol=1e-3 * np.abs(wanted).max())


def test_the_path_is_the_same_at_any_tolerance():
    bodies = [sphere(), Body(Sphere(2e-6), (0.0, 8e-6), density=2650.0)]
    forces = [Gravity(), StokesDrag(), Thermal(kick=2e-3), Contact()]
    ends = [
        System(bodies, forces, Overdamped(tolerance), WATER).run(0.05, jit=False).position[-1]
        for tolerance in (1e-8, 1e-11)
    ]
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-10)


def pair(gap, kick=1e-3, **more):
    """Two spheres a gap apart, and a contact force that they do not come to feel."""
    thermal = Thermal(kick=kick, **more)
    bodies = [sphere(), sphere((2.0 * RADIUS + gap, 0.0))]
    return System(bodies, [StokesDrag(), thermal, Contact()], Overdamped(1e-9), WATER, seed=5)


def test_near_each_other_kicks_are_halved_and_lead_to_the_same_place():
    """Bodies that do not touch are where whole kicks take them, when those end."""
    whole = pair(6e-7, 0.04).run(0.16, jit=False)
    halved = pair(6e-7, 0.04, finest="2 nm").run(0.16, jit=False)
    half = 0.02
    assert np.isclose(halved.t, half).any() and not np.isclose(whole.t, half).any()
    gaps = np.hypot(*(halved.position[:, 1] - halved.position[:, 0])[:, :2].T) - 2.0 * RADIUS
    assert gaps.min() > 0.0
    for time in (0.04, 0.08, 0.16):
        np.testing.assert_allclose(
            whole.at(time).position, halved.at(time).position, rtol=0.0, atol=1e-12
        )


def test_far_from_each_other_none_is_halved():
    far = pair(2e-5, finest="2 nm").run(4e-3, jit=False)
    assert far.steps == pair(2e-5).run(4e-3, jit=False).steps


def test_a_run_that_goes_on_gives_the_same_numbers_as_one_in_one_piece():
    system = pair(3e-7, finest="5 nm")
    whole = system.run(2.3e-3, jit=False)
    first = system.run(0.7e-3, jit=False)
    rest = system.run(2.3e-3, start=first, jit=False)
    np.testing.assert_allclose(rest.position[-1], whole.position[-1], rtol=0.0, atol=1e-15)


def test_kicks_go_by_seed_replicate_and_body():
    ends = {
        tuple(lone(Overdamped(1e-9), seed=seed).run(2e-3, jit=False).position[-1].ravel())
        for seed in (0, 1, (0, 0), (0, 1), (1, 0))
    }
    assert len(ends) == 5
    one, other = pair(2e-5).run(1e-3, jit=False).position[-1] - [[0, 0, 0], [2.2e-5, 0, 0]]
    assert not np.isclose(one, other).any()
    assert random_key(3, 4) == random_key(3, 4) != random_key(4, 3)


def test_without_temperature_nothing_is_drawn():
    cold = attrs.evolve(lone(Overdamped(1e-9)), forces=[StokesDrag(), Thermal(0.0, 1e-3)])
    assert cold.scene(jit=False).kicks == (0.0, 0.0, 0.0, 0.0)
    assert "out: Thermal: temperature is zero" in cold.explain()
    assert cold.run(0.01, jit=False).steps < 10
