"""Tuples of arrays as they are declared."""

from typing import Annotated, NamedTuple

import numpy as np

from flocsim.state.declared import block_of, enlarged, zeros_of
from flocsim.state.records import Record


class Place(Record):
    """A record."""

    x: float
    index: int


class Inner(NamedTuple):
    """A tuple in another one."""

    flags: Annotated[np.ndarray, ("k",), np.int8]
    best: Place


class Outer(NamedTuple):
    """Arrays of every kind that there is."""

    numbers: Annotated[np.ndarray, (2, "k")]
    places: Annotated[np.ndarray, ("n", "k"), Place]
    inner: Inner
    none: Annotated[np.ndarray, (0, "n")]


def filled(k=3):
    """Return such a tuple of arrays that are not zero."""
    made = zeros_of(Outer, n=2, k=k)
    made.numbers[:] = np.arange(2 * k).reshape(2, k)
    made.places[1, 0].index = 7
    made.inner.flags[:] = 1
    made.inner.best.x = 0.5
    return made


def test_arrays_are_as_declared_and_aligned():
    made = filled()
    assert made.numbers.shape == (2, 3)
    assert made.inner.flags.dtype == np.int8
    assert isinstance(made.places[0, 0], Place) and made.places.dtype is Place.dtype
    assert isinstance(made.inner.best, Place)
    assert made.none.shape == (0, 2)
    for each in (made.numbers, made.places, made.inner.flags, made.none):
        assert each.flags.c_contiguous and each.flags.aligned


def test_all_is_in_one_block_but_for_what_has_been_put_in_its_place():
    made = filled()
    other = np.ones(3)
    block_of(made._replace(places=other))[:] = 0
    assert not made.numbers.any() and not made.inner.flags.any()
    assert made.places[1, 0].index == 0 and made.inner.best.x == 0.0
    assert other.all()


def test_an_enlarged_tuple_has_zeros_at_its_ends():
    made, larger = filled(), enlarged(filled(), k=5)
    assert larger.numbers.shape == (2, 5) and larger.inner.flags.tolist() == [1, 1, 1, 0, 0]
    np.testing.assert_array_equal(larger.numbers[:, :3], made.numbers)
    assert not larger.numbers[:, 3:].any()
    assert larger.places.shape == (2, 5) and larger.places[1, 0].index == 7
    assert larger.inner.best.x == 0.5
    larger.inner.best.x = 1.0
    assert made.inner.best.x == 0.5
