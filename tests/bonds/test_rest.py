"""Hooks by statics: drawn cases with known answers, a linear program, the same seen otherwise."""

import math

import numpy as np
import pytest
from scipy.optimize import linprog

from flocsim import Sphere, SpheroPolygon
from flocsim.bonds import rest
from flocsim.bonds.certificate import is_closed, smaller_bounding_radius
from flocsim.forces import Contact
from flocsim.geometry.contact.points import contact_point
from tests.helpers.tiers import rest_slow
from tests.helpers.trial_scenes import star
from tests.helpers.two_bodies import ANCHOR, CHANNEL, TwoBodies, load, polygon

TOUCH = 1e-4
"""How far outlines overlap in the drawings [um], whose corners are rounded by .05 um."""
REACH = 0.1 - TOUCH
"""How far the cores of two outlines that touch lie apart in them."""

ELL = [(-5, 0), (-5, -1), (-0.2, -1), (-0.2, 0), (-4, 0), (-4, 8), (-5, 8)]
"""A foot that points to the right at the lower end of a bar."""
OVER = [(-4 - x, -y) for x, y in ELL]
"""The same upside down: its arm lies on the foot, its bar hangs down to the right."""


def drawn(points_i, points_j, shift=(0.0, 0.0), friction="none", **options):
    """TwoBodies of two drawings, the second one shifted [um]."""
    (shape_i, at_i), (shape_j, at_j) = polygon(points_i), polygon(points_j)
    places = [(*at_i, 0.0), (*(at_j + 1e-6 * np.array(shift)), 0.0)]
    return TwoBodies([shape_i, shape_j], places, [Contact(friction=friction)], **options)


def hooked(two, drift=(0.0, -1e-3)):
    return rest.is_hooked(two.scene, two.work, two.bond, load(1e-12, drift))


@pytest.mark.parametrize("fixed", [True, False])
@pytest.mark.parametrize("friction", ["none", 2.0, 0.0])
def test_an_ell_over_another_hooks_under_a_load_downwards(fixed, friction):
    """Of a free doublet the line of centres becomes the plumb: then it takes friction, too."""
    two = drawn(ELL, OVER, (0.0, REACH), friction, fixed=(fixed, False))
    assert any(is_closed(two.work, row) for row in range(two.work.tally.candidates))
    assert hooked(two) == (fixed or friction != 0.0)
    assert not hooked(two, (0.0, 1e-3))


def test_two_contacts_that_enclose_the_load_hook_without_friction():
    two = drawn(ANCHOR, CHANNEL, (0.0, REACH), 0.0)
    assert hooked(two)
    assert not hooked(two, (0.0, 1e-3)) and not hooked(two, (1e-3, 0.0))
    assert not hooked(two, (0.0, 0.0)), "pushed together they have play"
    # Only one lip touches.
    leaning = drawn(ANCHOR, [(x, y if (x, y) != (1, 1) else 1.3) for x, y in CHANNEL],
                    (0.0, REACH), 0.0)  # fmt: skip
    assert not hooked(leaning)


def test_a_key_in_its_lock_hooks_against_all_loads():
    lock = [(-4, -2), (4, -2), (4, 2 + REACH), (0.5 + REACH, 2 + REACH), (0.5 + REACH, 1 + REACH),
            (3 + REACH, 1 + REACH), (3 + REACH, -REACH), (-3 - REACH, -REACH),
            (-3 - REACH, 1 + REACH), (-0.5 - REACH, 1 + REACH), (-0.5 - REACH, 2 + REACH),
            (-4, 2 + REACH)]  # fmt: skip
    two = drawn(ANCHOR, lock, (0.0, 0.0), 0.0)
    for angle in np.linspace(0.0, 6.0, 7):
        assert hooked(two, (1e-3 * math.cos(angle), 1e-3 * math.sin(angle)))
    assert hooked(two, (0.0, 0.0))


@pytest.mark.parametrize("friction", ["none", 0.5])
def test_what_touches_side_by_side_does_not_hook(friction):
    square = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    corner = [(0, 0), (2, -2), (4, 0), (2, 2)]
    discs = [Sphere(1e-6), Sphere(2e-6)]
    side = TwoBodies(discs, [(0, 0, 0), (3e-6 - 1e-10, 0, 0)], [Contact(friction=friction)])
    flat = drawn(square, square, (2 + REACH, 0.0), friction)
    pointed = drawn(square, corner, (1 + REACH, 0.0), friction)
    for two in (side, flat, pointed):
        for angle in np.linspace(-1.4, 1.4, 9):
            assert not hooked(two, (1e-3 * math.cos(angle), 1e-3 * math.sin(angle)))
        assert not hooked(two, (0.0, 0.0))


def test_a_sphere_in_a_cup_is_carried_by_it():
    cup = [(-3, 4), (-3, -1), (3, -1), (3, 4), (2.5, 4), (0.0, -0.5), (-2.5, 4)]
    shape, place = polygon(cup)
    slope = math.atan2(4.5, 2.5)
    for x, carried in ((0.0, True), (0.3e-6, False)):
        lowest = (-0.5 + (1.0 + REACH - 0.05) / math.cos(slope)) * 1e-6
        places = [(*place, 0.0), (x, lowest + abs(x) * math.tan(slope), 0.0)]
        two = TwoBodies([shape, Sphere(1e-6)], places, [Contact(friction=0.0)], fixed=(True, False))
        assert hooked(two) == carried


def test_without_contact_or_contact_forces_nothing_hooks():
    assert not hooked(drawn(ANCHOR, CHANNEL, (0.0, -0.2)))
    (shape_i, at_i), (shape_j, at_j) = polygon(ANCHOR), polygon(CHANNEL)
    places = [(*at_i, 0.0), (*(at_j + [0.0, 1e-6 * REACH]), 0.0)]
    assert not hooked(TwoBodies([shape_i, shape_j], places, []))


def entangled(rng, friction):
    """Two stars that overlap a little at several points, at any place about each other."""
    shapes = [star(5, 6e-6, 2e-6, 0.3), star(6, 7e-6, 2e-6, 0.35)]
    while True:
        way, *turns = rng.uniform(0.0, 2.0 * math.pi, 3)
        apart = rng.uniform(4e-6, 15e-6)
        places = [(0.0, 0.0, turns[0]), (apart * math.cos(way), apart * math.sin(way), turns[1])]
        two = TwoBodies(shapes, places, [Contact(friction=friction)])
        gaps = [two.work.geometry[0, row].gap for row in range(two.work.tally.candidates)]
        if gaps and -2e-6 < min(gaps) < 0.0:
            return shapes, np.array(places), two


def by_linear_program(two, drift, grip):
    """Whether forces at the contacts balance every load, by scipy."""
    bond, work = two.bond, two.work
    size = smaller_bounding_radius(two.scene, 0, 1)
    pushes = []
    for row in range(work.tally.candidates):
        if not is_closed(work, row):
            continue
        n = np.array(rest.normal_on(work, bond, row))
        t = np.array([-n[1], n[0]])
        for aside in (-rest.LEVER_TOLERANCE * size, rest.LEVER_TOLERANCE * size):
            place = np.array(contact_point(work, row, 1)) + aside * t
            for along in (-grip, grip):
                force = n + along * t
                pushes.append([*force, (place[0] * force[1] - place[1] * force[0]) / size])
    line = np.array([bond.nx, bond.ny])
    askew = drift @ line
    across = drift - min(askew, 0.0) * line
    loads = [(line, 0.0), (across, 0.0), (across, 1.0)]
    loads += [(-line, 0.0)] if askew < 0.0 else []
    if not np.any(drift):
        side = np.array([-line[1], line[0]])
        loads = [
            (sign * f, arm) for f in (line, side) for arm in (0.0, 1.0) for sign in (-1.0, 1.0)
        ]
    for force, at_i in loads:
        arm = -at_i * bond.distance * line / size
        wrench = np.array([*force, arm[0] * force[1] - arm[1] * force[0]])
        found = linprog(np.ones(len(pushes)), A_eq=np.array(pushes).T, b_eq=-wrench)
        if found.status != 0:
            return False
    return True


@pytest.mark.parametrize("friction", rest_slow(["none", 0.3, 0.0], lambda mu: mu == 0.3))
def test_hooks_are_those_of_a_linear_program(friction):
    rng = np.random.default_rng(4)
    grip = {"none": rest.UNLIMITED_FRICTION, 0.0: rest.LEVER_TOLERANCE}.get(friction, friction)
    found = []
    for case in range(25):
        _, _, two = entangled(rng, friction)
        angle = rng.uniform(0.0, 2.0 * math.pi)
        drift = np.array([math.cos(angle), math.sin(angle)]) * (case % 5 > 0)
        found.append(hooked(two, 1e-3 * drift))
        assert found[-1] == by_linear_program(two, drift, grip)
    assert any(found) == (friction != 0.0) and not all(found)


def turned(places, drift, angle):
    c, s = math.cos(angle), math.sin(angle)
    matrix = np.array([[c, -s], [s, c]])
    moved = np.column_stack([places[:, :2] @ matrix.T, places[:, 2] + angle])
    return moved, matrix @ drift


@pytest.mark.parametrize("friction", rest_slow(["none", 0.3], lambda mu: mu == "none"))
def test_the_same_pair_seen_otherwise_hooks_alike(friction):
    rng, found = np.random.default_rng(11), []
    forces = [Contact(friction=friction)]
    for _ in range(12):
        shapes, places, two = entangled(rng, friction)
        angle = rng.uniform(0.0, 2.0 * math.pi)
        drift = 1e-3 * np.array([math.cos(angle), math.sin(angle)])
        found.append(hooked(two, drift))
        moved, along = turned(places, drift, 2.0)
        flip = np.array([-1.0, 1.0, -1.0])
        images = [SpheroPolygon(shape.vertices * [-1.0, 1.0], shape.radius) for shape in shapes]
        rolled = [SpheroPolygon(np.roll(shape.vertices, 3, axis=0), shape.radius)
                  for shape in shapes]  # fmt: skip
        others = (
            (TwoBodies(shapes, moved, forces), along),
            (TwoBodies(images, places * flip, forces), drift * [-1.0, 1.0]),
            (TwoBodies(shapes[::-1], places[::-1], forces), -drift),
            (TwoBodies(rolled, places, forces), drift),
        )
        assert [hooked(other, way) for other, way in others] == [found[-1]] * 4
    assert any(found) and not all(found)
