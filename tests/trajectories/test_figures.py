"""Frames: the way along which they are taken, and what is seen in them."""

import numpy as np
import pytest

from flocsim import Sphere
from flocsim.trajectories.figures import frames_at, travelled


def fall(count=101):
    """Times (k,) and positions (k, 3, 3): two sink, the second past the first; the third stays."""
    times = np.linspace(0.0, 1.0, count)
    position = np.zeros((count, 3, 3))
    position[:, 0, 1] = -10e-6 * times
    position[:, 1, 1] = 10e-6 - 17e-6 * times
    position[:, 2, 0] = 50e-6
    return times, position


def test_the_way_is_that_against_the_first_with_its_turns():
    times, position = fall()
    pair = position[:, :2].copy()
    assert travelled(pair, [1e-6, 1e-6])[-1] == pytest.approx(7e-6)
    pair[:, 0, 2] = 3.0 * times
    way = travelled(pair, [1e-6, 1e-6])
    assert way[-1] == pytest.approx(10e-6)
    assert way[0] == 0.0
    assert np.all(np.diff(way) > 0.0)
    assert travelled(position, [1e-6] * 3)[-1] == pytest.approx(17e-6)
    assert travelled(position[:, :1], [1e-6])[-1] == pytest.approx(10e-6)


def test_frames_are_seen_from_the_first_with_every_contact():
    times, position = fall()
    position[:, 2, :2] = position[:, 0, :2] + [1.5e-6, 0.0]
    shapes = [Sphere(1e-6), Sphere(1e-6), Sphere(1e-6)]
    found = frames_at(shapes, times[[0, 100]], position[[0, 100]], position)
    assert found.times.tolist() == [0.0, 1.0]
    np.testing.assert_allclose(found.centre_distance, [10e-6, 3e-6])
    np.testing.assert_allclose(found.contacts[0], [[0.75e-6, 0.0]] * 2, atol=1e-20)
    assert np.abs(found.paths[0]).max() == 0.0
    np.testing.assert_allclose(found.outlines[1][0][0].mean(axis=0), 0.0, atol=1e-7)
    alone = frames_at(shapes[:1], times[[100]], position[[100], :1], position[:, :1])
    assert alone.centre_distance.tolist() == [0.0]
    np.testing.assert_allclose(alone.paths[0][-1], [0.0, -10e-6])
    assert alone.contacts[0].shape == (0, 2)
