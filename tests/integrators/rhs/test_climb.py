"""How much energy leads out of an interaction, against potentials that are known."""

import math

import numpy as np
import pytest

from flocsim.body import Body
from flocsim.forces import DoubleLayer, StokesDrag, VanDerWaals
from flocsim.geometry.shapes.shape import Sphere
from flocsim.integrators.rhs.climb import can_climb
from flocsim.system import System

RADIUS, HAMAKER, D_MIN = 1e-6, 1e-20, 1e-9
PULL = HAMAKER * 0.5 * RADIUS / (6.0 * D_MIN**2)
DEPTH = 2.0 * PULL * D_MIN
"""Of van der Waals attraction from touching on: H_A r*/(6 d_min), and the same up to d_min."""


def scene_of(*forces):
    bodies = [Body(Sphere(RADIUS), density=1050.0, position=(0.0, y)) for y in (0.0, 3e-6)]
    return System(bodies, [StokesDrag(), *forces]).scene(jit=False)


@pytest.mark.parametrize("gap", ["equivalent_spheres", "surface"])
@pytest.mark.parametrize(("place", "depth"), [(0.0, DEPTH), (-5e-9, DEPTH + 5e-9 * PULL),
                                              (1e-8, 0.1 * PULL * D_MIN)])  # fmt: skip
def test_the_climb_is_the_depth_of_the_potential(gap, place, depth):
    scene = scene_of(VanDerWaals(HAMAKER, D_MIN, gap))
    known = scene, None, 0.0, 1, 0, 2.0 * RADIUS + place, place, 0.0
    assert not can_climb(*known, 0.97 * depth)
    assert can_climb(*known, 1.03 * depth)


def test_a_load_helps_on_the_way_out():
    scene, load = scene_of(VanDerWaals(HAMAKER, D_MIN)), 0.01 * PULL
    # Attraction falls to the load at ten d_min.
    left = PULL * D_MIN * (1.0 + 0.9) - 10.0 * load * D_MIN
    known = scene, None, 0.0, 1, 0, 2.0 * RADIUS, 0.0, load
    assert not can_climb(*known, 0.97 * left)
    assert can_climb(*known, 1.03 * left)
    assert can_climb(scene, None, 0.0, 1, 0, 2.0 * RADIUS, 0.0, math.inf, 0.0)


def test_without_attraction_nothing_is_to_be_climbed():
    for forces in ((), (DoubleLayer(15e-3, 1e-8),)):
        assert can_climb(scene_of(*forces), None, 0.0, 1, 0, 2.0 * RADIUS, 0.0, 0.0, 1e-30)


def test_a_barrier_is_part_of_the_climb():
    """Out of the primary minimum over the repulsion, up to the highest place."""
    forces = VanDerWaals(HAMAKER, D_MIN), DoubleLayer(20e-3, 5e-9)
    scene, total = scene_of(*forces), 2.0 * RADIUS
    gaps = np.linspace(0.0, 3e-7, 300_001)
    pull = HAMAKER * 0.5 * RADIUS / (6.0 * np.maximum(gaps, D_MIN) ** 2)
    push = forces[1].strength * 0.5 * RADIUS * np.exp(-gaps / 5e-9)
    climbs = np.cumsum(pull - push) * (gaps[1] - gaps[0])
    highest = climbs.max()
    assert highest > 1.2 * climbs[-1], "there is a barrier"
    assert not can_climb(scene, None, 0.0, 1, 0, total, 0.0, 0.0, 0.95 * highest)
    assert can_climb(scene, None, 0.0, 1, 0, total, 0.0, 0.0, 1.05 * highest)
