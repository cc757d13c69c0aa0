"""Wrong pixels as a sum over edges, against counting them."""

import numpy as np
import pytest

from flocsim.geometry.fit.coverage import (
    BARRED,
    crossed_and_near,
    running_sums,
    set_bisectors,
    set_edge_sums,
)
from flocsim.geometry.fit.simple import is_open
from tests.geometry.fit.test_fit import blob

SIZE = 61


def polygon(rng, count, radius=16.0):
    """A star-shaped polygon with convex and reflex vertices, walked with itself on the right."""
    angles = 2 * np.pi * (np.arange(count) + rng.uniform(-0.3, 0.3, count)) / count
    reach = radius * rng.uniform(0.6, 1.0, count)
    around = np.column_stack([np.cos(angles), np.sin(angles)])
    return SIZE / 2 + reach[:, None] * around + rng.uniform(-1, 1, 2)


def sum_over_edges(sums, vertices, radius):
    count = len(vertices)
    out, edges = np.empty((count, 2)), np.empty(count, np.int64)
    set_bisectors(vertices, out, 0, count - 1)
    set_edge_sums(sums, radius, vertices, out, edges, 0, count - 1)
    return edges


def open_polygons(count, radius):
    rng = np.random.default_rng(count)
    for _ in range(60):
        vertices = polygon(rng, count)
        sums = running_sums(blob(int(rng.integers(9)), SIZE, 17.0))
        if is_open(vertices, 2 * radius) and sum_over_edges(sums, vertices, radius).max() < BARRED:
            yield vertices


@pytest.mark.parametrize("count", [3, 12])
@pytest.mark.parametrize("radius", [0.3, 2.5])
@pytest.mark.parametrize("outside", [0, 25])
def test_the_sum_is_the_count_of_pixels(count, radius, outside):
    tried = 0
    for seed, vertices in enumerate(open_polygons(count, radius)):
        mask = blob(seed, SIZE, 17.0)
        edges = sum_over_edges(running_sums(mask, outside), vertices, radius)
        cover = np.logical_or(*crossed_and_near(mask.shape, vertices, radius))
        missed, added = np.sum(mask & ~cover), np.sum(cover & ~mask)
        assert edges.sum() + mask.sum() == missed + (1 + 2 * outside) * added
        tried += 1
    assert tried >= 5


def test_slits_that_the_disk_would_close_are_barred():
    sums = running_sums(np.ones((SIZE, SIZE), bool))
    slit = np.array([(10, 10), (29.5, 10), (30, 30), (30.5, 10), (50, 10), (50, 50), (10, 50)])
    assert sum_over_edges(sums, slit.astype(float), 1.0).max() == BARRED


def test_arms_that_face_each_other_are_too_near_only_outside():
    bay = np.array([(10, 10), (28, 10), (28, 30), (32, 30), (32, 10), (50, 10), (50, 50), (10, 50)])
    bay = bay.astype(float)
    assert is_open(bay, 3.9)
    assert not is_open(bay, 4.1)
    arm = np.array([(10, 40), (28, 40), (28, 10), (32, 10), (32, 40), (50, 40), (50, 50), (10, 50)])
    assert is_open(arm.astype(float), 8.0)
