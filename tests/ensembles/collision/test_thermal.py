"""What is concluded of a pair under thermal motion: the observer, uncompiled, at stated places."""

import math

import numpy as np
import pytest
from scipy.special import erfc, ive, kve

from flocsim import Sphere, SpheroPolygon
from flocsim.bonds.certificate import CERTIFICATE, NO_BOND, REST
from flocsim.bonds.escape import BARRIER
from flocsim.constants import BOLTZMANN
from flocsim.ensembles.collision import outcomes
from flocsim.ensembles.collision.attraction import GAPS, caged_between, speeds_of
from flocsim.ensembles.collision.mechanisms import make_encounter
from flocsim.ensembles.collision.outcomes import (
    BOUND,
    DEPARTED,
    HELD,
    MISSED,
    RETURN_SHARE,
    bond_of,
    return_bound,
    watch_pair,
)
from flocsim.errors import UsageError
from flocsim.forces import DoubleLayer, StokesDrag, VanDerWaals
from flocsim.geometry.contact.candidates import rebuild_list
from flocsim.geometry.contact.points import locate_contacts
from flocsim.integrators.events.first_event import set_modes
from flocsim.state.bodies import X
from flocsim.state.work import NOW, work_of
from tests.helpers.small_study import small_config

ENERGY = BOLTZMANN * 298.15
WARM = {"thermal": {"temperature": 298.15, "kick": "1 ms"}}
ALONE = {"van_der_waals": {"hamaker": 0.0}, "double_layer": {"potential": 0.0}}
BODIES = {"density": 1050.0}
ZONE = {"distance": "10 nm"}


class Pair:
    """Two bodies under thermal motion, put where a test wants them."""

    def __init__(self, folder, scene=None, forces=None, shapes=None, collided=0.0):
        """Spheres of 1 and 2 um unless ``shapes`` are given, without forces between them."""
        self.shapes = shapes or [Sphere(1e-6), Sphere(2e-6)]
        over = {"bodies": BODIES, "zone": ZONE, "fluid": {"buoyancy": True, "density": 1000.0},
                "forces": WARM | ALONE | (forces or {}), "scene": scene or {}}  # fmt: skip
        self.config = small_config(folder, over)
        meeting = self.config.scene.meeting
        self.encounter = make_encounter(self.config, self.shapes, 3.5e-6, meeting=meeting)
        self.scene = self.encounter.system.scene(jit=False)
        self.encounter.__dict__["scene"] = self.scene
        self.work = work_of(self.encounter.scene, *self.encounter.motion((0.0, 0.0), 0.0))
        self.observed = self.encounter.given.copy()
        self.observed[outcomes.COLLIDED] = collided
        self.total = sum(shape.radius for shape in self.shapes)

    def put(self, x, y, drifting=True):
        """j at (x, y) from i, going along with the drift or standing still."""
        self.work.place[NOW] = (0.0, 0.0, 0.0), (x, y, 0.0)
        self.work.velocity[NOW] = 0.0
        if drifting:
            xx, xy, yx, yy = self.encounter.system.fluid.gradient
            self.work.velocity[NOW, 1, :2] = xx * x + xy * y, yx * x + yy * y
            if self.encounter.meeting == "settling":
                self.work.velocity[NOW, 1, :2] = self.encounter.drift
        assert rebuild_list(self.scene, self.work)
        locate_contacts(self.scene, self.work, NOW)
        set_modes(self.scene, self.work)
        return self

    def seen(self):
        return watch_pair(self.scene, self.work, self.observed, 0.0)

    def bound(self):
        """The bound of the probability to come back."""
        return return_bound(self.scene, self.work, self.observed, 0.0)

    def bond(self, time=0.0):
        return bond_of(self.scene, self.work, self.observed, time)


def disc_return(speed, diffusion, touch, distance):
    """Probability to come back to a disc straight against a drift: the series of Bessel functions
    that solves D ∇²p + v ∂p/∂x = 0, p = 1 on the disc."""
    k = speed / (2.0 * diffusion)
    orders = np.arange(40)
    twice = np.where(orders > 0, 2.0, 1.0)
    terms = ive(orders, k * touch) / kve(orders, k * touch) * kve(orders, k * distance)
    # Scaled functions: I = ive e^(ka), K = kve e^(−ka); p = e^(−kr) Σ …
    return float(np.nansum(twice * terms) * math.exp(2.0 * k * (touch - distance)))


def test_a_settling_pair_has_parted_where_it_hardly_comes_back(tmp_path):
    pair = Pair(tmp_path)
    speed, diffusion = -pair.encounter.drift[1], pair.encounter.diffusion
    scale = diffusion / speed
    bounds = []
    for gap in np.array([3.0, 8.0, 15.0]) * scale + 2e-6:
        bounds.append(pair.put(0.0, -3e-6 - gap).bound())
        exact = disc_return(speed, diffusion, 3e-6, 3e-6 + gap)
        assert exact <= bounds[-1] <= 1.0
        assert bounds[-1] == pytest.approx(math.exp(-0.5 * gap / scale), rel=1e-6)
    assert bounds[-1] > RETURN_SHARE
    enough = -2.0 * math.log(RETURN_SHARE) * scale
    assert pair.put(0.0, -3e-6 - 0.99 * enough).seen() == 0
    assert pair.put(0.0, -3e-6 - 1.01 * enough).seen() == MISSED
    pair.observed[outcomes.COLLIDED] = 1.0
    assert pair.put(0.0, -3e-6 - 1.01 * enough).seen() == DEPARTED


def test_beside_or_above_nothing_has_parted_however_far(tmp_path):
    """Kicks may bring a pair together that the drift alone would let pass."""
    pair = Pair(tmp_path)
    assert pair.put(9e-6, 0.0).seen() == pair.put(1e-5, 5e-6).seen() == 0
    assert pair.put(0.0, 1e-3).bound() == 1.0


def test_attraction_slows_the_parting_down(tmp_path):
    pulled = Pair(tmp_path, forces={"van_der_waals": {"hamaker": "1e-17 J"}})
    free = Pair(tmp_path)
    place = 0.0, -3e-6 - 3e-5
    assert pulled.put(*place).bound() > free.put(*place).bound()


def test_in_an_extension_it_is_a_way_out_along_its_axis(tmp_path):
    pair = Pair(tmp_path, {"meeting": "extension", "rate": "0.5 1/s"})
    far, touch = 6e-6, pair.total
    wanted = pair.put(far, 0.0).bound()
    width = math.sqrt(0.5 / (2.0 * pair.encounter.diffusion))
    exact = erfc(width * far) / erfc(width * touch)
    assert exact < wanted < 1.0
    assert pair.put(0.0, 1e-3).bound() == 1.0, "it comes in along y"
    assert pair.put(1e-4, 0.0).seen() == pair.put(-1e-4, 1e-3).seen() == MISSED


BROWNIAN = {"meeting": "brownian", "delta": [0.0]}


def test_a_brownian_pair_has_missed_where_the_study_says_so(tmp_path):
    pair = Pair(tmp_path, BROWNIAN | {"release": 1.5, "escape": 3.0})
    assert pair.encounter.ends == pytest.approx((4.5e-6, 9e-6))
    # Kicks overshoot: an escape is seen before the end of a kick lies beyond it.
    assert pair.put(8.5e-6, 0.0).seen() == 0
    assert pair.put(0.0, -9.01e-6).seen() == MISSED
    pair.observed[outcomes.COLLIDED] = 1.0
    assert pair.put(6.4e-6, 6.4e-6).seen() == DEPARTED
    assert pair.observed[outcomes.LOAD] == 0.0


def test_a_brownian_pair_starts_in_any_direction(tmp_path):
    pair = Pair(tmp_path, BROWNIAN)
    for share in (0.0, 0.2, 0.7):
        start = np.hstack(pair.encounter.motion((1.0, 2.0), share))
        turn = 2.0 * math.pi * share
        assert start[1, :2] == pytest.approx([6e-6 * math.cos(turn), 6e-6 * math.sin(turn)])
        assert start[:, 2].tolist() == [1.0, 2.0]


def hamaker_of(depth):
    """The Hamaker constant [J] at which these spheres touch at so many k_B T."""
    return depth * ENERGY * 6.0 * 1e-9 / (2.0 * 2e-6 / 3.0)


@pytest.mark.parametrize("gap", ["equivalent_spheres", "surface"])
@pytest.mark.parametrize(("depth", "kind"), [(19.0, NO_BOND), (21.5, CERTIFICATE)])
def test_a_bond_takes_more_than_twenty_thermal_energies(tmp_path, gap, depth, kind):
    forces = {"van_der_waals": {"hamaker": hamaker_of(depth), "gap": gap}}
    pair = Pair(tmp_path, BROWNIAN, forces, collided=1.0).put(3e-6 - 1e-12, 0.0)
    assert pair.bond() == kind
    assert pair.seen() == (BOUND if kind == CERTIFICATE else 0)


def test_in_settling_the_load_is_taken_off(tmp_path):
    forces = {"van_der_waals": {"hamaker": hamaker_of(21.5)}}
    pair = Pair(tmp_path, {}, forces, collided=1.0).put(0.0, -3e-6 + 1e-12, drifting=False)
    pair.observed[outcomes.LOAD] = 0.0
    assert pair.bond() == CERTIFICATE
    pair.observed[outcomes.LOAD] = 1e-12
    assert pair.bond() == NO_BOND


def test_energy_is_taken_off_until_it_is_used_up(tmp_path):
    forces = {"van_der_waals": {"hamaker": hamaker_of(30.0)}}
    pair = Pair(tmp_path, BROWNIAN, forces, collided=1.0).put(3e-6 - 1e-12, 0.0)
    assert pair.bond() == CERTIFICATE
    i, j = pair.encounter.system.bodies
    mass = i.mass * j.mass / (i.mass + j.mass)
    for energies, kind in ((5.0, CERTIFICATE), (15.0, NO_BOND)):
        pair.work.velocity[NOW, 1, X] = math.sqrt(2.0 * energies * ENERGY / mass)
        assert pair.bond() == kind


def test_without_attraction_or_load_nothing_is_bound_however_long_it_rests(tmp_path):
    pair = Pair(tmp_path, BROWNIAN, collided=1.0).put(3e-6 - 1e-12, 0.0)
    assert pair.bond() == pair.bond(time=1e6) == NO_BOND


def square(half, radius):
    return SpheroPolygon([(-half, -half), (half, -half), (half, half), (-half, half)], radius)


@pytest.mark.parametrize(("temperature", "kind"), [(298.15, REST), (3e7, NO_BOND)])
def test_shapes_rest_where_kicks_cannot_lift_them_by_their_rounding(tmp_path, temperature, kind):
    shapes = [square(8e-6, 1e-6), square(14e-6, 1e-6)]
    warm = {"thermal": {"temperature": temperature, "kick": "1 ms"}}
    pair = Pair(tmp_path, {}, warm, shapes, collided=1.0).put(0.0, -24e-6 + 1e-12, drifting=False)
    load = pair.observed[outcomes.LOAD] * 1e-6 / (BOLTZMANN * temperature)
    assert (load > BARRIER) == (kind == REST)
    pair.bond()
    assert pair.bond(time=1.1 * pair.observed[outcomes.REST_TIME]) == kind


CAGING = {"van_der_waals": {"hamaker": "2e-19 J"},
          "double_layer": {"potential": "50 mV", "debye_length": "20 nm"}}  # fmt: skip


def test_a_secondary_minimum_holds_above_twenty_thermal_energies_on_either_side(tmp_path):
    pair = Pair(tmp_path, BROWNIAN, CAGING)
    low, high = pair.observed[outcomes.CAGE_LOW : outcomes.CAGE_HIGH + 1]
    assert 0.0 < low < high < 1e-6
    middle = math.sqrt(low * high)
    assert pair.put(3e-6 + middle, 0.0).seen() == HELD
    assert pair.put(3e-6 + 0.9 * low, 0.0).seen() == pair.put(3e-6 + 1.1 * high, 0.0).seen() == 0
    weak = CAGING | {"van_der_waals": {"hamaker": "5e-21 J"}}
    shallow = Pair(tmp_path, BROWNIAN, weak)
    assert shallow.observed[outcomes.CAGE_HIGH] == 0.0


def test_shapes_come_round_what_acts_between_their_centres(tmp_path):
    shapes = [square(1e-6, 2e-7), square(2e-6, 2e-7)]
    assert Pair(tmp_path, BROWNIAN, CAGING, shapes).encounter.cage == (0.0, 0.0)
    outlines = {name: each | {"gap": "surface"} for name, each in CAGING.items()}
    assert Pair(tmp_path, BROWNIAN, outlines, shapes).encounter.cage[1] > 0.0


def test_a_release_at_which_outlines_would_touch_is_refused(tmp_path):
    rod = SpheroPolygon([(-9e-6, 0.0), (9e-6, 0.0)], 5e-7)
    with pytest.raises(UsageError, match=r"scene.release = 2 \(r_i \+ r_j\) is too near: outlines"):
        Pair(tmp_path, BROWNIAN, shapes=[rod, rod])


FORCES = (VanDerWaals(2e-19), DoubleLayer(50e-3, 20e-9))
"""A secondary minimum of hundreds of k_B T behind a barrier."""


def test_a_cage_has_the_barrier_on_both_sides():
    radii, mobility = (5e-6, 5e-6), 1e7
    speeds = speeds_of((*FORCES, StokesDrag()), None, radii, mobility)
    potential = np.append(0.0, -np.cumsum(
        0.5 * (speeds[1, 1:] + speeds[1, :-1]) * np.diff(GAPS)
    )) / mobility  # fmt: skip
    place = int(np.argmin(np.where(GAPS > 2e-8, potential, np.inf)))
    depth = potential[-1] - potential[place]
    low, high = caged_between(speeds, mobility, 0.0, 0.5 * depth)
    assert low < GAPS[place] < high
    for end in (low, high):
        assert potential[-1] - potential[end == GAPS][0] >= 0.5 * depth
    assert caged_between(speeds, mobility, 0.0, 1.1 * depth) == (0.0, 0.0)


def test_a_load_may_open_a_cage():
    speeds = speeds_of((*FORCES, StokesDrag()), None, (5e-6, 5e-6), 1e7)
    strongest = -speeds[1][GAPS > 2e-8].min() / 1e7
    assert caged_between(speeds, 1e7, 0.0, 1e-20)[1] > 0.0
    assert caged_between(speeds, 1e7, 2.0 * strongest, 1e-20) == (0.0, 0.0)


def test_what_attracts_everywhere_is_no_cage():
    speeds = speeds_of((VanDerWaals(1e-18),), None, (5e-6, 5e-6), 1e7)
    assert caged_between(speeds, 1e7, 0.0, 1e-21) == (0.0, 0.0)
