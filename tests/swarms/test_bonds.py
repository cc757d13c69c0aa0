"""Kinds of bonds in a swarm: those of two are those of a pair, and loads are those of clusters."""

import math
import types

import numpy as np
import pytest

from flocsim import Body, Sphere, Swarm
from flocsim.bonds.certificate import CALM_SPEED, CERTIFICATE, HOOK, NO_BOND, REST
from flocsim.bonds.rest import REST_TURNS
from flocsim.constants import BOLTZMANN
from flocsim.ensembles.collision.mechanisms import make_encounter
from flocsim.ensembles.collision.outcomes import REST_TIME, bond_of, start_rest
from flocsim.forces import Contact, Gravity, StokesDrag, Thermal, VanDerWaals
from flocsim.geometry.contact.candidates import rebuild_list
from flocsim.geometry.contact.points import locate_contacts
from flocsim.geometry.shapes.outline import core_gap
from flocsim.integrators.events.first_event import set_modes
from flocsim.state.work import NOW, work_of
from flocsim.swarms.together.bonds import BondGauge, alone
from tests.helpers.hydration import Hydration
from tests.helpers.small_study import small_config
from tests.helpers.swarm_scenes import WATER, R
from tests.helpers.tiers import rest_slow
from tests.helpers.trial_scenes import star
from tests.helpers.two_bodies import ANCHOR, CHANNEL, polygon

SETTLING = [Gravity(), StokesDrag()]
NO_VOLTAGE = {"double_layer": {"potential": 0.0}}


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
    gauge.settling, gauge.resistance, gauge.aslant = alone(swarm)
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
    assert drift[0] == pytest.approx(speed[1] - speed[0], rel=1e-6)


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


def test_what_moves_has_no_certificate_and_what_never_attracts_none():
    bodies = chain([R, 1.7 * R, R])
    still = kinds(bodies, sticky(1e-20))
    assert still.kind.tolist() == [CERTIFICATE] * 2 and still.counts["certificate"] == 2
    parting = np.zeros((3, 3))
    parting[2, 0] = 1e-3
    assert kinds(bodies, sticky(1e-20), parting).kind.tolist() == [CERTIFICATE, NO_BOND]
    assert kinds(bodies, [*SETTLING, Contact()]).kind.tolist() == [NO_BOND] * 2
    assert repr(kinds(bodies[:1], sticky(1e-20))) == "Bonds(none)"


def test_rests_are_told_by_the_pose_before():
    """The whole doublet may have moved and turned; one whose parts have rolled does not rest, nor
    one that does not hang yet, nor one that has kept its pose for a short time."""
    discs = chain([R, 1.7 * R])
    hanging = [disc(body.shape.radius, 0.0, -body.position[0]) for body in discs]
    turn, c, s = 0.7, math.cos(0.7), math.sin(0.7)

    def moved(bodies):
        position = np.array([body.position for body in bodies])
        there = np.zeros((2, 6))
        there[:, :2] = position @ np.array([[c, s], [-s, c]]) + (3e-5, 2e-5)
        there[:, 2] = turn
        return there

    gauge, none = gauge_of(discs), [*SETTLING, Contact()]
    places = np.array([body.position for body in discs])
    load, drift, _ = BondGauge.loads(gauge, np.zeros(2, int), places, np.zeros(2, bool))
    long = 0.1 - 1.01 * REST_TURNS * 2.7 * R / drift[0]
    short = 0.1 - 0.99 * REST_TURNS * 2.7 * R / drift[0]
    # Twice as much as the load: enough to hold, too little for a certificate.
    twice = 2.0 * load[0] * 6.0 * 1e-9**2 / (1.7 / 2.7 * R)
    for acting, kind in ((sticky(twice), REST), (none, REST), (sticky(2.0 * twice), CERTIFICATE)):
        assert kinds(hanging, acting, before=(long, moved(hanging))).kind.tolist() == [kind]
    assert kinds(hanging, none, before=(short, moved(hanging))).kind.tolist() == [NO_BOND]
    assert kinds(discs, none, before=(long, moved(discs))).kind.tolist() == [NO_BOND]
    rolled = moved(hanging)
    rolled[1, 2] += 0.1
    assert kinds(hanging, none, before=(long, rolled)).kind.tolist() == [NO_BOND]


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


@pytest.mark.parametrize(("depth", "kind"), [(15.0, NO_BOND), (25.0, CERTIFICATE)])
def test_kicks_open_what_is_shallow(depth, kind):
    """Out of 15 k_B T kicks come, not out of 25; without kicks both hold."""
    hamaker = depth * ENERGY / depth_of(1.0)
    assert kinds(floating(), [*sticky(hamaker), KICKS]).kind.tolist() == [kind]


@pytest.mark.parametrize("temperature", [298.15, 3e8])
def test_hooks_hold_where_kicks_cannot_lift_them(temperature):
    """A channel that hangs on an anchor by its lips and has not moved."""
    (anchor, above), (channel, below) = polygon(ANCHOR), polygon(CHANNEL, 2e-6)
    place = below + [0.0, 1e-6 - 2e-6 + 1e-7 - 1e-12]
    bodies = [
        Body(anchor, tuple(above), density=2650.0),
        Body(channel, tuple(place), density=2650.0),
    ]
    acting = [*SETTLING, Contact(), Thermal(temperature, kick=1e-3)]
    position = np.array([[*body.position, 0.0] for body in bodies])
    before = (-1.0, np.hstack([position, np.zeros((2, 3))]))
    gauge = gauge_of(bodies)
    load, _, _ = BondGauge.loads(gauge, np.zeros(2, int), position[:, :2], np.zeros(2, bool))
    lifts = load[0] * 5e-8 >= 20.0 * BOLTZMANN * temperature
    assert lifts == (temperature < 1e3)
    found = kinds(bodies, acting, before=before)
    assert found.kind.tolist() == [HOOK if lifts else NO_BOND]


def touching_places(rng, shapes, depth=2e-10):
    """Places (2, 3) of two shapes that touch, the second one anywhere about the first."""
    way, *turns = rng.uniform(0.0, 2.0 * math.pi, 3)
    toward = np.array([math.cos(way), math.sin(way), 0.0])
    places = np.array([[0.0, 0.0, turns[0]], [0.0, 0.0, turns[1]]])
    apart = 1.1 * sum(shape.bounding_radius for shape in shapes)
    while True:
        places[1, :2] = apart * toward[:2]
        parts = [shape.placed_parts(*place)[0] for shape, place in zip(shapes, places, strict=True)]
        gap = core_gap(*parts) - sum(part.radius for part in parts)
        if gap < 1e-12:
            return places - np.array([[0.0], [depth]]) * toward
        apart -= gap


@pytest.mark.parametrize(
    "gap", rest_slow(["surface", "equivalent_spheres"], lambda gap: gap == "surface")
)
@pytest.mark.parametrize("ends", [(1, 1), (5, 7)], ids=["discs", "stars"])
def test_two_bodies_are_judged_as_a_pair_of_a_study_is(tmp_path, gap, ends):
    """At many places, speeds and strengths of attraction, by observer and by gauge."""
    rng, seen = np.random.default_rng(8), set()
    shapes = [star(n, size) if n > 1 else Sphere(size)
              for n, size in zip(ends, (9e-6, 12e-6), strict=True)]  # fmt: skip
    for hamaker in np.geomspace(1e-21, 1e-13, 9):
        law = {"hamaker": float(hamaker), "gap": gap}
        config = small_config(tmp_path, {"forces": {"van_der_waals": law, **NO_VOLTAGE}})
        encounter = make_encounter(config, shapes, 1e-3)
        scene, system = encounter.system.scene(jit=False), encounter.system
        swarm = Swarm(system.bodies, system.forces, fluid=system.fluid)
        gauge, measure = swarm.bond_gauge(), swarm.gauge()
        for case in range(6):
            places = touching_places(rng, shapes)
            motion = np.hstack([places, np.zeros((2, 3))])
            calm = CALM_SPEED * math.hypot(*encounter.drift)
            motion[1, 3:5] = (0.0, 0.5, 0.9, 1.1)[case % 4] * calm * rng.choice([-0.7, 0.7], 2)
            work, observed = work_of(scene, places, motion[:, 3:]), encounter.given.copy()
            assert rebuild_list(scene, work)
            locate_contacts(scene, work, NOW)
            set_modes(scene, work)
            start_rest(scene, work, observed, 0.0)
            time = 1.1 * observed[REST_TIME]
            known = bond_of(scene, work, observed, time)
            [kind] = gauge.bonds(time, motion, measure.neighbours(places), (0.0, motion)).kind
            assert kind == known
            seen.add(known)
    assert {NO_BOND, CERTIFICATE} <= seen


def test_a_pair_in_a_well_above_the_touch_is_bound_if_it_is_handed_over():
    """Two discs that a layer keeps 0.5 nm apart: near each other, though they do not touch."""
    acting = [*SETTLING, VanDerWaals(4.7e-20, gap="surface", cut=1e-7), Hydration(), Contact()]
    swarm = Swarm(chain([R, 1.7 * R], 5.3e-10), acting, fluid=WATER)
    position, velocity = swarm.system.motion()
    near = swarm.gauge().neighbours(position, 1e-8)
    assert len(near.pairs) == 1 and not len(swarm.gauge().neighbours(position).pairs)
    found = swarm.bond_gauge().bonds(0.0, np.hstack([position, velocity]), near)
    assert found.kind.tolist() == [CERTIFICATE]
