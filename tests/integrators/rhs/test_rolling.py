"""Tangential displacements from places: the integral of the tangential velocity, without drift."""

import math

import numpy as np
import pytest

import flocsim.arrays as at
from flocsim import Body, Sphere, SpheroPolygon
from flocsim.arrays import work_of
from flocsim.body import Fluid, scene_of
from flocsim.geometry.contact.candidates import list_candidates
from flocsim.geometry.contact.points import locate_contacts
from flocsim.integrators.rhs.friction import rolled, rolled_besides
from flocsim.integrators.rhs.views import tangential_rate

LATER = at.FIRST_STAGE
"""The state that places are compared in."""

SQUARE = SpheroPolygon(2e-6 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1.0]]), 5e-7)
KITE = SpheroPolygon(1e-6 * np.array([[-3, 0], [0, -1.5], [2, 0], [0, 2.0]]), 8e-7)


def placed(shapes, places):
    """Scene and work of two bodies at (x, y, angle), listed and located."""
    bodies = [Body(shape, density=2650.0) for shape in shapes]
    scene = scene_of(bodies, Fluid(), [])
    work = work_of(scene, np.array(places, dtype=float), np.zeros((2, 3)))
    assert list_candidates(scene, work)
    locate_contacts(scene, work, at.NOW)
    return scene, work


def gone(scene, work, places):
    """How far every listed pair has rolled when the bodies have got to other places."""
    work.motion[LATER, :, :3] = places
    locate_contacts(scene, work, LATER)
    rows = range(work.tally[at.CANDIDATES])
    besides = [0.5 * rolled_besides(scene, work, LATER, row) for row in rows]
    return np.array([rolled(scene, work, LATER, row) for row in rows]) + besides


def integral(scene, work, path, steps=4000):
    """∫ v_t dt of every listed pair along ``path(share)`` → places (2, 3), from 0 to 1."""
    total = np.zeros(work.tally[at.CANDIDATES])
    for step in range(steps):
        share = (step + 0.5) / steps
        by = 0.5 / steps
        work.motion[LATER, :, :3] = path(share)
        work.motion[LATER, :, 3:] = (path(share + by) - path(share - by)) / (2.0 * by)
        locate_contacts(scene, work, LATER)
        total += [tangential_rate(work, LATER, row) / steps for row in range(len(total))]
    return total


@pytest.mark.parametrize("angle", [1e-6, 0.3, -2.0, 3.0])
@pytest.mark.parametrize("shapes", [(Sphere(1e-6), Sphere(2e-6)), (SQUARE, KITE), (KITE, SQUARE)])
def test_a_doublet_that_turns_as_one_has_no_displacement(shapes, angle):
    places = np.array([[0.0, 0.0, 0.2], [3e-6, 2e-6, 1.0]])
    scene, work = placed(shapes, places)
    c, s = math.cos(angle), math.sin(angle)
    turned = places.copy()
    turned[:, :2] = places[:, :2] @ np.array([[c, s], [-s, c]]) + [1e-5, -4e-6]
    turned[:, 2] += angle
    assert np.abs(gone(scene, work, turned)).max(initial=0.0) < 1e-19


def test_a_vertex_that_slides_along_an_edge_has_gone_as_far_as_it_slid():
    scene, work = placed((SQUARE, Sphere(1e-6)), [[0.0, 0.0, 0.0], [0.0, 3.4e-6, 0.0]])
    found = gone(scene, work, np.array([[0.0, 0.0, 0.0], [7e-7, 3.4e-6, 0.0]]))
    closed = work.geometry[at.NOW, : len(found), at.GAP] < 0.0
    assert closed.sum() == 1
    assert abs(found[closed][0]) == pytest.approx(7e-7, rel=1e-12)


def test_a_ball_that_rolls_on_an_edge_without_slipping_has_none():
    scene, work = placed((SQUARE, Sphere(1e-6)), [[0.0, 0.0, 0.0], [0.0, 3.5e-6 - 1e-12, 0.0]])
    found = gone(scene, work, np.array([[0.0, 0.0, 0.0], [5e-7, 3.5e-6 - 1e-12, -0.5]]))
    closed = work.geometry[at.NOW, : len(found), at.GAP] < 0.0
    assert abs(found[closed][0]) < 1e-12


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("shapes", [(Sphere(1e-6), Sphere(2e-6)), (SQUARE, KITE)])
def test_it_is_the_integral_of_the_tangential_velocity(shapes, seed):
    """Where the gap changes, but for that change times the turn."""
    rng = np.random.default_rng(seed)
    start = np.array([[0.0, 0.0, rng.uniform(0.0, 6.0)], [0.0, 0.0, rng.uniform(0.0, 6.0)]])
    way = rng.uniform(0.0, 2.0 * math.pi)
    far = 1e-5
    for _ in range(120):  # up to the touch
        start[1, :2] = far * math.cos(way), far * math.sin(way)
        scene, work = placed(shapes, start)
        least = work.geometry[at.NOW, : work.tally[at.CANDIDATES], at.GAP].min(initial=1e-7)
        far -= least + 1e-10
    change = 1e-3 * rng.normal(size=(2, 3)) * [3e-7, 3e-7, 1.0]

    def path(share):
        return start + share * change

    scene, work = placed(shapes, start)
    expected = integral(scene, work, path, 400)
    found = gone(scene, work, path(1.0))
    g = work.geometry
    opened = np.abs(g[LATER, : len(found), at.GAP] - g[at.NOW, : len(found), at.GAP])
    allowed = opened * np.abs(change[:, 2]).sum() + 1e-6 * np.abs(expected)
    assert len(found) > 0 and np.all(np.abs(found - expected) < allowed)


@pytest.mark.parametrize("turn", [0.0, 0.7, -1.3])
def test_it_goes_on_around_a_corner(turn):
    """A ball carried along an edge and around its end, at one gap, turning meanwhile."""
    distance, straight, bent = 1.5e-6 - 1e-10, 3e-7, 0.6

    def path(share):
        way = share * (straight + distance * bent)
        angle = max(way - straight, 0.0) / distance
        x = 2e-6 - straight + min(way, straight) + distance * math.sin(angle)
        y = 2e-6 + distance * math.cos(angle)
        return np.array([[0.0, 0.0, 0.0], [x, y, 0.1 + turn * share]])

    scene, work = placed((SQUARE, Sphere(1e-6)), path(0.0))
    expected = integral(scene, work, path)
    found = gone(scene, work, path(1.0))
    rows = work.geometry[at.NOW, : len(found)]
    closed = (rows[:, at.GAP] < 0.0) & (rows[:, at.TURNING] == 0.0)
    assert closed.sum() == 1
    assert found[closed][0] == pytest.approx(expected[closed][0], rel=1e-3)
    # Way of the ball's centre, less what its disk rolls off.
    rolls = (1e-6 - 5e-11) * turn
    assert abs(found[closed][0]) == pytest.approx(abs(straight + distance * bent + rolls), rel=1e-6)
