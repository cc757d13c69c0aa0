"""Tangential displacements from places: none where bodies turn as one or roll."""

import math

import numpy as np
import pytest

from flocsim import Body, Sphere, SpheroPolygon
from flocsim.body import Fluid, scene_of
from flocsim.geometry.contact.candidates import rebuild_list
from flocsim.geometry.contact.points import locate_contacts
from flocsim.integrators.rhs.friction import slip_of_motion, slip_rate_of_gap_change
from flocsim.state.work import FIRST_STAGE, NOW, work_of

LATER = FIRST_STAGE
"""The state that places are compared in."""

SQUARE = SpheroPolygon(2e-6 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1.0]]), 5e-7)
KITE = SpheroPolygon(1e-6 * np.array([[-3, 0], [0, -1.5], [2, 0], [0, 2.0]]), 8e-7)


def placed(shapes, places):
    """Scene and work of two bodies at (x, y, angle), listed and located."""
    bodies = [Body(shape, density=2650.0) for shape in shapes]
    scene = scene_of(bodies, Fluid())
    work = work_of(scene, np.array(places, dtype=float), np.zeros((2, 3)))
    assert rebuild_list(scene, work)
    locate_contacts(scene, work, NOW)
    return scene, work


def gone(scene, work, places):
    """How far every listed pair has rolled when the bodies have got to other places."""
    work.place[LATER] = places
    locate_contacts(scene, work, LATER)
    rows = range(work.tally.candidates)
    besides = [0.5 * slip_rate_of_gap_change(scene, work, LATER, row) for row in rows]
    return np.array([slip_of_motion(scene, work, LATER, row) for row in rows]) + besides


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
    closed = work.geometry[NOW, : len(found)]["gap"] < 0.0
    assert closed.sum() == 1
    assert abs(found[closed][0]) == pytest.approx(7e-7, rel=1e-12)


def test_a_ball_that_rolls_on_an_edge_without_slipping_has_none():
    scene, work = placed((SQUARE, Sphere(1e-6)), [[0.0, 0.0, 0.0], [0.0, 3.5e-6 - 1e-12, 0.0]])
    found = gone(scene, work, np.array([[0.0, 0.0, 0.0], [5e-7, 3.5e-6 - 1e-12, -0.5]]))
    closed = work.geometry[NOW, : len(found)]["gap"] < 0.0
    assert abs(found[closed][0]) < 1e-12
