"""Certificates: attraction is judged on the way out of where the bodies are, wells above the touch
among them."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from flocsim import Sphere
from flocsim.bonds import certificate
from flocsim.bonds.certificate import (
    HOOK,
    NO_BOND,
    REST,
    SAFETY,
    capacity,
    is_certain,
    is_certain_in_kicks,
)
from flocsim.bonds.rest import NESTED_DISTANCE, is_hooked, kind_at_rest
from flocsim.constants import BOLTZMANN
from flocsim.forces import Contact, VanDerWaals
from tests.helpers.hydration import Hydration
from tests.helpers.trial_scenes import Spring
from tests.helpers.two_bodies import TwoBodies, load

RADII = (4e-6, 5e-6)
REDUCED = RADII[0] * RADII[1] / sum(RADII)

WHATEVER = (math.inf, math.inf, math.inf)
"""What is asked of a capacity that is to be found whole."""


def net_attraction(gap, hamaker, layer):
    """Of the two spheres [N]."""
    pull = hamaker * REDUCED / (6.0 * max(gap, 1e-9) ** 2)
    return pull - 2.0 * math.pi * layer.pressure * REDUCED * np.exp(-max(gap, 0.0) / layer.length)


def in_well(force, hamaker=4.7e-20, motion=None, layer=None):
    """(TwoBodies, the most that the well bears [N]): spheres hanging where it bears a force."""
    layer = layer or Hydration()
    gaps = np.linspace(1e-10, 2e-8, 40_000)
    pull = np.array([net_attraction(gap, hamaker, layer) for gap in gaps])
    top = int(np.argmax(pull))
    assert pull[0] < force < pull[top]
    known = hamaker, layer
    at = brentq(lambda gap: net_attraction(gap, *known) - force, 1e-10, gaps[top], xtol=1e-18)
    forces = [VanDerWaals(hamaker, gap="surface"), layer, Contact()]
    places = [(0.0, 0.0, 0.0), (0.0, -sum(RADII) - at, 0.0)]
    return TwoBodies([Sphere(r) for r in RADII], places, forces, motion), float(pull[top])


@pytest.mark.parametrize("share", [1e-3, 0.3, 0.36, 0.9])
def test_a_well_above_the_touch_is_judged_by_the_most_that_it_bears(share):
    _, most = in_well(1e-12)
    two, _ = in_well(share * most)
    pull = load(share * most)
    here = sum(certificate.attraction_at(two.scene, two.work, 0.0, two.bond, 0.0))
    assert two.bond.gap > 0.0 and here == pytest.approx(pull.force, rel=1e-3)
    assert capacity(two.scene, two.work, 0.0, two.bond, 0.0, WHATEVER)[0] == pytest.approx(
        most, rel=0.02
    )
    assert is_certain(two.scene, two.work, 0.0, two.bond, pull) == (share < 1.0 / SAFETY)
    # Whatever it bears, no shape holds a sphere: at most it rests, if it does so for long.
    assert not is_hooked(two.scene, two.work, two.bond, pull)
    known = two.scene, two.work, 0.0, two.bond, pull
    found = [kind_at_rest(*known, rested) for rested in (1.0, 1.0 / NESTED_DISTANCE)]
    assert found == [NO_BOND, REST]
    assert HOOK not in [kind_at_rest(*known, 1e9)]


@pytest.mark.parametrize(("speed", "held"), [(0.0, True), (0.9, True), (-0.9, True), (1.1, False)])
def test_only_what_is_calm_is_held_by_its_well(speed, held):
    motion = np.zeros((2, 3))
    motion[1, 1] = -speed * certificate.CALM_SPEED * 1e-3
    two, _ = in_well(1e-12, motion=motion)
    pull = load(1e-12)
    assert is_certain(two.scene, two.work, 0.0, two.bond, pull) == held


def test_who_is_on_the_way_out_of_a_well_is_not_held_by_it():
    """Behind the highest place of the well the force of now is all that is left."""
    layer, hamaker, force = Hydration(), 4.7e-20, 1e-12
    far = math.sqrt(hamaker * REDUCED / (6.0 * force))
    forces = [VanDerWaals(hamaker, gap="surface"), layer, Contact()]
    for share, held in ((0.5, True), (0.65, False), (1.1, False)):
        places = [(0.0, 0.0, 0.0), (0.0, -sum(RADII) - share * far, 0.0)]
        two = TwoBodies([Sphere(r) for r in RADII], places, forces)
        assert is_certain(two.scene, two.work, 0.0, two.bond, load(force)) == held


def test_capacity_is_the_largest_attraction_of_centres_and_outlines_together():
    """A spring between the centres that pulls from some distance on, and one that pushes."""
    two, _ = in_well(1e-12)
    only = capacity(two.scene, two.work, 0.0, two.bond, 0.0, WHATEVER)
    assert only[0] == only[1] and only[2] == 0.0
    forces = [VanDerWaals(4.7e-20, gap="surface"), Contact(), Spring(1e-3, 1e-6)]
    shapes, places = [Sphere(r) for r in RADII], [(0, 0, 0), (0, -sum(RADII), 0)]
    both = TwoBodies(shapes, places, forces)
    way = 2.0 * sum(RADII)
    total, follows, pries = capacity(both.scene, both.work, 0.0, both.bond, 2e-6, WHATEVER)
    assert 0.8 * 1e-3 * (way - 1e-6) < total <= 1e-3 * way
    assert pries == pytest.approx(1e-3 * 1e-6, rel=0.3)
    # Where the spring pushes, outlines have to hold against it.
    assert follows == pytest.approx(4.7e-20 * REDUCED / 6e-18 - 1e-9, rel=0.01)


@pytest.mark.parametrize(("depth", "held"), [(19.0, False), (21.0, True)])
def test_in_kicks_a_well_has_to_be_deep(depth, held):
    """Judged by its depth against 3 loads, and never by the force of now."""
    energy = BOLTZMANN * 298.15
    layer = Hydration(3e-3, 6e-10)
    gaps = np.linspace(5e-10, 2e-5, 2_000_000)

    def deep(hamaker):
        pull = hamaker * REDUCED / (6.0 * np.maximum(gaps, 1e-9) ** 2)
        pull -= 2.0 * math.pi * layer.pressure * REDUCED * np.exp(-gaps / layer.length)
        return np.sum(np.maximum(pull, 0.0)) * (gaps[1] - gaps[0])

    hamaker = brentq(lambda h: deep(h) - depth * energy, 1e-23, 1e-19, xtol=1e-30)
    two, _ = in_well(1e-16, hamaker, layer=layer)
    pull = load(1e-18, kicks=energy)
    assert is_certain_in_kicks(two.scene, two.work, 0.0, two.bond, pull) == held
