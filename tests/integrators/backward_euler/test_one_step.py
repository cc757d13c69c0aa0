"""One step of backward Euler: against a plain minimisation, exact motions, and what it keeps."""

import math
from itertools import product

import numpy as np
import pytest
from scipy.optimize import minimize

from flocsim import Body, Sphere
from flocsim.forces import Contact, Gravity, StokesDrag
from flocsim.integrators.rhs.error import FREE_MOTION_FRACTION
from flocsim.state.work import NOW
from flocsim.swarms.placement import floor
from tests.helpers.one_step import Stage
from tests.helpers.swarm_scenes import WATER, R, forces
from tests.helpers.tiers import rest_slow

K_N = 20.0


def heap(seed, count=8, speed=2e-4):
    """Discs that just touch, or nearly, over a floor, flying about."""
    rng = np.random.default_rng(seed)
    places = [(2.001 * R * (k % 4) + R * (k // 4), 1.0001 * R + 1.74 * R * (k // 4))
              for k in range(count)]  # fmt: skip
    discs = [
        Body(Sphere(R), place, 0.0, tuple(speed * rng.normal(size=2)), density=2650.0)
        for place in places
    ]
    return [floor(20.0 * R, beyond=0.0), *discs]


def potential_of(stage, bodies, step):
    """The function of the places of all discs (n, 2), in radii, whose minimum a step ends at:
    inertia, Stokes's drag, weight and springs."""
    discs = bodies[1:]
    start, speed = stage.position[1:, :2], stage.velocity[1:, :2]
    mass = np.array([body.mass for body in discs])[:, None]
    weight = 9.81 * np.array([body.buoyant_mass(WATER) for body in discs])
    drag = 6.0 * math.pi * WATER.viscosity * R
    scale = 1e-4 * R

    def value(moved):
        way = scale * moved.reshape(-1, 2)
        places = start + way
        energy = 0.5 * np.sum(mass * (way / step - speed) ** 2)
        energy += 0.5 * drag / step * np.sum(way**2) + np.sum(weight * way[:, 1])
        gaps = [places[:, 1] - R]
        for k in range(len(places)):
            gaps.append(np.hypot(*(places[k + 1 :] - places[k]).T) - 2.0 * R)
        deep = np.minimum(np.concatenate(gaps), 0.0)
        return (energy + 0.5 * soft * np.sum(deep**2)) / (soft * scale**2)

    soft = 2e-3
    return value, scale, start, soft


@pytest.mark.parametrize("seed", rest_slow(range(3), lambda seed: seed == 0))
def test_a_step_ends_at_the_minimum_of_its_potential(seed):
    """Springs a ten-thousandth as hard, which a plain minimisation can follow."""
    bodies, step = heap(seed), 1e-4
    contact = Contact(k_n=2e-3, k_t=0.0, damping_n=0.0, damping_t=0.0)
    stage = Stage(bodies, [Gravity(), StokesDrag(), contact], WATER)
    value, scale, start, _ = potential_of(stage, bodies, step)
    plain = minimize(value, np.zeros(2 * (len(bodies) - 1)), method="BFGS",
                     options={"gtol": 1e-9, "maxiter": 5000})  # fmt: skip
    assert stage.end(step)
    expected = start + scale * plain.x.reshape(-1, 2)
    moved = np.abs(stage.position[1:, :2] - start).max()
    assert moved > 1e-3 * R
    assert np.abs(stage.position[1:, :2] - expected).max() < 1e-4 * moved


@pytest.mark.parametrize("friction", ["none", 0.3])
def test_the_end_does_not_depend_on_where_its_search_begins(friction):
    """From contacts that stick, and from ones that slide to either side."""
    ends, step = [], 1e-5
    for side in (0, 1, -1):
        stage = Stage(heap(5), forces(friction=friction), WATER)
        stage.work.candidates["slide_direction"] = side
        assert stage.end(step)
        ends.append(stage.velocity)
    ends = np.array(ends) * [1.0, 1.0, R]
    # Newton's method ends a hundredth of the tolerance from where it goes at most.
    assert step * np.abs(ends[1:] - ends[0]).max() < 1e-11
    assert step * np.abs(ends[0]).max() > 1e-9


def test_a_step_is_of_first_order_where_drag_slows_a_body():
    """v = v_t + (v_0 − v_t) exp(−t/τ), a disc resting elsewhere."""
    errors, until = [], 2e-5
    for count in (8, 16):
        disc = Body(Sphere(R), (0.0, 5.0 * R), 0.0, (1e-3, 0.0), density=2650.0)
        rest = Body(Sphere(R), (8.0 * R, 1.0 * R), density=2650.0)
        stage = Stage([floor(20.0 * R), disc, rest], forces(), WATER)
        for _ in range(count):
            stage.step(until / count)
        lasts = disc.mass / (6.0 * math.pi * WATER.viscosity * R)
        exact = 1e-3 * lasts * -math.expm1(-until / lasts)
        errors.append(abs(stage.position[1, 0] - exact))
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.15)


def test_the_estimate_is_that_of_the_step():
    """½ h times the change of velocity, which drag shortens: half of what a step is off by, or up
    to twice that."""
    disc = Body(Sphere(R), (0.0, 5.0 * R), 0.0, (1e-3, 0.0), density=2650.0)
    lasts = disc.mass / (6.0 * math.pi * WATER.viscosity * R)
    for share in (0.05, 0.5):
        stage = Stage([floor(20.0 * R), disc], forces(), WATER)
        step = share * lasts
        stage.step(step)
        before = stage.position[1, 0], stage.velocity[1, 0]
        ratio = stage.step(step)
        exact = before[0] + before[1] * lasts * -math.expm1(-share)
        off = abs(stage.position[1, 0] - exact)
        allowed = 1e-9 * FREE_MOTION_FRACTION  # nothing touches
        assert 0.5 * off < allowed * ratio < 6.0 * off


def test_what_rests_stays_and_is_no_error():
    """A column: the sum of overlaps is m g n (n + 1)/(2 k_n), and steps of any size leave it."""
    n = 6
    discs = [Body(Sphere(R), (0.0, R + 2.0 * R * k), density=2650.0) for k in range(n)]
    stage = Stage([floor(4.0 * R, beyond=0.0), *discs], forces(), WATER)
    for step in (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1):
        ratio = stage.step(step)
    assert ratio < 1e-6
    weight = 9.81 * discs[0].buoyant_mass(WATER)
    # From the floor to the top of all: n (n + 1)/2 weights press n contacts.
    pressed = n * (n + 1) / 2.0 * weight / K_N
    sum_of_overlaps = (2.0 * n - 1.0) * R - stage.position[n, 1]
    assert sum_of_overlaps == pytest.approx(pressed, rel=1e-5)


def test_momentum_is_kept_to_rounding_without_gravity_and_drag():
    bodies = heap(1, speed=1e-3)[1:]
    stage = Stage(bodies, [Contact()])
    mass = np.array([body.mass for body in bodies])
    before = mass @ stage.velocity[:, :2]
    kinetic = np.sum(mass[:, None] * stage.velocity[:, :2] ** 2)
    scale = np.sum(mass * np.hypot(*stage.velocity[:, :2].T))
    for _ in range(5):
        stage.step(2e-6)
    assert np.abs(mass @ stage.velocity[:, :2] - before).max() < 1e-13 * scale
    after = np.sum(mass[:, None] * stage.velocity[:, :2] ** 2)
    assert after < 0.9 * kinetic


def test_a_disc_that_slides_begins_to_roll_by_no_more_than_friction():
    """Pushed along a floor it is slowed by µ g' until it rolls, and turned by 2 µ g'/R."""
    disc = Body(Sphere(R), (0.0, R - 2e-13), 0.0, (1e-3, 0.0), density=2650.0)
    contact = Contact(friction=0.3)
    stage = Stage([floor(40.0 * R), disc], [Gravity(), contact], WATER)
    slowing = 0.3 * 9.81 * disc.buoyant_mass(WATER) / disc.mass
    until = 0.5 * (1e-3 / (slowing * (1.0 + disc.mass * R**2 / disc.inertia)))
    for _ in range(10):
        stage.step(until / 10)
    assert stage.velocity[1, 0] == pytest.approx(1e-3 - slowing * until, rel=2e-2)
    turned = slowing * until * disc.mass * R / disc.inertia
    assert abs(stage.velocity[1, 2]) == pytest.approx(turned, rel=5e-2)
    for _ in range(20):
        stage.step(until / 10)
    # It rolls: the point that touches the floor is at rest.
    slip = stage.velocity[1, 0] + R * stage.velocity[1, 2]
    assert abs(slip) < 1e-2 * abs(stage.velocity[1, 0])
    assert stage.velocity[1, 0] > 1e-4


def energy_of(stage, bodies, contact):
    """Of motion, and of the springs of what touches [J]."""
    mass = np.array([[body.mass, body.mass, body.inertia] for body in bodies])
    free = np.array([not body.fixed for body in bodies])
    work = stage.work
    rows = np.arange(work.tally.candidates)
    overlap = np.maximum(-work.geometry[NOW, rows]["gap"], 0.0)
    slip = np.where(overlap > 0.0, work.slip[NOW, rows], 0.0)
    shear = contact.law.tangential_stiffness
    springs = contact.k_n * np.sum(overlap**2) + shear * np.sum(slip**2)
    return 0.5 * (np.sum(mass[free] * stage.velocity[free] ** 2) + springs)


@pytest.mark.parametrize(
    ("step", "friction"),
    rest_slow(
        product([1e-6, 1e-5], ["none", 0.0, 0.01, 0.4]),
        lambda step, friction: friction == ("none" if step == 1e-5 else 0.4),
    ),
)
def test_energy_never_grows_without_gravity(friction, step):
    """Whatever opens, closes, sticks or slides in a step."""
    bodies, contact = heap(3, speed=2e-3), Contact(friction=friction)
    stage = Stage(bodies, [contact])
    energy = [energy_of(stage, bodies, contact)]
    for _ in range(6):
        stage.step(step)
        energy.append(energy_of(stage, bodies, contact))
    assert np.all(np.diff(energy) <= 1e-9 * energy[0])
    assert energy[-1] < 0.95 * energy[0]


@pytest.mark.parametrize("friction", [0.1, 0.6])
def test_steps_of_a_heap_find_their_ends_with_friction(friction):
    """However long they are: pairs that are wedged between others are no obstacle."""
    for seed in range(3):
        for step in (1e-6, 1e-5, 1e-4):
            stage = Stage(heap(seed, 12, 1e-3), forces(friction=friction), WATER)
            assert stage.end(step)
