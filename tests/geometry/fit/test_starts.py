"""The best split of an outline into segments, against trying all splits."""

import itertools

import numpy as np
import pytest

from flocsim.geometry.fit.starts import best_breaks, run_costs, split_corners


def total_cost(costs, breaks):
    """The cost of a closed split; runs longer than the table are not allowed."""
    size = len(costs)
    steps = [(b - a) % size or size for a, b in zip(breaks, (*breaks[1:], breaks[0]), strict=True)]
    if max(steps) >= costs.shape[1]:
        return np.inf
    return sum(costs[a, s] for a, s in zip(breaks, steps, strict=True))


@pytest.mark.parametrize("count", [2, 3, 4])
@pytest.mark.parametrize("start", [0, 5])
@pytest.mark.parametrize("longest", [6, 10])
def test_no_split_is_cheaper(count, start, longest):
    size = 11
    costs = np.random.default_rng(count).uniform(1, 2, (size, longest + 1))
    others = [k for k in range(size) if k != start]
    splits = (
        sorted((start, *rest), key=lambda k: (k - start) % size)
        for rest in itertools.combinations(others, count - 1)
    )
    least = min(total_cost(costs, split) for split in splits)
    if np.isfinite(least):
        found = best_breaks(costs, count, start).tolist()
        assert found[0] == start and total_cost(costs, found) == pytest.approx(least)


def test_runs_cost_what_their_line_leaves():
    points = np.random.default_rng(1).normal(size=(12, 2))
    costs = run_costs(points, 6)
    run = points[np.arange(9, 9 + 5) % 12]
    least = np.linalg.svd(run - run.mean(axis=0))[1][1] ** 2
    assert costs[9, 4] == pytest.approx(np.sqrt(5 * least))
    assert np.allclose(costs[:, :2], 0, atol=1e-6)


def outline_of(polygon, per_side):
    """Points evenly spaced along every side."""
    ends = np.roll(polygon, -1, axis=0)
    share = np.arange(per_side)[:, None] / per_side
    return np.concatenate([a + share * (b - a) for a, b in zip(polygon, ends, strict=True)])


@pytest.mark.parametrize("turn", [0.0, 0.4])
def test_the_corners_of_a_polygon_are_found(turn):
    polygon = np.array([(0, 0), (30, 2), (33, 25), (18, 12), (3, 27)], float)
    c, s = np.cos(turn), np.sin(turn)
    polygon = polygon @ np.array([(c, s), (-s, c)])
    found = split_corners(outline_of(polygon, 20), 5, 3, rounds=3)
    distance = np.hypot(*(polygon[:, None] - found[None]).transpose(2, 0, 1))
    assert distance.min(axis=1).max() < 1e-6
