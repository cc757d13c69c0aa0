"""Random sequential placement."""

import math
from itertools import combinations

import attrs
import numpy as np
import pytest

from flocsim import Body, Sphere, SpheroPolygon, System
from flocsim.errors import UsageError
from flocsim.forces import Contact, Gravity, StokesDrag
from flocsim.geometry.shapes.outline import core_gap
from flocsim.integrators import Status
from flocsim.swarms.placement import place_at_random, wall
from flocsim.swarms.swarm import Swarm
from tests.helpers.swarm_scenes import WATER, R
from tests.helpers.tiers import rest_slow

STAR = SpheroPolygon(
    np.array([
        (math.cos(k * math.pi / 5) * (1.0 if k % 2 == 0 else 0.45),
         math.sin(k * math.pi / 5) * (1.0 if k % 2 == 0 else 0.45))
        for k in range(10)
    ]), 0.05,
)  # fmt: skip


def gaps(shapes, places, area, repeats):
    """The gap between the outlines of every two bodies, over all images."""
    images = [
        (i * area[0], j * area[1])
        for i in ((-1, 0, 1) if repeats[0] else (0,))
        for j in ((-1, 0, 1) if repeats[1] else (0,))
    ]
    for i, j in combinations(range(len(shapes)), 2):
        [there] = shapes[j].placed_parts(*places[j])
        least = min(
            core_gap(*shapes[i].placed_parts(*(places[i] + (*image, 0.0))), there)
            for image in images
        )
        yield least - shapes[i].radius - shapes[j].radius


@pytest.mark.parametrize("repeats", [(True, True), (True, False), (False, False)])
@pytest.mark.parametrize("shape", [Sphere(1.0), STAR])
def test_bodies_keep_their_distance(shape, repeats):
    shapes = [shape.scaled(factor) for factor in np.linspace(0.5, 1.5, 25)]
    area = (17.0, 15.0)
    places = place_at_random(shapes, area, np.random.default_rng(1), repeats, gap=0.02)
    assert min(gaps(shapes, places, area, repeats)) >= 0.02 * (1.0 - 1e-9)
    assert np.all(places[:, :2] >= 0.0) and np.all(places[:, :2] <= area)
    for axis in range(2):
        if not repeats[axis]:
            reach = np.array([each.bounding_radius for each in shapes])
            assert np.all(places[:, axis] >= reach)
            assert np.all(places[:, axis] <= area[axis] - reach)


def test_places_are_spread_evenly():
    places = place_at_random([Sphere(1.0)] * 400, (200.0, 100.0), np.random.default_rng(3))
    counts, _, _ = np.histogram2d(*places[:, :2].T, bins=(4, 2), range=((0, 200), (0, 100)))
    assert np.all(np.abs(counts - 50.0) < 4.0 * math.sqrt(50.0))


def test_what_cannot_be_placed_is_said():
    side = math.sqrt(40 * math.pi / 0.6)
    with pytest.raises(UsageError, match=r"of 40 bodies were placed at random, on 0\.\d+ of"):
        place_at_random([Sphere(1.0)] * 40, (side, side), np.random.default_rng(4))
    with pytest.raises(UsageError, match="too small for bodies of up to 2 m"):
        place_at_random([Sphere(1.0)], (3.0, 100.0), np.random.default_rng(4))


THIN = 1e-5
DISC = 50e-6
LONG = 2e-3
STIFFNESS = 20.0


def laws():
    """Springs without friction: what holds a disc at rest is exact."""
    return [Gravity(), StokesDrag(), Contact(k_n=STIFFNESS, k_t=0.0)]


def pit(slope, apart, above=1e-7):
    """(two walls that rise from (∓apart, 0) at an angle, a disc just above both)."""
    walls = [
        wall(
            (sign * apart, 0.0),
            (sign * (apart + LONG * math.cos(slope)), LONG * math.sin(slope)),
            radius=THIN,
        )
        for sign in (1.0, -1.0)
    ]
    height = (DISC + THIN - apart * math.sin(slope)) / math.cos(slope) + above
    return walls, Body(Sphere(DISC), (0.0, height), density=2650.0)


def loads(bodies, position):
    """The overlap of the last body with each of the others, times k_n [N]; 0 where apart."""
    parts = [
        body.shape.placed_parts(*place)
        for body, place in zip(bodies, position.tolist(), strict=True)
    ]
    gaps = [core_gap(each[0], parts[-1][0]) - each[0].radius - DISC for each in parts[:-1]]
    return STIFFNESS * np.maximum(0.0, -np.array(gaps))


def run_of(together, bodies, until):
    """The run of a System or Swarm; that of a System is at its end before it were compiled."""
    options = {"jit": False} if together is System else {}
    return together(bodies, laws(), fluid=WATER).run(until, **options)


@pytest.mark.parametrize("together", [System, Swarm])
@pytest.mark.parametrize("extra", [0, 12])
@pytest.mark.parametrize(
    ("slope", "apart"),
    rest_slow([(45.0, 0.0), (45.0, -1e-4), (30.0, 5e-6)], lambda slope, apart: apart < 0.0),
)
def test_walls_that_meet_or_cross_share_a_weight_evenly(slope, apart, extra, together):
    """N = m g/(2 cos θ) on both, whether they meet in a corner or cross, and however many others
    cross them below."""
    walls, disc = pit(math.radians(slope), apart)
    below = [
        wall((-1e-3, -1e-5 * k - 2e-4), (1e-3, 1e-5 * k - 2e-4), radius=THIN) for k in range(extra)
    ]
    bodies = [*walls, *below, disc]
    run = run_of(together, bodies, 5.0)
    assert run.status == Status.FINISHED
    expected = 9.81 * disc.buoyant_mass(WATER) / (2.0 * math.cos(math.radians(slope)))
    found = loads(bodies, run.position[-1])
    assert found[:2] == pytest.approx(expected, rel=1e-4)
    assert not found[2:].any()


@pytest.mark.parametrize("count", rest_slow([5, 11, 40], lambda count: count == 5))
def test_a_rough_floor_of_discs_that_overlap_carries_as_its_two_next_ones_do(count):
    """A disc in the dip between two of them: N = m g/(2 cos α) from each, from no other."""
    step = 1.2 * R
    row = [
        Body(Sphere(R), (step * (k - count // 2), 0.0), density=2650.0, fixed=True)
        for k in range(count)
    ]
    height = math.sqrt((DISC + R) ** 2 - (0.5 * step) ** 2)
    disc = Body(Sphere(DISC), (0.5 * step, height + 1e-8), density=2650.0)
    for together in (System, Swarm):
        run = run_of(together, [*row, disc], 5.0)
        assert run.status == Status.FINISHED
        away = run.position[-1, :-1, :2] - run.position[-1, -1, :2]
        pushed = STIFFNESS * np.maximum(0.0, DISC + R - np.hypot(*away.T))
        weight = 9.81 * disc.buoyant_mass(WATER)
        lifted = pushed @ (-away[:, 1] / np.hypot(*away.T))
        assert lifted == pytest.approx(weight, rel=1e-4)
        two = pushed[[count // 2, count // 2 + 1]]
        if count == 5:
            assert two == pytest.approx(weight / 2.0 * (DISC + R) / height, rel=1e-3)


def test_overlaps_at_the_start_are_refused_of_free_bodies_alone():
    held = [Body(Sphere(R), (0.1 * R * k, 0.0), density=2650.0, fixed=True) for k in range(3)]
    far = Body(Sphere(R), (0.0, 5.0 * R), density=2650.0)
    inside = attrs.evolve(far, position=(0.2 * R, 0.5 * R))
    for together in (System, Swarm):
        assert run_of(together, [*held, far], 1e-6).status == Status.FINISHED
        with pytest.raises(UsageError, match=r"bodies \d and \d start"):
            run_of(together, [*held, inside], 1e-6)
    assert run_of(System, held, 1.0).status == Status.FINISHED
