"""The best ring of places, against trying all of them."""

import itertools

import numpy as np
import pytest

from flocsim.geometry.fit.coverage import BARRED, POSSIBLE, running_sums
from flocsim.geometry.fit.global_search import best_ring, descend, split_outline
from flocsim.geometry.fit.search import DIRECTIONS, even_start, trace_outline
from flocsim.geometry.fit.simple import is_open
from tests.geometry.fit.test_fit import blob, count_errors


def cost_of(costs, places, picks):
    size, longest = costs.shape[:2]
    total = 0
    for k in range(len(places)):
        to = (k + 1) % len(places)
        ahead = (places[to] - places[k]) % size or size
        if ahead > longest:
            return BARRED
        total += costs[places[k], ahead - 1, picks[k], picks[to]]
    return total


@pytest.mark.parametrize("count", [2, 3, 4])
@pytest.mark.parametrize("start", [0, 5])
@pytest.mark.parametrize("longest", [3, 6])
@pytest.mark.parametrize("choices", [1, 2])
def test_no_ring_is_cheaper(count, start, longest, choices):
    size, rng = 8, np.random.default_rng(count)
    costs = rng.integers(-20, 20, (size, longest, choices, choices))
    costs[rng.uniform(size=costs.shape) < 0.1] = BARRED
    others = [k for k in range(size) if k != start]
    rings = [
        sorted((start, *rest), key=lambda k: (k - start) % size)
        for rest in itertools.combinations(others, count - 1)
    ]
    least = min(
        cost_of(costs, ring, picks)
        for ring in rings
        for picks in itertools.product(range(choices), repeat=count)
    )
    places, picks = np.zeros(count, np.int64), np.zeros(count, np.int64)
    found = best_ring(costs, start, size, places, picks)
    if least >= POSSIBLE:
        assert found >= POSSIBLE
    else:
        assert found == least == cost_of(costs, places, picks)
        assert places[0] == start


@pytest.mark.parametrize("radius", [1.0, 2.0])
@pytest.mark.parametrize("count", [4, 9])
def test_all_vertices_move_to_where_fewer_pixels_are_wrong(count, radius):
    mask = np.pad(blob(3), 12)
    start = even_start(mask, count, radius)
    moved = np.array(start)
    descend(running_sums(mask), moved, radius, DIRECTIONS, np.array([2.0, 1.0]))
    assert is_open(moved, 2 * radius)
    assert count_errors(mask, moved, radius) < 0.8 * count_errors(mask, start, radius)


def test_a_split_of_a_polygon_finds_its_corners():
    mask = np.zeros((60, 60), bool)
    mask[10:50, 12:48] = True
    mask[10:30, 30:48] = False
    found = split_outline(running_sums(mask), trace_outline(mask), 6, 0.3)
    corners = [(12, 10), (30, 10), (30, 30), (48, 30), (48, 50), (12, 50)]
    distance = np.hypot(*(np.array(corners)[:, None] - found[None]).transpose(2, 0, 1))
    assert distance.min(axis=1).max() < 3.0
    assert count_errors(mask, found, 0.3) < 0.1 * mask.sum()


def test_no_split_into_more_edges_than_the_outline_has_points():
    mask = np.zeros((20, 20), bool)
    mask[9:11, 9:11] = True
    assert split_outline(running_sums(mask), trace_outline(mask), 8, 1.0) is None
