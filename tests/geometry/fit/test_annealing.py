"""Annealing: what it finds is as good as it says, and never above its start."""

import numpy as np
import pytest

from flocsim.geometry.fit.coverage import running_sums
from flocsim.geometry.fit.global_search import (
    JUMPS,
    SLIDES,
    annealed,
    annealed_runs,
    proposed,
    put_into_edge,
    random_moves,
)
from flocsim.geometry.fit.search import even_start
from flocsim.geometry.fit.simple import is_open
from tests.geometry.fit.test_fit import blob, count_errors


@pytest.mark.parametrize("count", [3, 6, 20])
@pytest.mark.parametrize("radius", [1.0, 2.0])
def test_runs_lower_the_wrong_pixels(count, radius):
    mask = np.pad(blob(5), 12)
    start = even_start(mask, count, radius)
    kept = start.copy()
    before = count_errors(mask, start, radius)
    found = annealed_runs(running_sums(mask), [start], radius, int(mask.sum()))
    assert np.array_equal(start, kept)
    errors = [count_errors(mask, vertices, radius) for vertices in found]
    assert before > errors[0] >= errors[1]
    assert all(is_open(vertices, 2 * radius) for vertices in found)


def test_the_plain_kernel_does_as_the_compiled_one():
    mask = np.pad(blob(2), 10)
    start = even_start(mask, 7, 1.0)
    draws = random_moves()[0, :1500]
    sums, pixels = running_sums(mask), int(mask.sum())
    best = np.empty_like(start)
    least = annealed(sums, np.array(start), best, 1.0, pixels, draws, (0.5, 0.2), (2.0, 0.5))
    assert least + pixels == count_errors(mask, best, 1.0) < count_errors(mask, start, 1.0)
    assert is_open(best, 2.0)


def test_an_exact_polygon_is_left():
    mask = np.zeros((40, 40), bool)
    mask[10:30, 10:30] = True
    square = np.array([(10.2, 10.2), (28.8, 10.2), (28.8, 28.8), (10.2, 28.8)])
    assert count_errors(mask, square, 0.3) == 0
    found = annealed_runs(running_sums(mask), [square], 0.3, int(mask.sum()))
    assert [count_errors(mask, vertices, 0.3) for vertices in found] == [0, 0]


@pytest.mark.parametrize(("k", "edge"), [(0, 2), (0, 3), (5, 0), (3, 1), (2, 4), (4, 5), (1, 5)])
def test_a_vertex_goes_into_another_edge(k, edge):
    vertices = np.arange(12.0).reshape(6, 2)
    wanted = np.insert(vertices, edge + 1, (-1.0, -2.0), axis=0)
    wanted = np.delete(wanted, k + (k > edge), axis=0)
    place = put_into_edge(vertices, k, edge, -1.0, -2.0)
    assert np.array_equal(vertices, wanted)
    assert vertices[place].tolist() == [-1.0, -2.0]


def test_slides_keep_to_an_edge():
    vertices = np.array([(0.0, 0.0), (10.0, 0.0), (10.0, 8.0), (0.0, 8.0)])
    back = proposed(vertices, 0, 1, 2, 1.0, np.array([1.0, 0.0, 0, 0, JUMPS + 0.2 * SLIDES, 0]))
    assert back == pytest.approx((7.0, 0.0))
    on = proposed(vertices, 0, 1, 2, 1.0, np.array([1.0, 1.0, 0, 0, JUMPS + 0.8 * SLIDES, 0]))
    assert on == pytest.approx((9.9, 3.0))
    free = proposed(vertices, 0, 1, 2, 2.0, np.array([1.0, -1.0, 0, 0, 0.9, 0]))
    assert free == pytest.approx((12.0, -2.0))


def test_the_same_numbers_for_every_fit():
    assert random_moves() is random_moves()
    assert random_moves()[0, 0, :2] == pytest.approx((1.764052, 0.400157), abs=1e-6)
