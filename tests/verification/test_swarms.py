"""Swarms against what is known of them: momentum, energy, encounters, the form of clusters."""

import math

import numpy as np
import pytest

from flocsim import Body, Sphere, Swarm
from flocsim.forces import Contact, Gravity, StokesDrag, VanDerWaals
from flocsim.integrators import Status
from flocsim.swarms.placement import place_at_random
from flocsim.swarms.together.clusters import Clusters
from tests.helpers.swarm_scenes import WATER, R, crowd, forces


def finished(swarm, until, **options):
    """The run of a swarm, which comes to its end."""
    run = swarm.run(until, **options)
    assert run.status == Status.FINISHED
    return run


def test_momentum_of_a_settling_swarm_is_weight_less_drag():
    """Stokes's drag is linear, so that its impulse is its resistance times the way."""
    bodies, side = crowd(30, 5)
    swarm = Swarm(bodies, forces(), fluid=WATER, box=(side, side))
    run = finished(swarm, 0.05, every=0.01)
    weight = sum(9.81 * body.buoyant_mass(WATER) for body in bodies)
    drag = np.array([6.0 * math.pi * WATER.viscosity * body.shape.radius for body in bodies])
    changes = np.array([run.momentum(k) for k in range(len(run.t))])
    changes -= changes[0]
    ways = run.position[:, :, :2] - run.position[0, :, :2]
    impulse = -np.einsum("n,knc->kc", drag, ways)
    impulse[:, 1] -= weight * run.t
    assert len(run.neighbours().pairs) > 2
    # Contacts alone leave 1e-15. Corrections of the last Newton step that turn a cluster keep its
    # momentum, and not its drag: what they leave moves the centre by a hundred-thousandth of the
    # tolerance at most.
    tolerance = swarm.integrator.tolerance
    assert np.abs(changes - impulse).max() < 1e-5 * tolerance * drag.sum()
    assert np.abs(changes - impulse).max() < 1e-9 * weight * run.t[-1]


def test_energy_never_grows_where_contacts_are_damped():
    bodies, side = crowd(30, 6, speed=5e-3)
    swarm = Swarm(bodies, [Contact()], box=(side, side))
    run = finished(swarm, 0.01, every=0.0005)
    mass = np.array([body.mass for body in bodies])
    inertia = np.array([body.inertia for body in bodies])
    factors = 0.5 * np.column_stack([mass, mass, inertia])
    energy = np.einsum("nc,knc->k", factors, run.velocity**2)
    # An overlap at one snapshot may hold what is kinetic at the next.
    assert np.diff(energy).max() < 1e-6 * energy[0]
    assert energy[-1] < 0.5 * energy[0]


def test_encounters_of_a_dilute_swarm_are_those_of_pairs():
    """Discs that settle past each other meet at the rate 2 (r_i + r_j)|w_i - w_j|/A a pair."""
    expected, found = 0.0, 0
    for seed in range(2):
        rng = np.random.default_rng(seed)
        radii = R * np.exp(0.4 * rng.normal(size=300))
        side = math.sqrt(np.sum(math.pi * radii**2) / 0.01)
        shapes = [Sphere(float(radius)) for radius in radii]
        places = place_at_random(shapes, (side, side), rng)
        excess = 2650.0 - WATER.density
        speed = 2.0 / 9.0 * excess * 9.81 * radii**2 / WATER.viscosity
        bodies = [
            Body(shape, (x, y), 0.0, (0.0, -down), density=2650.0)
            for shape, (x, y, _), down in zip(shapes, places.tolist(), speed.tolist(), strict=True)
        ]
        sticky = [Gravity(), StokesDrag(), VanDerWaals(1e-19, gap="surface", cut=1e-8), Contact()]
        until = 0.25
        run = finished(Swarm(bodies, sticky, fluid=WATER, box=(side, side)), until)
        i, j = np.triu_indices(len(radii), 1)
        width = 2.0 * (radii[i] + radii[j])
        expected += until * np.sum(width * np.abs(speed[i] - speed[j])) / side**2
        found += len(bodies) - len(run.clusters(within=1e-9))
    assert expected > 20.0
    # Clusters of two are met by others a little otherwise: 3 sigma of chance, and a tenth.
    assert abs(found - expected) < 3.0 * math.sqrt(expected) + 0.1 * expected


def turned(places, rng):
    """Places about their mean, turned at random."""
    angle = rng.uniform(0.0, 2.0 * math.pi)
    c, s = math.cos(angle), math.sin(angle)
    return (places - places.mean(axis=0)) @ np.array([[c, s], [-s, c]])


def encounter(a, b, rng):
    """Two clusters of unit discs, b having come onto a along a straight line of random offset."""
    a, b = turned(a, rng), turned(b, rng)
    reach = np.hypot(*a.T).max() + np.hypot(*b.T).max() + 2.0
    while True:
        offset = rng.uniform(-reach, reach)
        aside = (b[:, 1] + offset)[None, :] - a[:, 1][:, None]
        if np.any(np.abs(aside) < 2.0):
            break
    along = a[:, 0][:, None] - b[:, 0][None, :] + np.sqrt(np.maximum(4.0 - aside**2, 0.0))
    way = np.where(np.abs(aside) < 2.0, along, -np.inf).max()
    return np.concatenate([a, b + [way, offset]])


@pytest.mark.slow
def test_clusters_of_ballistic_encounters_have_their_fractal_dimension():
    """1.49 +- .03: equal clusters of sticking discs that meet on straight lines."""
    rng, levels, many = np.random.default_rng(3), 8, 60
    pool = [np.zeros((1, 2)) for _ in range(many * 2**levels)]
    sizes, gyrations = [], []
    for level in range(1, levels + 1):
        order = rng.permutation(len(pool))
        pairs = zip(order[::2], order[1::2], strict=True)
        pool = [encounter(pool[a], pool[b], rng) for a, b in pairs]
        if level < 2:
            continue
        found = clusters_of(pool[: 16 * many // 2**level + many // 2])
        assert set(found.size.tolist()) == {2**level}
        sizes.append(2**level)
        gyrations.append(0.5 * math.log(np.mean(found.gyration**2)))
    slope, _ = np.polyfit(np.log(sizes), gyrations, 1)
    assert abs(1.0 / slope - 1.49) < 0.03


def clusters_of(grown):
    """The Clusters that flocsim finds where these lie side by side, their discs of 1 um."""
    places, left = [], 0.0
    for each in grown:
        low, high = each.min(axis=0), each.max(axis=0)
        places.append(each - [low[0] - left, 0.0])
        left += high[0] - low[0] + 10.0
    places = 1e-6 * np.concatenate(places)
    disc = Sphere(1e-6)
    bodies = [Body(disc, (float(x), float(y)), density=2650.0) for x, y in places]
    swarm = Swarm(bodies, forces(), fluid=WATER)
    position = np.column_stack([places, np.zeros(len(places))])
    near = swarm.gauge().neighbours(position, 1e-12)
    return Clusters.of(swarm.bodies, position, np.zeros_like(position), near)
