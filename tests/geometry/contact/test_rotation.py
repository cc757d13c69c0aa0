"""Cosine and sine from those of an angle near by, against the library's."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from flocsim.geometry.contact.points import cosine_and_sine
from flocsim.state.bodies import Pose


def new_work():
    return SimpleNamespace(poses=Pose.rows(2))


@pytest.mark.parametrize("size", [1e-12, 1e-3, 0.1, 4.0, 1e3, 1e5, 1e7, 1e300])
def test_it_agrees_with_the_library(size):
    work, rng = new_work(), np.random.default_rng(1)
    for angle in rng.uniform(-size, size, 500):
        assert cosine_and_sine(work, 1, angle) == pytest.approx(
            (math.cos(angle), math.sin(angle)), rel=0.0, abs=3.4e-16
        )


def test_what_is_remembered_does_not_show():
    """The same numbers whatever angles were asked for before."""
    angles = np.random.default_rng(2).uniform(-3.0, 3.0, 300)
    work = new_work()
    in_turn = [cosine_and_sine(work, 0, angle) for angle in angles]
    assert in_turn == [cosine_and_sine(new_work(), 0, angle) for angle in angles]
    assert in_turn[::-1] == [cosine_and_sine(work, 0, angle) for angle in angles[::-1]]


def test_no_number_gives_none():
    assert all(map(math.isnan, cosine_and_sine(new_work(), 0, math.nan)))
