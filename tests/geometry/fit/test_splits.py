"""Splits of an outline into edges: corners are found, and fewer pixels are wrong."""

import numpy as np
import pytest

from flocsim.geometry.fit.coverage import running_sums
from flocsim.geometry.fit.global_search import descend, split_outline
from flocsim.geometry.fit.search import DIRECTIONS, even_start, trace_outline
from flocsim.geometry.fit.simple import is_open
from tests.geometry.fit.test_fit import blob, count_errors


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
