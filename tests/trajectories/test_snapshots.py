"""Frames of a collision: which instants, and what they show."""

import numpy as np
import pytest

from flocsim.ensembles.pairs.opened import replicate_of
from flocsim.trajectories.figures import frames_of, instants_along, travelled
from tests.helpers.rounding import to_rounding
from tests.helpers.small_study import small_study


def fall(count=101):
    """Times (k,) and positions (k, 2, 3): both sink, j twice as fast, from 10 um above i."""
    times = np.linspace(0.0, 1.0, count)
    position = np.zeros((count, 2, 3))
    position[:, 0, 1] = -10e-6 * times
    position[:, 1, 1] = 10e-6 - 17e-6 * times
    return times, position


SIZES = (1e-6, 1e-6)


@pytest.mark.parametrize("collision", [0.0131, 0.333, 0.5, 0.98])
def test_the_collision_is_among_the_instants(collision):
    times, position = fall(1001)
    found = instants_along(times, position, SIZES, 6, collision)
    assert collision in found and len(found) == 6
    assert (found[0], found[-1]) == (times[0], times[-1])


def test_evenly_along_the_way_not_in_time():
    times, position = fall(1001)
    position[:, 1, 1] = 10e-6 - 10e-6 * times - 7e-6 * times**4
    found = instants_along(times, position, SIZES, 8)
    way = np.interp(found, times, travelled(position, SIZES))
    np.testing.assert_allclose(np.diff(way), 1e-6, rtol=1e-6)


def test_what_stays_where_it_is_is_seen_at_its_start_and_end():
    times, position = fall(3)
    assert instants_along(times, 0.0 * position, SIZES, 6).tolist() == [0.0, 1.0]


def test_contacts_show_where_the_outlines_touch(tmp_path):
    study = small_study(tmp_path)
    trajectory = replicate_of(0, (0, 16, 0.0), study)
    frames, row = frames_of(trajectory, 6), trajectory.row
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
