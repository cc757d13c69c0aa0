"""The candidate list: it may list too much, but while its budget lasts it must miss nothing."""

from functools import cache

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

import flocsim.arrays as at
from flocsim.arrays import copy_of, with_capacity, work_of
from flocsim.body import Fluid, scene_of
from flocsim.geometry.contact.candidates import (
    list_ahead,
    list_candidates,
    list_pair,
    moved,
    spent,
    time_within,
    too_wide,
)
from flocsim.geometry.contact.points import locate_contacts
from tests.helpers.fast_scene import bodies_of, keys_of
from tests.reference import scenes
from tests.reference.contacts import all_pairs, measure
from tests.reference.samples import scene_of as random_scene
from tests.reference.shapes import Scene, make_body

seeds = st.integers(0, 39)
directions = st.lists(st.floats(-1.0, 1.0), min_size=9, max_size=9)


def arrays(plain, reach=-1.0, capacity=4096):
    """Scene and work arrays of a reference scene."""
    scene = scene_of(bodies_of(plain, surface_density=2.0), Fluid(), surface_reach=reach)
    return scene, work_of(scene, plain.positions, plain.velocities, capacity)


def spend_budget(scene, work, wanted):
    """Move the bodies as wanted (n, 3), scaled so that one pair spends just all of its budget."""
    steps = np.array(wanted)[: 3 * len(scene.bodies)].reshape(-1, 3) * (1e-5, 1e-5, 1.0)
    start = work.motion[at.NOW, :, :3].copy()
    within, beyond = 0.0, 2.0
    # What a motion spends is not in proportion to it where bodies turn far: bisect.
    for _ in range(40):
        share = 0.5 * (within + beyond)
        work.motion[at.NOW, :, :3] = start + share * steps
        within, beyond = (share, beyond) if spent(scene, work, at.NOW) <= 1.0 else (within, share)
    work.motion[at.NOW, :, :3] = start + within * steps


def pairs_now(plain, work):
    """Every pair of the scene, near or far, where the bodies are now."""
    places = work.motion[at.NOW, :, :3].copy()
    return measure(Scene(plain.bodies, places, plain.velocities), all_pairs(plain.bodies))


def assert_nothing_missed(plain, wanted):
    """After any motion within the budget all overlapping pairs are in the list."""
    scene, work = arrays(plain)
    assert list_candidates(scene, work)
    spend_budget(scene, work, wanted)
    every = pairs_now(plain, work)
    overlapping = set(every.select(every.overlap > 0.0).pair_keys())
    listed = set(keys_of(scene, work))
    listed |= {key[2:] + key[:2] for key in listed if both_points(key, scene)}
    assert overlapping <= listed


def both_points(key, scene):
    """Whether a pair is that of two spheres, which either may name first."""
    return all(scene.first[body + 1] - scene.first[body] == 1 for body in key[::2])


@given(seeds, directions)
def test_no_pair_is_missed_while_the_budget_lasts(seed, wanted):
    assert_nothing_missed(random_scene(seed), wanted)


@cache
def unequal_scene(seed):
    """A long, coarse body (N = 2, 3, 4) and a small one, touching anywhere along its edges."""
    rng = np.random.default_rng(seed)
    long = {2: [[-1, 0], [1, 0]], 3: [[-1, 0], [1, 0], [0.9, 0.05]],
            4: [[-1, 0], [1, 0], [1, 0.02], [-1, 0.02]]}[2 + seed % 3]  # fmt: skip
    small = [[[0, 0]], [[-1, 0], [1, 0]], [[0, 0], [1, 0], [0, 1]], long][seed // 3 % 4]
    bodies = (
        make_body(np.array(long) * 1e-4 * rng.uniform(0.3, 3.0), 1e-6, surface_density=2.0),
        make_body(np.array(small) * 1e-6 * rng.uniform(1, 50.0), 1e-6, surface_density=2.0),
    )
    place = None
    while place is None:
        start = rng.uniform(-2e-4, 2e-4, 2)
        aim = rng.uniform(-1e-4, 1e-4), 0.0
        heading = np.arctan2(*(aim - start)[::-1])
        start = np.array([*start, rng.uniform(0, 2 * np.pi)])
        place = scenes.advance(start, heading, bodies[1], bodies[:1], [np.zeros(3)], -0.2)
    return Scene(bodies, np.array([np.zeros(3), place]), np.zeros((2, 3)))


@given(st.integers(0, 47), directions)
@example(2, [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
def test_long_edges_are_not_missed_though_their_ends_are_far(seed, wanted):
    assert_nothing_missed(unequal_scene(seed), wanted)


def test_two_long_bars_that_cross_are_listed_at_their_middle():
    bar = make_body([[-50e-6, 0.0], [50e-6, 0.0]], 1e-6, surface_density=2.0)
    stub = make_body([[-50e-6, 0.0], [0.0, 0.0], [50e-6, 1e-7]], 1e-6, surface_density=2.0)
    plain = Scene((bar, stub), np.array([[0, 0, 0], [0, 51.5e-6, np.pi / 2]]), np.zeros((2, 3)))
    scene, work = arrays(plain)
    assert list_candidates(scene, work)
    locate_contacts(scene, work, at.NOW)
    assert any(a == 1 and b == 0 for a, _, b, _ in keys_of(scene, work))
    assert work.geometry[at.NOW, : work.tally[at.CANDIDATES], 2].min() < 0.0


REACHES = [1e-8, 1e-7, 4e-7, 1e-6, 3e-6, 2e-5]


@pytest.mark.parametrize("reach", REACHES)
@given(seed=seeds, wanted=directions, apart=st.floats(0.0, 3e-6))
def test_the_closest_pair_within_reach_is_listed_while_the_budget_lasts(reach, seed, wanted, apart):
    plain = random_scene(seed)
    scene, work = arrays(plain, reach)
    middle = plain.positions[:, :2].mean(axis=0)
    away = plain.positions[:, :2] - middle
    work.motion[at.NOW, :, :2] += apart * away / np.hypot(*away.T)[:, None]
    assert list_candidates(scene, work)
    spend_budget(scene, work, wanted)
    locate_contacts(scene, work, at.NOW)
    every, listed = pairs_now(plain, work), keys_of(scene, work)
    for two in {frozenset(pair) for pair in every.pair[:, ::2].tolist()}:
        least = min(
            -overlap
            for pair, overlap in zip(every.pair, every.overlap, strict=True)
            if {pair[0], pair[2]} == two
        )
        known = [
            work.geometry[at.NOW, row, 2]
            for row, key in enumerate(listed)
            if {key[0], key[2]} == two
        ]
        if least < reach:
            assert min(known, default=np.inf) == pytest.approx(least, rel=1e-9, abs=1e-17)


def test_spheres_are_one_pair_and_a_sphere_has_no_edge():
    ball = make_body([[0.0, 0.0]], 2e-6, surface_density=2.0)
    square = make_body([[0, 0], [4e-6, 0], [4e-6, 4e-6], [0, 4e-6]], 1e-6, surface_density=2.0)
    places = np.array([[0.0, 0.0, 0.0], [3.2e-6, 0.0, 0.0], [0.0, 4.9e-6, 0.0]])
    scene, work = arrays(Scene((ball, ball, square), places, np.zeros((3, 3))))
    assert list_candidates(scene, work)
    keys = keys_of(scene, work)
    assert keys.count((1, 0, 0, 0)) == 1
    assert {key[:2] for key in keys if 2 in key[::2]} == {(0, 0), (1, 0)}


def test_a_full_list_is_reported_and_a_larger_one_lists_all():
    plain = random_scene(next(seed for seed in range(40) if touching(seed) > 6))
    scene, work = arrays(plain)
    assert list_candidates(scene, work)
    whole = keys_of(scene, work)
    scene, work = arrays(plain, capacity=3)
    assert not list_candidates(scene, work)
    assert min(work.budget) == -np.inf
    work = with_capacity(work, len(whole))
    assert list_candidates(scene, work)
    assert keys_of(scene, work) == whole


def touching(seed):
    """Pairs in contact in a random scene."""
    plain = random_scene(seed)
    return int(np.sum(measure(plain, all_pairs(plain.bodies)).overlap > 0.0))


def test_displacements_survive_a_list_that_had_to_grow():
    plain = random_scene(next(seed for seed in range(40) if touching(seed) > 6))
    scene, roomy = arrays(plain)
    assert list_candidates(scene, roomy)
    count = int(roomy.tally[at.CANDIDATES])
    roomy.slip[at.NOW, :count] = 1e-9 * np.arange(1, count + 1)
    tight = cut_to(roomy, count)
    for work in (roomy, tight):
        move_together(plain, work)
    assert list_candidates(scene, roomy) and not list_candidates(scene, tight)
    tight = with_capacity(tight, 4 * count)
    assert list_candidates(scene, tight)
    assert slips_of(scene, tight) == slips_of(scene, roomy) != {}


def cut_to(work, capacity):
    """A copy of the work arrays that has room for just as many pairs."""
    tight = work._replace(
        slip=work.slip[:, :capacity],
        candidates=work.candidates[:capacity],
        geometry=work.geometry[:, :capacity],
        kept=work.kept[:capacity],
    )
    return copy_of(tight)


def move_together(plain, work):
    """Bring the bodies a little nearer to their middle, so that more pairs come near."""
    away = plain.positions[:, :2] - plain.positions[:, :2].mean(axis=0)
    work.motion[at.NOW, :, :2] -= 8e-7 * away / np.hypot(*away.T)[:, None]


def slips_of(scene, work):
    """{pair: displacement} of the listed pairs that have one."""
    slips = work.slip[at.NOW, : work.tally[at.CANDIDATES]].tolist()
    return {key: slip for key, slip in zip(keys_of(scene, work), slips, strict=True) if slip}


def test_bodies_far_apart_list_nothing_and_may_move_until_they_are_near():
    plain = random_scene(0)
    far = plain.positions + np.arange(len(plain.bodies))[:, None] * (1e-3, 0.0, 0.0)
    scene, work = arrays(Scene(plain.bodies, far, plain.velocities))
    assert list_candidates(scene, work) and work.tally[at.CANDIDATES] == 0
    assert list_pair(scene, work, 0, 0.0) > 8e-4


@given(seeds)
def test_lists_are_as_wide_as_the_steps_ahead_need(seed):
    scene, work = arrays(random_scene(seed))
    assert list_candidates(scene, work)
    rows, narrow = work.tally[at.CANDIDATES], work.budget.copy()
    assume(rows > 0 and len(narrow) == 1)
    step = time_within(scene, work, 2.0)
    assert list_ahead(scene, work, step)
    assert work.tally[at.CANDIDATES] >= rows and (work.budget >= narrow).all()
    # Half of what the bodies may move is enough for such a step.
    assert time_within(scene, work, 0.5) >= 0.99 * step
    assert not too_wide(scene, work, step)


def test_lists_that_are_far_too_wide_are_made_anew():
    scene, work = arrays(random_scene(3))
    assert list_candidates(scene, work)
    assert list_ahead(scene, work, time_within(scene, work, 6.0))
    assert work.tally[at.CANDIDATES] > 0 and too_wide(scene, work, 0.0)
    assert list_candidates(scene, work) and not too_wide(scene, work, 0.0)


@given(seeds)
def test_a_short_motion_spends_no_more_than_the_speeds_tell(seed):
    scene, work = arrays(random_scene(seed))
    assert list_candidates(scene, work)
    time = time_within(scene, work, 1e-4)
    work.motion[at.NOW, :, :3] += time * work.motion[at.NOW, :, 3:]
    pairs = [(a, b) for a in range(len(scene.bodies)) for b in range(a)]
    for pair, budget in zip(pairs, work.budget, strict=True):
        assert moved(scene, work, at.NOW, *pair, enough=0.0) <= 1.01e-4 * budget


def test_a_scene_that_turns_as_one_spends_nothing():
    plain = random_scene(3)
    scene, work = arrays(plain)
    assert list_candidates(scene, work)
    c, s = np.cos(2.0), np.sin(2.0)
    work.motion[at.NOW, :, :2] = work.motion[at.NOW, :, :2] @ np.array([[c, s], [-s, c]])
    work.motion[at.NOW, :, 2] += 2.0
    assert spent(scene, work, at.NOW) < 1e-6
    now = work.motion[at.NOW]
    now[:, 3:] = np.column_stack([-7.0 * now[:, 1], 7.0 * now[:, 0], np.full(len(now), 7.0)])
    assert time_within(scene, work, 1.0) > 1e6
