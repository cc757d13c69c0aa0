"""What islands of a window are made of, and which of them have been run already."""

import itertools

import numpy as np
import pytest

import flocsim.arrays as at
from flocsim import Body, Sphere, System
from flocsim.arrays import with_capacity, work_of
from flocsim.geometry.contact.candidates import list_candidates
from flocsim.swarms.arrays import (
    EARLIER_BODY,
    LATER_BODY,
    LINK_COLUMNS,
    SLIP_COLUMNS,
    found_of,
    with_links,
)
from flocsim.swarms.islands import put_slips, take_slips, touch_plainly
from flocsim.swarms.progress import Finished
from flocsim.swarms.runner import CHUNK, Islands, Reached, chunks_of
from flocsim.swarms.swarm import Swarm
from tests.helpers.swarm_scenes import WATER, R, crowd, forces


def drawn(seed, n=60, walls=3):
    """Names of islands of n bodies, the last of them fixed, and which of these each reaches."""
    rng = np.random.default_rng(seed)
    labels = rng.integers(0, n // 3, n)
    labels = np.array([np.flatnonzero(labels == label)[0] for label in labels])
    fixed = np.arange(n - walls, n)
    labels[fixed] = -1
    for label in np.unique(labels[labels >= n - walls]):
        labels[labels == label] = -1
    touches = rng.random((n, walls)) < 0.1
    return labels, fixed, touches


@pytest.mark.parametrize("seed", range(20))
def test_islands_are_bodies_of_a_name_and_the_walls_that_these_reach(seed):
    labels, fixed, touches = drawn(seed, walls=seed % 4)
    islands = Islands.of(Reached(labels, fixed, touches))
    expected = []
    for label in sorted({*labels.tolist()} - {-1}):
        members = np.flatnonzero(labels == label)
        reached = {int(fixed[k]) for k in np.flatnonzero(touches[members].any(axis=0))}
        expected.append(sorted({*members.tolist(), *reached}))
    found = [islands.members_of(k).tolist() for k in range(len(islands.sizes))]
    assert sorted(found) == sorted(expected)
    chosen = islands.chosen(np.arange(0, len(found), 2))
    assert sorted(chosen.members_of(k).tolist() for k in range(len(chosen.sizes))) == sorted(
        found[::2]
    )
    assert (np.diff(chosen.sizes) <= 0).all()


@pytest.mark.parametrize("seed", range(10))
def test_chunks_are_of_one_size_and_take_every_island_once(seed):
    sizes = np.sort(np.random.default_rng(seed).geometric(0.3, 300))[::-1]
    chunks = chunks_of(sizes)[::-1]
    assert [first for first, _ in chunks] == [0, *(last for _, last in chunks[:-1])]
    assert chunks[-1][1] == len(sizes)
    for first, last in chunks:
        assert len(np.unique(sizes[first:last])) == 1
        assert (last - first) * sizes[first] <= max(CHUNK, sizes[first])
    assert chunks_of(sizes[:0]) == []


def contacts_of(islands, free, rng):
    """A contact of each island of two free bodies or more, or of one and a wall."""
    links = []
    for k in range(len(islands.sizes)):
        members = islands.members_of(k)
        if len(members) > 1:
            later, earlier = members[-1], members[0]
            links.append([later, earlier, *rng.integers(0, 100, LINK_COLUMNS - 2)])
    links = np.array(links, dtype=np.int64).reshape(-1, LINK_COLUMNS)
    return links, rng.random((len(links), SLIP_COLUMNS))


@pytest.mark.parametrize("seed", range(20))
def test_what_has_been_run_is_not_run_again_and_contacts_are_those_of_the_last_islands(seed):
    rng = np.random.default_rng([seed, 1])
    labels, fixed, touches = drawn(seed)
    free = labels >= 0
    finished, ran = Finished(free), {}
    for _ in range(4):
        islands = Islands.of(Reached(labels, fixed, touches))
        fresh = islands.chosen(finished.missing(islands))
        members = {tuple(islands.members_of(k)) for k in range(len(islands.sizes))}
        assert {tuple(fresh.members_of(k)) for k in range(len(fresh.sizes))} == members - ran.keys()
        links, slips = contacts_of(fresh, free, rng)
        finished.add(fresh, links, slips)
        assert len(finished.missing(islands)) == 0
        here = dict.fromkeys(members - ran.keys())
        for link, slip in zip(links.tolist(), slips.tolist(), strict=True):
            owner = int(finished.owners(np.array([link]))[0])
            here[next(key for key in here if owner in key)] = (tuple(link), tuple(slip))
        ran = {key: ran[key] for key in members & ran.keys()} | here
        kept = zip(finished.links.tolist(), finished.slips.tolist(), strict=True)
        known = {(tuple(link), tuple(slip)) for link, slip in kept}
        assert known == {each for each in ran.values() if each}
        # Some merge, some reach another wall; none reaches fewer.
        one, other = rng.choice(np.unique(labels[free]), 2)
        labels[labels == max(one, other)] = min(one, other)
        touches = touches | (rng.random(touches.shape) < 0.01)


def test_links_are_named_by_a_body_that_moves():
    finished = Finished(np.array([True, False, True]))
    rows = list(itertools.permutations(range(3), 2))
    links = np.zeros((len(rows), LINK_COLUMNS), dtype=np.int64)
    links[:, [LATER_BODY, EARLIER_BODY]] = rows
    owners = finished.owners(links)
    assert finished.free[owners].all()
    assert all(owner in row for owner, row in zip(owners, rows, strict=True))


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


def test_islands_have_the_room_that_others_have_needed():
    """Or each new size begins its window again, for what has been known since the last one."""
    bodies, side = crowd(30, 0)
    swarm = Swarm(bodies, forces(), fluid=WATER, box=(side, side))
    progress = swarm.begin(1e-3)
    own = progress.runner.threads[0]
    own.enlarge(20, with_capacity(own.of_size(20, swarm.integrator).work, 1000))
    assert len(own.of_size(20, swarm.integrator).work.candidates) == 1000
    assert len(own.of_size(30, swarm.integrator).work.candidates) == 1500
    few = len(own.of_size(4, swarm.integrator).work.candidates)
    own.enlarge(4, with_capacity(own.by_size[4].work, 1000))
    assert len(own.of_size(5, swarm.integrator).work.candidates) == few * 5 // 4


def test_there_is_room_for_what_islands_leave_behind_before_they_run():
    """That runs out at their very end: they would be run again from the beginning."""
    bodies, side = crowd(30, 0)
    own = Swarm(bodies, forces(), fluid=WATER, box=(side, side)).begin(1e-3).runner.threads[0]
    own.make_room(1000)
    assert len(own.found.links) == len(own.found.slips) == 1000
    own.found.filled[0] = 900
    own.make_room(50)
    assert len(own.found.links) == 1000
    own.make_room(200)
    assert len(own.found.links) == 2000
