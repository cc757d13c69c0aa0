"""Kinds of bonds in a swarm: certificates are those of two bodies, hooks need no attraction."""

import math
import types

import numpy as np
import pytest

from flocsim import Body, Sphere, SpheroPolygon, Swarm, System
from flocsim.arrays import NOW, work_of
from flocsim.constants import BOLTZMANN
from flocsim.ensembles.collision import bonds as of_two
from flocsim.ensembles.collision.observed import DRIFT_X, DRIFT_Y, KICK_ENERGY, LOAD, OBSERVED_SIZE
from flocsim.ensembles.collision.thermal.kicked import bond_in_kicks
from flocsim.forces import Contact, Gravity, StokesDrag, Thermal, VanDerWaals
from flocsim.geometry.contact.candidates import list_candidates
from flocsim.geometry.contact.points import locate_contacts
from flocsim.integrators.events.modes import set_modes
from flocsim.swarms.together.bonds import CERTIFICATE, HOOK, REST, TOUCHING, BondGauge, alone
from tests.helpers.swarm_scenes import WATER, R

SETTLING = [Gravity(), StokesDrag()]
CUP = SpheroPolygon(
    3e-6 * np.array([(-2.0, 2.0), (-2.0, -1.0), (2.0, -1.0), (2.0, 2.0), (1.6, 2.0), (1.6, -0.6),
                     (-1.6, -0.6), (-1.6, 2.0)]), 0.3e-6,
)  # fmt: skip


def sticky(hamaker):
    return [*SETTLING, VanDerWaals(hamaker, gap="surface", cut=1e-7), Contact()]


def disc(radius, x, y=0.0, **options):
    return Body(Sphere(radius), (x, y), density=2650.0, **options)


def chain(radii, gap=-1e-10):
    """Discs in a row along x, each touching the next."""
    x, bodies = 0.0, []
    for k, radius in enumerate(radii):
        x += radius if k else 0.0
        bodies.append(disc(radius, x))
        x += radius + gap
    return bodies


def kinds(bodies, forces, velocity=None, before=None, **options):
    """The kinds of bonds of bodies where they are, of the touching pairs in their order."""
    swarm = Swarm(bodies, forces, fluid=WATER, **options)
    position, own = swarm.system.motion()
    motion = np.hstack([position, own if velocity is None else velocity])
    near = swarm.gauge().neighbours(position)
    return swarm.bond_gauge().bonds(0.1, motion, near, before)


def gauge_of(bodies):
    """What a BondGauge knows of bodies, with no code compiled."""
    swarm = Swarm(bodies, [*SETTLING, Contact()], fluid=WATER)
    gauge = types.SimpleNamespace()
    gauge.bodies, gauge.shear = swarm.bodies, 0.0
    gauge.settling, gauge.resistance = alone(swarm)
    return gauge


def test_the_load_of_two_is_that_of_a_doublet():
    bodies = chain([R, 1.7 * R])
    gauge = gauge_of(bodies)
    load, drift, extent = BondGauge.loads(
        gauge, np.zeros(2, int), np.array([[0.0, 0.0], [2.7 * R, 0.0]]), np.zeros(2, bool)
    )
    mobility = 1.0 / (6.0 * math.pi * WATER.viscosity * R * np.array([1.0, 1.7]))
    speed = 2.0 / 9.0 * (2650.0 - WATER.density) * 9.81 * (R * np.array([1.0, 1.7])) ** 2
    speed /= WATER.viscosity
    assert load[0] == pytest.approx((speed[1] - speed[0]) / mobility.sum(), rel=1e-6)
    assert extent[0] == pytest.approx(2.0 * (1.35 + 1.7) * R)
    assert 0.5 * (speed[1] - speed[0]) < drift[0] < speed[1] - speed[0]


def test_no_part_of_a_cluster_pulls_with_more():
    """All ways to part twelve bodies in two: the load is the largest pull, and is reached."""
    rng = np.random.default_rng(2)
    bodies = [disc(R * math.exp(0.5 * rng.normal()), 4.0 * R * k) for k in range(12)]
    gauge = gauge_of(bodies)
    places = np.array([body.position for body in bodies])
    load, _, _ = BondGauge.loads(gauge, np.zeros(12, int), places, np.zeros(12, bool))
    mean = gauge.resistance @ gauge.settling / gauge.resistance.sum()
    pull = gauge.resistance[:, None] * (gauge.settling - mean)
    parts = (np.arange(2**12)[:, None] >> np.arange(12)) & 1
    most = np.hypot(*(parts @ pull).T).max()
    assert load[0] == pytest.approx(most, rel=1e-9)
    # On a wall it is all the weight.
    rests, _, _ = BondGauge.loads(gauge, np.zeros(12, int), places, np.eye(12, dtype=bool)[3])
    weight = sum(9.81 * body.buoyant_mass(WATER) for body in bodies)
    assert rests[0] == pytest.approx(weight, rel=1e-6)


@pytest.mark.parametrize("hamaker", [1e-24, 3e-24, 1e-23, 1e-22, 1e-20])
def test_certificates_of_two_discs_are_those_of_a_pair(hamaker):
    """The same bodies, at rest against each other, asked in both ways."""
    bodies = chain([R, 1.7 * R])
    system = System(bodies, sticky(hamaker), fluid=WATER)
    scene = system.scene(jit=False)
    position, velocity = system.motion()
    work = work_of(scene, position, velocity)
    assert list_candidates(scene, work)
    locate_contacts(scene, work, NOW)
    gauge = gauge_of(bodies)
    observed = np.zeros(OBSERVED_SIZE)
    observed[[DRIFT_X, DRIFT_Y]] = gauge.settling[1] - gauge.settling[0]
    observed[LOAD] = np.hypot(*observed[[DRIFT_X, DRIFT_Y]]) / np.sum(1.0 / gauge.resistance)
    held = of_two.is_held(scene, work, observed, 0.0, 1.0, 0.0, 2.7 * R)
    [kind] = kinds(bodies, sticky(hamaker)).kind
    assert (kind == CERTIFICATE) == held
    known = {1e-24: False, 1e-20: True}
    assert held == known.get(hamaker, held)


def test_what_moves_has_no_certificate_and_what_never_attracts_none():
    bodies = chain([R, 1.7 * R, R])
    still = kinds(bodies, sticky(1e-20))
    assert still.kind.tolist() == [CERTIFICATE] * 2 and still.counts["certificate"] == 2
    parting = np.zeros((3, 3))
    parting[2, 0] = 1e-3
    assert kinds(bodies, sticky(1e-20), parting).kind.tolist() == [CERTIFICATE, TOUCHING]
    assert kinds(bodies, [*SETTLING, Contact()]).kind.tolist() == [TOUCHING] * 2
    assert repr(kinds(bodies[:1], sticky(1e-20))) == "Bonds(none)"


def test_rest_and_hook_are_told_by_the_pose_before():
    """The whole cluster may have moved and turned; one whose parts have rolled does not rest."""
    bodies = chain([R, 1.7 * R])
    position = np.array([[*body.position, 0.0] for body in bodies])
    turn, c, s = 0.7, math.cos(0.7), math.sin(0.7)
    there = np.zeros((2, 6))
    there[:, :2] = position[:, :2] @ np.array([[c, s], [-s, c]]) + (3e-5, 2e-5)
    there[:, 2] = turn
    gauge, none = gauge_of(bodies), [*SETTLING, Contact()]
    load, _, _ = BondGauge.loads(gauge, np.zeros(2, int), position[:, :2], np.zeros(2, bool))
    # Twice as much as the load: enough to hold, too little for a certificate.
    twice = 2.0 * load[0] * 6.0 * 1e-9**2 / (1.7 / 2.7 * R)
    assert kinds(bodies, sticky(twice), before=(0.05, there)).kind.tolist() == [REST]
    assert kinds(bodies, sticky(2.0 * twice), before=(0.05, there)).kind.tolist() == [CERTIFICATE]
    assert kinds(bodies, none, before=(0.05, there)).kind.tolist() == [HOOK]
    there[1, 2] += 0.1
    assert kinds(bodies, none, before=(0.05, there)).kind.tolist() == [TOUCHING]


def test_walls_are_no_bonds():
    bodies = [*chain([R, R]), disc(R, -2.0 * R + 1e-10, fixed=True)]
    found = kinds(bodies, sticky(1e-20))
    assert found.pairs.tolist() == [[1, 0]]
    # What lies on a wall carries all the weight.
    assert found.kind.tolist() == [CERTIFICATE]


KICKS = Thermal(kick=1e-3)
ENERGY = BOLTZMANN * 298.15


def depth_of(hamaker, radii=(R, 1.7 * R), least=1e-9):
    """How deep van der Waals attraction is where outlines touch [J]: as much as far as d_min, where
    it is capped, as beyond."""
    return hamaker * radii[0] * radii[1] / (radii[0] + radii[1]) / (3.0 * least)


def floating():
    """Discs of the density of water, so that nothing loads their bond, which is hardly pressed."""
    return [
        Body(body.shape, body.position, density=WATER.density)
        for body in chain([R, 1.7 * R], -1e-12)
    ]


@pytest.mark.parametrize(("depth", "kind"), [(15.0, TOUCHING), (25.0, CERTIFICATE)])
def test_kicks_open_what_is_shallow(depth, kind):
    """Out of 15 k_B T kicks come, not out of 25; without kicks both hold."""
    hamaker = depth * ENERGY / depth_of(1.0)
    assert kinds(floating(), [*sticky(hamaker), KICKS]).kind.tolist() == [kind]


def test_what_moves_fast_is_not_held_against_kicks():
    hamaker = 25.0 * ENERGY / depth_of(1.0)
    bodies = floating()
    mass = bodies[0].mass * bodies[1].mass / (bodies[0].mass + bodies[1].mass)
    flying = np.zeros((2, 3))
    for energy, kind in ((4.0, CERTIFICATE), (6.0, TOUCHING)):
        flying[1, 0] = math.sqrt(2.0 * energy * ENERGY / mass)
        assert kinds(bodies, [*sticky(hamaker), KICKS], flying).kind.tolist() == [kind]


@pytest.mark.parametrize("hamaker", [1e-23, 1e-22, 3e-22, 1e-21, 1e-20])
def test_certificates_of_two_discs_in_kicks_are_those_of_a_pair(hamaker):
    bodies, acting = chain([R, 1.7 * R]), [*sticky(hamaker), KICKS]
    scene = System(bodies, acting, fluid=WATER).scene(jit=False)
    position, velocity = System(bodies, acting, fluid=WATER).motion()
    work = work_of(scene, position, velocity)
    assert list_candidates(scene, work)
    locate_contacts(scene, work, NOW)
    set_modes(scene, work)
    gauge = gauge_of(bodies)
    observed = np.zeros(OBSERVED_SIZE)
    observed[[DRIFT_X, DRIFT_Y]] = gauge.settling[1] - gauge.settling[0]
    observed[LOAD] = np.hypot(*observed[[DRIFT_X, DRIFT_Y]]) / np.sum(1.0 / gauge.resistance)
    observed[KICK_ENERGY] = ENERGY
    held = bond_in_kicks(scene, work, observed, 0.0, -1e-10, 1.0, 0.0, 2.7 * R - 1e-10)
    [kind] = kinds(bodies, acting).kind
    assert (kind == CERTIFICATE) == (held == of_two.CERTIFICATE)
    known = {1e-23: False, 1e-20: True}
    assert (kind == CERTIFICATE) == known.get(hamaker, kind == CERTIFICATE)


CUPS = 0.3e-6
"""The spheroradius of CUP, by which its hooks have to be lifted."""


@pytest.mark.parametrize("temperature", [298.15, 3e8])
def test_hooks_hold_where_kicks_cannot_lift_them(temperature):
    """Two cups that lie in each other and have not moved."""
    bodies = [Body(CUP, (0.0, 0.0), density=2650.0), Body(CUP, (0.0, -3.59e-6), density=5000.0)]
    acting = [*SETTLING, Contact(), Thermal(temperature, kick=1e-3)]
    position = np.array([[*body.position, 0.0] for body in bodies])
    before = (0.05, np.hstack([position, np.zeros((2, 3))]))
    gauge = gauge_of(bodies)
    load, _, _ = BondGauge.loads(gauge, np.zeros(2, int), position[:, :2], np.zeros(2, bool))
    lifts = load[0] * CUPS >= 20.0 * BOLTZMANN * temperature
    assert lifts == (temperature < 1e3)
    found = kinds(bodies, acting, before=before)
    assert found.kind.tolist() == [HOOK if lifts else TOUCHING]
