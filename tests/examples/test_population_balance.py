"""The population balance of examples/: what it keeps, and a case that is known in closed form."""

import numpy as np
import pytest

from tests.helpers.example_script import example_script


@pytest.fixture(scope="module")
def balance():
    return example_script("population_balance")


def test_two_flocs_become_one_of_their_volume(balance):
    volume = np.array([1.0, 2.0, 3.5, 9.0])
    eta = balance.shares(volume)
    together = volume[:, None] + volume[None, :]
    assert np.einsum("kij,k->ij", eta, volume) == pytest.approx(together)
    inside = together <= volume[-1]
    assert eta.sum(axis=0)[inside] == pytest.approx(np.ones(inside.sum()))


def test_a_constant_kernel_halves_the_number_in_its_time(balance):
    # dN/dt = −½ β N²: N = N₀/(1 + ½ β N₀ t).
    volume, beta, number = np.arange(1.0, 61.0), 2e-3, 5.0
    start = np.zeros(len(volume))
    start[0] = number
    times = np.linspace(0.0, 2.0 / (beta * number), 9)
    n = balance.grow(np.full((len(volume), len(volume)), beta), volume, start, times)
    assert n.sum(axis=1) == pytest.approx(number / (1.0 + 0.5 * beta * number * times), rel=1e-4)
    assert n @ volume == pytest.approx(np.full(len(times), number), rel=1e-9)
