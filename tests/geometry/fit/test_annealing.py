"""Annealing lowers the wrong pixels, and leaves an exact polygon alone."""

import numpy as np
import pytest

from flocsim.geometry.fit.coverage import running_sums
from flocsim.geometry.fit.global_search import (
    annealed_runs,
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


def test_an_exact_polygon_is_left():
    mask = np.zeros((40, 40), bool)
    mask[10:30, 10:30] = True
    square = np.array([(10.2, 10.2), (28.8, 10.2), (28.8, 28.8), (10.2, 28.8)])
    assert count_errors(mask, square, 0.3) == 0
    found = annealed_runs(running_sums(mask), [square], 0.3, int(mask.sum()))
    assert [count_errors(mask, vertices, 0.3) for vertices in found] == [0, 0]
