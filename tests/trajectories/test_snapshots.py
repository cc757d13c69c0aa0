"""Frames of a collision: which instants, and what they show."""

import numpy as np
import pytest

from flocsim import Sphere
from flocsim.ensembles.collision.draw import Record
from flocsim.ensembles.collision.start import draws
from flocsim.trajectories.frames import choose_instants, frames_of, travelled
from tests.helpers.rounding import to_rounding
from tests.helpers.small_study import small_study

TWO = (Sphere(2e-6), Sphere(1e-6))


def fall(count=101):
    """Times (k,) and positions (k, 2, 3): both sink, j twice as fast, from 10 um above i."""
    times = np.linspace(0.0, 1.0, count)
    position = np.zeros((count, 2, 3))
    position[:, 0, 1] = -10e-6 * times
    position[:, 1, 1] = 10e-6 - 17e-6 * times
    return times, position


@pytest.mark.parametrize("count", [2, 3, 6, 50])
def test_start_and_end_are_among_the_instants(count):
    times, position = fall()
    rows = choose_instants(times, position, 1e-6, count, np.nan)
    assert (rows[0], rows[-1], len(rows)) == (0, 100, count)


@pytest.mark.parametrize("collision", [0.013, 0.333, 0.5, 0.98])
def test_the_collision_is_among_the_instants(collision):
    times, position = fall(1001)
    rows = choose_instants(times, position, 1e-6, 6, collision)
    assert np.abs(times[rows] - collision).min() < 5e-4
    assert (rows[0], rows[-1]) == (0, 1000)


def test_evenly_along_the_way_not_in_time():
    times, position = fall(1001)
    position[:, 1, 1] = 10e-6 - 10e-6 * times - 7e-6 * times**4
    rows = choose_instants(times, position, 1e-6, 8, np.nan)
    np.testing.assert_allclose(np.diff(travelled(position, [1e-6, 1e-6])[rows]), 1e-6, rtol=0.05)


def test_a_motion_shorter_than_the_frames_asked_for():
    times, position = fall(3)
    assert choose_instants(times, position, 1e-6, 6, np.nan).tolist() == [0, 1, 2]


def test_frames_are_seen_from_the_receiver():
    times, position = fall()
    frames = frames_of(TWO, times, position, 1.0, 5)
    assert len(frames.outlines) == len(frames.contacts) == len(frames.times)
    for (receiver, approaching), distance in zip(
        frames.outlines, frames.centre_distance, strict=True
    ):
        np.testing.assert_allclose(receiver[0].mean(axis=0), 0.0, atol=1e-7)
        assert approaching[0][:, 1].min() == pytest.approx(distance - 1e-6, rel=1e-6)
    assert np.all(frames.paths[0] == 0.0)
    np.testing.assert_allclose(frames.paths[1][-1], [0.0, 3e-6], atol=1e-12)


def test_contacts_show_where_the_outlines_touch(tmp_path):
    study = small_study(tmp_path)
    record = Record()
    row = study.run(0, 16, 0.0, 0, record)
    times, position, _ = record.arrays()
    shapes = study.encounter(0, 16, draws(1, 0)).shapes
    frames = frames_of(shapes, times, position, row["t_collision"], 6)
    at = int(np.abs(frames.times - row["t_collision"]).argmin())
    assert frames.times[at] == row["t_collision"]
    # numpy's hypot in the frame, the compiled one in the row.
    assert frames.centre_distance[at] == to_rounding(row["d_c_collision"])
    assert all(len(points) == 0 for points in frames.contacts[:at])
    # Out of contact at the end: this pair departs.
    assert len(frames.contacts[-1]) == 0
    for points, outlines in zip(frames.contacts, frames.outlines, strict=True):
        for point in points:
            for rings in outlines:
                corners = np.concatenate(rings)
                reach = np.hypot(*(corners - point).T).min()
                assert reach < 20e-6
