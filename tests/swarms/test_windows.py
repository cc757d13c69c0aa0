"""A window that fails leaves all as it was."""

import numpy as np

from flocsim.swarms.swarm import Swarm
from tests.helpers.swarm_scenes import WATER, crowd, forces


def test_a_window_that_fails_leaves_time_motion_and_error_as_they_were():
    bodies, side = crowd(30, 2)
    progress = Swarm(bodies, forces(), fluid=WATER, box=(side, side)).begin(0.05)
    for _ in range(15):
        assert progress.advance(0.05).name == "PAUSED"
    time, motion, error = progress.seen()
    half = progress.median_error
    assert error > half > 0.0
    progress.runner.max_steps = 1
    assert progress.advance(0.05).name == "STEP_BUDGET"
    after = progress.seen()
    assert (after[0], after[2], progress.median_error) == (time, error, half)
    assert np.array_equal(after[1], motion)
