"""A 64-gon rolls on another like a circle on a circle: the tangential load survives hand-overs.

Two equal bodies turn against each other like gears, their centres held by springs across and
pressed together along y. The same torque T acts on both: one drives, the other brakes, and the
contact has to carry T/R from one to the other, whatever pairs it is made of at the time.
"""

from functools import cache

import attrs
import numpy as np
import pytest
from shapely import Polygon
from shapely.affinity import translate

from flocsim import Body, Sphere, SpheroPolygon, System
from flocsim.forces import BodyForce, Contact
from flocsim.integrators import Implicit, VelocityVerlet
from tests.helpers.tiers import rest_slow

OUTER, RADIUS, CORNERS = 10e-6, 1e-6, 64
PRESS, LOAD = 5e-8, 5e-8
K_N, K_T, HOLD = 20.0, 5.0, 20.0
PHASE = 0.4
SPIN, UNTIL, WINDOW = 600.0, 1.5e-3, 1e-6


@attrs.frozen
class Gears(BodyForce):
    """Presses the upper body down and the lower one up, holds both in x, loads both by a torque."""

    press: float = PRESS
    hold: float = HOLD
    damping: float = 1e-4
    torque: float = LOAD * OUTER

    @staticmethod
    def kernel(body, press, hold, damping, torque):
        down = -press if body.y > 0.0 else press
        return -hold * body.x - damping * body.vx, down, torque


def polygon(corners):
    """A regular polygon of the outer radius."""
    angles = 2.0 * np.pi * np.arange(corners) / corners
    core = (OUTER - RADIUS) * np.column_stack([np.cos(angles), np.sin(angles)])
    return SpheroPolygon(core, RADIUS)


def height(shape, angles):
    """Distance of the centroids [m] at which the upper body rests on the lower one."""
    cores = [Polygon(shape.placed_vertices(angle=angle)) for angle in angles]
    far = cores[0].distance(translate(cores[1], 0.0, 3.0 * OUTER)) - 2.0 * RADIUS
    return 3.0 * OUTER - far - PRESS / K_N


METHODS = {"verlet": VelocityVerlet(2e-8), "implicit": Implicit(tolerance=1e-12)}
by_method = pytest.mark.parametrize("method", rest_slow(METHODS, lambda name: name == "implicit"))


@cache
def rolled(corners, method):
    """The Trajectory of two polygons, or of two circles (0 corners)."""
    shape = polygon(corners) if corners else Sphere(OUTER)
    angles = 0.0, PHASE * 2.0 * np.pi / CORNERS
    apart = 0.5 * (height(shape, angles) if corners else 2.0 * OUTER - PRESS / K_N)
    bodies = [
        Body(shape, (side * LOAD / HOLD, -side * apart), angle, spin=side * SPIN,
             surface_density=2.0)
        for side, angle in zip((1.0, -1.0), angles, strict=True)
    ]  # fmt: skip
    motion = System(bodies, [Gears(), Contact(K_N, K_T)], METHODS[method]).run(UNTIL)
    assert motion.status.name == "FINISHED"
    return motion


def over_time(motion, values):
    """Values at even times, a microsecond apart."""
    return np.interp(np.arange(0.0, UNTIL, WINDOW), motion.t, values)


def slip_of(motion):
    """How far the outlines have slid on each other [m], counted from the angles."""
    angles = motion.position[:, 0, 2] + motion.position[:, 1, 2]
    return over_time(motion, OUTER * (angles - angles[0]))


def carried(motion):
    """The tangential force [N] between the bodies, as the springs across feel it."""
    return over_time(motion, 0.5 * HOLD * (motion.position[:, 0, 0] - motion.position[:, 1, 0]))


def mean_torques(motion):
    """The torque [N m] on the first body, its mean over each window of time."""
    inertia = 0.5 * 2.0 * np.pi * OUTER**4
    return inertia * np.diff(over_time(motion, motion.velocity[:, 0, 2])) / WINDOW


SETTLED = slice(200, None)
"""Windows after which the sudden load has died out."""


@by_method
def test_the_outlines_slide_no_further_than_circles(method):
    circles, polygons = rolled(0, method), rolled(CORNERS, method)
    elastic = LOAD / K_T
    assert slip_of(circles)[-1] == pytest.approx(elastic, rel=0.01)
    assert abs(polygons.position[-1, 0, 2]) > 6 * 2.0 * np.pi / CORNERS
    apart = np.abs(slip_of(polygons) - slip_of(circles))
    assert apart[SETTLED].max() < 0.05 * elastic


@by_method
def test_the_contact_carries_the_load_of_circles(method):
    circles, polygons = rolled(0, method), rolled(CORNERS, method)
    assert carried(circles)[SETTLED].mean() == pytest.approx(LOAD, rel=0.01)
    assert carried(polygons)[SETTLED].mean() == pytest.approx(LOAD, rel=0.01)


@by_method
def test_the_force_does_not_jump_where_pairs_hand_over(method):
    torques = mean_torques(rolled(CORNERS, method))
    assert np.abs(np.diff(torques))[SETTLED].max() < 0.1 * LOAD * OUTER
