"""The generator: its published numbers, compiled and not, and what its numbers look like."""

import math

import numpy as np
import pytest

from flocsim.integrators.loop.kicks import philox, three_normals
from tests.reference import kicks as plain

ONES = 0xFFFFFFFF

KNOWN = [
    ((0, 0, 0, 0), (0, 0), (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
    ((ONES,) * 4, (ONES,) * 2, (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
    ((0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344), (0xA4093822, 0x299F31D0),
     (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1)),
]  # fmt: skip
"""(counter, key, words) of Random123's kat_vectors."""


@pytest.mark.parametrize(("counter", "key", "words"), KNOWN)
def test_published_numbers(counter, key, words):
    assert philox(*counter, *key) == words
    assert plain.philox(counter, key) == words


def test_compiled_it_gives_the_same_words():
    from numba import njit

    compiled = njit(philox)
    rng = np.random.default_rng(5)
    for numbers in [*rng.integers(0, 2**32, (200, 6)).tolist(), [ONES] * 6, [0] * 6]:
        assert compiled(*numbers) == philox(*numbers)


def test_normals_are_the_references():
    for index, level, body in [(0, 0, 0), (7, 3, 1), (2**40 + 5, 12, 70_000)]:
        found = three_normals(index, level, body, (11, 12))
        np.testing.assert_allclose(found, plain.normals(index, level, body, (11, 12)), rtol=1e-12)


def test_normals_are_normal_and_independent():
    """Moments within 4.5 standard errors, and the largest distance of the distribution (KS)."""
    count = 4000
    numbers = np.array([three_normals(index, 0, 3, (1, 2)) for index in range(count)])
    assert np.abs(numbers.mean(axis=0)).max() < 4.5 / math.sqrt(count)
    assert np.abs((numbers**2).mean(axis=0) - 1.0).max() < 4.5 * math.sqrt(2.0 / count)
    products = np.corrcoef(np.hstack([numbers[:-1], numbers[1:]]).T)
    assert np.abs(products - np.eye(6)).max() < 4.5 / math.sqrt(count)
    ordered = np.sort(numbers.ravel())
    below = np.array([0.5 * math.erfc(-x / math.sqrt(2.0)) for x in ordered])
    assert np.abs(below - np.arange(len(ordered)) / len(ordered)).max() < 2.0 / math.sqrt(3 * count)
