"""What a window leaves behind: all as it was where it fails, and what contacts carry on."""

import numpy as np

import flocsim.arrays as at
from flocsim import Body, Sphere, System
from flocsim.arrays import work_of
from flocsim.geometry.contact.candidates import list_candidates
from flocsim.swarms.arrays import (
    found_of,
    with_links,
)
from flocsim.swarms.islands import put_slips, take_slips, touch_plainly
from flocsim.swarms.swarm import Swarm
from tests.helpers.swarm_scenes import WATER, R, crowd, forces


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


def test_what_a_contact_goes_by_besides_places_goes_on_behind_a_window():
    """How it touches, its force, the gap that counts as none, and its flights; but not where the
    steps go on across switches."""
    swarm = Swarm(
        [Body(Sphere(R), (x, 0.0), density=2650.0) for x in (0.0, 2.0 * R - 1e-9)],
        forces(),
        fluid=WATER,
    )
    arrays = swarm.begin(1.0).swarm
    links = np.array([[1, 0, 1, 0, at.GRAZES]])
    arrays = with_links(arrays, links, np.array([[1e-12, 2e-13, 3e-9, 4e-14, 5.0]]))
    system = System(swarm.bodies, forces(), fluid=WATER)
    scene = system.scene(jit=False)
    work = work_of(scene, *system.motion())
    members, found = np.arange(2), found_of(4)
    work.budget[:] = -1.0
    assert put_slips(arrays, scene, work, members, 0)
    list_candidates(scene, work)
    assert work.candidates[0, at.CLOSED] == at.GRAZES
    assert take_slips(arrays, scene, work, found, members, 0)
    assert found.filled[0] == 1
    assert found.links[0].tolist() == links[0].tolist()
    assert found.slips[0].tolist() == [1e-12, 2e-13, 3e-9, 4e-14, 5.0]
    assert put_slips(arrays, scene, work, members, 0)
    touch_plainly(work)
    assert work.kept[0, at.KEPT_MODE] == at.OPEN
