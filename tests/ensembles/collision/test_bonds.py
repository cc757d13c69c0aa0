"""What the observer of a pair counts as bound, and as what: by pull and by trap, hooks, rest."""

import math

import numpy as np
import pytest

from flocsim import Sphere, SpheroPolygon
from flocsim.bonds.certificate import (
    CALM_SPEED,
    CERTIFICATE,
    HOOK,
    NO_BOND,
    REST,
    SAFETY,
    attraction_at,
    bond_between,
    energy_of,
    is_held,
)
from flocsim.bonds.rest import HANGING_COSINE, NESTED_DISTANCE, STABLE_POSE
from flocsim.ensembles.collision import outcomes
from flocsim.ensembles.collision.mechanisms import make_encounter
from flocsim.ensembles.collision.outcomes import BOUND, bond_of, load_on, start_rest, watch_pair
from flocsim.forces import VanDerWaals
from flocsim.geometry.contact.candidates import rebuild_list
from flocsim.geometry.contact.points import locate_contacts
from flocsim.integrators.events.first_event import set_modes
from flocsim.io.results.schema import BONDS
from flocsim.state.bodies import ANGLE
from flocsim.state.work import NOW, work_of
from tests.helpers.small_study import small_config
from tests.helpers.two_bodies import ANCHOR, CHANNEL, polygon

RADII = (16.41e-6, 23.02e-6)
NO_VOLTAGE = {"double_layer": {"potential": 0.0}}
NO_VOLTAGE_OR_PULL = {"forces": {"van_der_waals": {"hamaker": 0.0}, **NO_VOLTAGE}}


def hamaker(strength):
    """Forces with this Hamaker constant [J], nothing repelling."""
    return {"forces": {"van_der_waals": {"hamaker": strength}, **NO_VOLTAGE}}


class Doublet:
    """Two bodies of the paper's Type I that touch, seen by the observer uncompiled."""

    def __init__(self, folder, overrides=None, shapes=None, places=None):
        """Where the bodies are (2, 3), one below the other by default; they stand still."""
        self.shapes = shapes or [Sphere(radius) for radius in RADII]
        config = small_config(folder, overrides)
        self.encounter = make_encounter(config, self.shapes, 1e-3)
        self.scene = self.encounter.system.scene(jit=False)
        self.work = work_of(self.encounter.scene, *self.encounter.motion((0.0, 0.0), 0.0))
        self.observed = self.encounter.given.copy()
        self.observed[outcomes.COLLIDED] = 1.0
        if places is None:
            places = [(0.0, 0.0, 0.0), (0.0, 1e-9 - sum(RADII), 0.0)]
        self.place(*places)

    def place(self, *places):
        """Put the bodies somewhere, at rest."""
        self.work.place[NOW], self.work.velocity[NOW] = places, 0.0
        assert rebuild_list(self.scene, self.work)
        locate_contacts(self.scene, self.work, NOW)
        set_modes(self.scene, self.work)

    def move(self, vx=0.0, vy=0.0, spin=0.0):
        """Let the second body move so against the first."""
        self.work.velocity[NOW, 1] = vx, vy, spin

    @property
    def drift(self):
        return math.hypot(*self.encounter.drift)

    @property
    def load(self):
        """The greatest pull of settling on the bond [N]."""
        return self.observed[outcomes.LOAD]

    @property
    def between(self):
        """The two as proofs see them."""
        return bond_between(self.scene, self.work, 0.0, 0, 1)

    def attraction(self):
        return attraction_at(self.scene, self.work, 0.0, self.between, 0.0)[0]

    def bond(self, time=0.0):
        """The kind of bond now."""
        return bond_of(self.scene, self.work, self.observed, time)

    def rest(self, turns):
        """The kind of bond after so many rest times in this pose."""
        start_rest(self.scene, self.work, self.observed, 0.0)
        return self.bond(turns * self.observed[outcomes.REST_TIME])


def strength_for(folder, share):
    """A Hamaker constant [J] at which spheres in contact attract by this share of the load."""
    doublet = Doublet(folder, hamaker(1e-18))
    return 1e-18 * share * doublet.load / doublet.attraction()


@pytest.mark.parametrize("share", [0.5, 2.9, 3.1, 10.0])
def test_attraction_that_outweighs_three_times_the_load_is_a_certificate(tmp_path, share):
    doublet = Doublet(tmp_path, hamaker(strength_for(tmp_path, share)))
    assert doublet.attraction() == pytest.approx(share * doublet.load, rel=1e-6)
    assert doublet.bond() == (CERTIFICATE if share > SAFETY else NO_BOND)


def test_bodies_that_part_quickly_have_no_certificate(tmp_path):
    doublet = Doublet(tmp_path, hamaker(strength_for(tmp_path, 10.0)))
    doublet.move(vy=-1.1 * CALM_SPEED * doublet.drift)
    assert doublet.bond() == NO_BOND
    doublet.move(vy=-0.9 * CALM_SPEED * doublet.drift)
    assert doublet.bond() == CERTIFICATE


def test_a_doublet_that_spins_carries_its_centrifugal_load_too(tmp_path):
    doublet = Doublet(tmp_path, hamaker(strength_for(tmp_path, 4.0)))
    assert doublet.bond() == CERTIFICATE
    mass = np.prod([body.mass for body in doublet.encounter.system.bodies])
    mass /= sum(body.mass for body in doublet.encounter.system.bodies)
    # As a rigid body, so fast that it doubles the load.
    spin = math.sqrt(doublet.load / (mass * sum(RADII)))
    doublet.work.velocity[NOW, :, ANGLE] = spin
    doublet.move(vx=spin * sum(RADII), spin=spin)
    assert doublet.bond() == NO_BOND


def test_what_hangs_by_its_contacts_is_a_hook_as_soon_as_it_rests(tmp_path):
    """The lips of a channel on the feet of an anchor, as a doublet and upside down."""
    (anchor, above), (channel, below) = polygon(ANCHOR, 3e-6, 1e-7), polygon(CHANNEL, 6e-6, 1e-7)
    lifted = below[1] + 3e-6 - 6e-6 + 2e-7 - 1e-11
    places = [(above[0], above[1], 0.0), (below[0], lifted, 0.0)]
    doublet = Doublet(tmp_path, NO_VOLTAGE_OR_PULL, [anchor, channel], places)
    assert doublet.between.gap < 0.0
    assert doublet.rest(0.99) == NO_BOND
    assert doublet.rest(1.01) == HOOK


def square(half, radius=1e-6):
    """A square of this half width, rounded."""
    return SpheroPolygon([(-half, -half), (half, -half), (half, half), (-half, half)], radius)


@pytest.mark.parametrize(("tilt", "expected"), [(0.0, True), (0.2, False)])
def test_two_contacts_on_either_side_hold_against_prying(tmp_path, tilt, expected):
    """Faces that lie flat on each other cannot be pried open, a corner on a face can."""
    shapes = [square(14e-6), square(9e-6)]
    corner = 9e-6 * (math.cos(tilt) + math.sin(tilt))
    places = [(0.0, 0.0, 0.0), (0.0, 16e-6 - 1e-9 + corner, tilt)]
    doublet = Doublet(tmp_path, hamaker(1e-16), shapes, places)
    assert doublet.attraction() > 10.0 * SAFETY * doublet.load
    # By itself: at rest the bodies could not climb out of the attraction either.
    load = load_on(doublet.observed)
    assert is_held(doublet.scene, doublet.work, 0.0, doublet.between, load) == expected


def nested(folder, overrides, x=0.0, radius=18e-6):
    """A disc around the middle of a wide ring with a slit, a small one without touching it."""
    ways = np.linspace(0.2, 2.0 * math.pi - 0.2, 40)
    ring = np.array([np.cos(ways), np.sin(ways)]).T
    outer = SpheroPolygon(np.concatenate([30e-6 * ring, 28e-6 * ring[::-1]]), 1e-6)
    shapes = [outer, Sphere(radius)]
    return Doublet(folder, overrides, shapes, [(0.0, 0.0, 0.0), (x, 0.0, 0.0)])


def climb(doublet):
    """Work [J] against the attraction, less three loads, from here to where the equivalent spheres
    part: it is constant on the way."""
    (force,) = (each for each in doublet.encounter.system.forces if isinstance(each, VanDerWaals))
    outer = sum(shape.equivalent_radius for shape in doublet.shapes)
    radii = [shape.equivalent_radius for shape in doublet.shapes]
    pull = force.hamaker * (radii[0] * radii[1] / outer) / (6.0 * force.d_min**2)
    distance = math.hypot(*doublet.work.place[NOW, 1, :2])
    return (pull - SAFETY * doublet.load) * (outer - distance)


@pytest.mark.parametrize("share", [0.9, 1.1])
def test_a_body_with_less_energy_than_the_climb_is_trapped(tmp_path, share):
    """Nothing touches, and it moves: it could not get out all the same."""
    doublet = nested(tmp_path, hamaker(1e-16), x=2e-6)
    assert sum(shape.equivalent_radius for shape in doublet.shapes) > 2e-6
    masses = [body.mass for body in doublet.encounter.system.bodies]
    reduced = masses[0] * masses[1] / sum(masses)
    speed = math.sqrt(2.0 * share * climb(doublet) / (SAFETY * reduced))
    doublet.move(vx=speed * math.cos(1.0), vy=speed * math.sin(1.0))
    assert energy_of(doublet.scene, doublet.work, doublet.between) == pytest.approx(
        0.5 * reduced * speed**2
    )
    assert doublet.bond() == (NO_BOND if share > 1.0 else CERTIFICATE)


def test_attraction_weaker_than_the_load_is_no_trap(tmp_path):
    doublet = nested(tmp_path, hamaker(strength_for(tmp_path, 0.1)))
    assert doublet.bond() == NO_BOND


def test_spin_counts_as_energy_to_climb_out_with(tmp_path):
    doublet = nested(tmp_path, hamaker(1e-16), x=2e-6)
    inertia = doublet.encounter.system.bodies[1].inertia
    doublet.move(spin=math.sqrt(2.0 * 1.1 * climb(doublet) / (SAFETY * inertia)))
    assert doublet.bond() == NO_BOND


@pytest.mark.parametrize("share", [0.01, 2.9])
def test_spheres_that_rest_are_no_hook(tmp_path, share):
    """However weak attraction is: no shape holds a sphere."""
    doublet = Doublet(tmp_path, hamaker(strength_for(tmp_path, share)))
    assert doublet.rest(0.99) == NO_BOND
    assert doublet.rest(1.01) == REST
    assert BONDS[REST - 1] == "rest" and BONDS[HOOK - 1] == "hook"


def test_a_doublet_that_has_moved_begins_to_rest_anew(tmp_path):
    doublet = Doublet(tmp_path, hamaker(strength_for(tmp_path, 0.5)))
    rest = doublet.observed[outcomes.REST_TIME]
    start_rest(doublet.scene, doublet.work, doublet.observed, 0.0)
    (still, low), way = doublet.work.place[NOW].copy(), doublet.drift * rest
    doublet.place(still, low + [1.1 * STABLE_POSE * way, 0.0, 0.0])
    assert doublet.bond(1.1 * rest) == NO_BOND
    assert doublet.bond(2.0 * rest) == NO_BOND
    assert doublet.bond(2.2 * rest) == REST


def test_a_doublet_that_lies_askew_does_not_rest_for_good(tmp_path):
    """The load is at its worst where the faster body hangs straight below."""
    doublet = Doublet(tmp_path, hamaker(strength_for(tmp_path, 0.5)))
    way = math.acos(HANGING_COSINE)
    reach = sum(RADII) - 1e-9
    for turn, expected in ((1.1 * way, NO_BOND), (0.9 * way, REST), (math.pi, NO_BOND)):
        place = (reach * math.sin(turn), -reach * math.cos(turn), 0.0)
        doublet.place((0.0, 0.0, 0.0), place)
        assert doublet.rest(1000.0) == expected


def test_a_nest_is_bound_after_ten_rest_times(tmp_path):
    """Around the other's centre no load has a lever that could turn it to hang."""
    overrides = hamaker(strength_for(tmp_path, 0.01))
    doublet = nested(tmp_path, overrides, radius=23.4e-6)
    reach = sum(shape.equivalent_radius for shape in doublet.shapes)
    for x, turns, expected in (
        (0.98 * NESTED_DISTANCE * reach, 0.99 / NESTED_DISTANCE, False),
        (0.98 * NESTED_DISTANCE * reach, 1.01 / NESTED_DISTANCE, True),
        (1.1 * NESTED_DISTANCE * reach, 1.01 / NESTED_DISTANCE, False),
    ):
        # Away from the slit.
        doublet.place((0.0, 0.0, 0.0), (-x, 0.0, 0.0))
        assert doublet.between.gap < 0.0
        assert (doublet.rest(turns) != NO_BOND) == expected


def test_the_observer_keeps_the_kind_of_bond(tmp_path):
    doublet = Doublet(tmp_path, hamaker(strength_for(tmp_path, 10.0)))
    assert watch_pair(doublet.scene, doublet.work, doublet.observed, 0.0) == BOUND
    assert doublet.observed[outcomes.BOND] == CERTIFICATE
