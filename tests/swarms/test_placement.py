"""Random sequential placement."""

import math
from itertools import combinations

import numpy as np
import pytest

from flocsim import Sphere, SpheroPolygon
from flocsim.errors import UsageError
from flocsim.geometry.shapes.cores import distance_between
from flocsim.swarms.placement import place_at_random

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
        here = shapes[i].placed_vertices(*places[i])
        there = shapes[j].placed_vertices(*places[j])
        least = min(distance_between(here + image, there) for image in images)
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


def test_stars_lie_nearer_than_their_circles():
    shapes = [STAR] * 40
    side = math.sqrt(40 * STAR.area / 0.33)
    places = place_at_random(shapes, (side, side), np.random.default_rng(2))
    apart = [np.hypot(*(a - b)[:2]) for a, b in combinations(places, 2)]
    assert min(apart) < 1.9 * STAR.bounding_radius


def test_places_are_spread_evenly():
    places = place_at_random([Sphere(1.0)] * 400, (200.0, 100.0), np.random.default_rng(3))
    counts, _, _ = np.histogram2d(*places[:, :2].T, bins=(4, 2), range=((0, 200), (0, 100)))
    assert np.all(np.abs(counts - 50.0) < 4.0 * math.sqrt(50.0))


def test_what_cannot_be_placed_is_said():
    side = math.sqrt(100 * math.pi / 0.6)
    with pytest.raises(UsageError, match=r"of 100 bodies, 0\.\d+ of the area, found a place"):
        place_at_random([Sphere(1.0)] * 100, (side, side), np.random.default_rng(4))
    with pytest.raises(UsageError, match="too little for bodies of up to 2 m"):
        place_at_random([Sphere(1.0)], (3.0, 100.0), np.random.default_rng(4))
