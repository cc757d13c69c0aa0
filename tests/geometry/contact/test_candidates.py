"""The candidate list: it may list too much, but while its budget lasts it must miss nothing."""

from functools import cache

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from flocsim.body import Fluid, scene_of
from flocsim.geometry.contact.candidates import (
    rebuild_list,
    spent_budget,
)
from flocsim.geometry.contact.points import locate_contacts
from flocsim.state.work import NOW, work_of
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
    start = work.place[NOW].copy()
    within, beyond = 0.0, 2.0
    # What a motion spends is not in proportion to it where bodies turn far: bisect.
    for _ in range(40):
        share = 0.5 * (within + beyond)
        work.place[NOW] = start + share * steps
        within, beyond = (
            (share, beyond) if spent_budget(scene, work, NOW) <= 1.0 else (within, share)
        )
    work.place[NOW] = start + within * steps


def pairs_now(plain, work):
    """Every pair of the scene, near or far, where the bodies are now."""
    places = work.place[NOW].copy()
    return measure(Scene(plain.bodies, places, plain.velocities), all_pairs(plain.bodies))


def assert_nothing_missed(plain, wanted):
    """After any motion within the budget all overlapping pairs are in the list."""
    scene, work = arrays(plain)
    assert rebuild_list(scene, work)
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
    assert rebuild_list(scene, work)
    locate_contacts(scene, work, NOW)
    assert any(a == 1 and b == 0 for a, _, b, _ in keys_of(scene, work))
    assert work.geometry["gap"][NOW, : work.tally.candidates].min() < 0.0


REACHES = [1e-8, 4e-7, 2e-5]


@pytest.mark.parametrize("reach", REACHES)
@given(seed=seeds, wanted=directions, apart=st.floats(0.0, 3e-6))
def test_the_closest_pair_within_reach_is_listed_while_the_budget_lasts(reach, seed, wanted, apart):
    plain = random_scene(seed)
    scene, work = arrays(plain, reach)
    middle = plain.positions[:, :2].mean(axis=0)
    away = plain.positions[:, :2] - middle
    work.place[NOW, :, :2] += apart * away / np.hypot(*away.T)[:, None]
    assert rebuild_list(scene, work)
    spend_budget(scene, work, wanted)
    locate_contacts(scene, work, NOW)
    every, listed = pairs_now(plain, work), keys_of(scene, work)
    for two in {frozenset(pair) for pair in every.pair[:, ::2].tolist()}:
        least = min(
            -overlap
            for pair, overlap in zip(every.pair, every.overlap, strict=True)
            if {pair[0], pair[2]} == two
        )
        known = [
            work.geometry[NOW, row].gap for row, key in enumerate(listed) if {key[0], key[2]} == two
        ]
        if least < reach:
            assert min(known, default=np.inf) == pytest.approx(least, rel=1e-9, abs=1e-17)


def test_spheres_are_one_pair_and_a_sphere_has_no_edge():
    ball = make_body([[0.0, 0.0]], 2e-6, surface_density=2.0)
    square = make_body([[0, 0], [4e-6, 0], [4e-6, 4e-6], [0, 4e-6]], 1e-6, surface_density=2.0)
    places = np.array([[0.0, 0.0, 0.0], [3.2e-6, 0.0, 0.0], [0.0, 4.9e-6, 0.0]])
    scene, work = arrays(Scene((ball, ball, square), places, np.zeros((3, 3))))
    assert rebuild_list(scene, work)
    keys = keys_of(scene, work)
    assert keys.count((1, 0, 0, 0)) == 1
    assert {key[:2] for key in keys if 2 in key[::2]} == {(0, 0), (1, 0)}
