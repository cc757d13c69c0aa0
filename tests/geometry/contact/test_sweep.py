"""The sweep for near discs, against all pairs."""

import math

import numpy as np
import pytest

from flocsim.geometry.contact.body_pairs import near_pairs, paths_meet
from flocsim.state.bodies import Disc
from flocsim.state.contacts import BodyPair

BOXES = [(math.inf, math.inf), (10.0, math.inf), (math.inf, 8.0), (10.0, 8.0)]


def random_discs(rng, count, box):
    """Discs of any size, some of them fixed, that go some way."""
    discs = Disc.rows(count)
    for axis, side in zip("xy", box, strict=True):
        wide = 12.0 if side == math.inf else 3.0 * side
        discs[axis] = rng.uniform(-wide, wide, count)
    for axis in ("way_x", "way_y"):
        discs[axis] = 0.4 * rng.normal(size=count)
    discs["reach"] = rng.uniform(0.1, 0.9, count)
    discs["moves"] = rng.random(count) < 0.8
    return discs


def found(discs, box, order=None):
    """The near pairs by the sweep."""
    count = len(discs)
    order = np.arange(count) if order is None else order
    pairs = BodyPair.rows(count * count)
    total = near_pairs(discs, order, *box, np.zeros(count + 1, dtype=int), pairs)
    return [(pair.later, pair.earlier) for pair in pairs[:total]]


@pytest.mark.parametrize("box", BOXES)
@pytest.mark.parametrize("seed", range(12))
def test_the_sweep_finds_what_a_look_at_all_pairs_finds(seed, box):
    discs = random_discs(np.random.default_rng(seed), 40, box)
    expected = [(a, b) for a in range(40) for b in range(a) if paths_meet(discs, a, b, *box)]
    assert expected
    assert found(discs, box) == expected


@pytest.mark.parametrize("seed", range(6))
def test_ways_are_met_in_between(seed):
    rng = np.random.default_rng(seed)
    discs = random_discs(rng, 2, BOXES[0])
    discs["moves"] = 1.0
    shares = np.linspace(0.0, 1.0, 2001)[:, None]
    places = [(d.x, d.y) + shares * (d.way_x, d.way_y) for d in discs]
    least = np.hypot(*(places[0] - places[1]).T).min()
    for reach in (0.9 * least, 1.1 * least):
        discs["reach"] = 0.5 * reach
        assert paths_meet(discs, 0, 1, *BOXES[0]) == (reach > least)


def test_a_box_shifted_by_any_vector_has_the_same_pairs():
    rng = np.random.default_rng(3)
    discs = random_discs(rng, 60, (10.0, 8.0))
    moved = discs.copy()
    moved["x"] += rng.uniform(-30.0, 30.0)
    moved["y"] += rng.uniform(-30.0, 30.0)
    assert found(moved, (10.0, 8.0)) == found(discs, (10.0, 8.0))
