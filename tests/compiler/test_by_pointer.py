"""What compiled code finds in a table is what Python finds in the arguments."""

from typing import Annotated, NamedTuple

import numpy as np
import pytest

from flocsim.compiler.by_pointer import Stacked, table_of
from flocsim.compiler.composer import compose
from flocsim.errors import KernelError


class Inner(NamedTuple):
    """A tuple of names in another one."""

    numbers: Annotated[np.ndarray, ("n", 3)]
    flags: np.ndarray


class Outer(NamedTuple):
    """Arrays of every kind that the engine has, and numbers."""

    places: Annotated[np.ndarray, ("rows", "n", 2)]
    counts: np.ndarray
    waves: np.ndarray
    inner: Inner
    reach: float
    box: tuple[float, int]
    events: int
    short: np.ndarray


class View(NamedTuple):
    """Numbers alone."""

    x: float
    y: float


def outer():
    draw = np.random.default_rng(5)
    return Outer(
        places=draw.random((4, 3, 2)),
        counts=draw.integers(0, 9, 6),
        waves=draw.random((2, 3)) + 1j,
        inner=Inner(draw.random((5, 3)), np.array([True, False, True])),
        reach=0.25,
        box=(1.5, 7),
        events=3,
        short=draw.integers(0, 9, (2, 2)).astype(np.int32),
    )


def reads(outer, k):
    found = outer.places[k, 1, 0] + outer.counts[k] + outer.waves[1, k].imag
    found += outer.inner.numbers[4, 2] + outer.reach + outer.box[0] * outer.box[1] + outer.events
    if outer.inner.flags[k]:
        found += 100.0
    return found + outer.short[1, 0]


def writes(outer, k):
    outer.places[k, 2, 1] += 3
    outer.counts[k] -= 2
    outer.waves[0, k] = 2.5
    outer.inner.flags[1] = outer.counts[k] > -100
    outer.inner.numbers[k, 0] = outer.counts[0]
    outer.short[0, 1] = k + 4


def sizes(outer, k):
    total = 0
    for axis in outer.places.shape:
        total = 10 * total + axis
    return 100 * total + 10 * outer.counts.shape[0] + outer.inner.numbers.shape[0]


def mixed(flag, number, view, pair, array):
    array[0] = view.x
    return (number if flag else -number) + view[1] * pair[0] + pair[1] + array[1]


def both(function, *arguments):
    """What a function returns, and leaves in its first argument, compiled and plain."""
    found = []
    for jit in (True, False):
        state = outer()
        value = compose(function, {}, jit=jit)(state, *arguments)
        found.append((value, state))
    return found


def takes(states, number, k):
    states[number].counts[k] += 1
    return reads(states[number], k)


def test_stacked_tables_are_taken_by_their_numbers():
    each, plain = [outer(), outer()], outer()
    each[1].places[:] += 2.0
    words = np.array([np.frombuffer(table_of(one)[0], np.int64) for one in each])
    for number, more in enumerate((0.0, 2.0)):
        found = compose(takes, {})(Stacked(words, table_of(plain)[1], each[0]), number, 2)
        assert found == pytest.approx(reads(plain, 2) + 1.0 + more)
        assert each[number].counts[2] == plain.counts[2] + 1


@pytest.mark.parametrize("function", [reads, writes, sizes])
@pytest.mark.parametrize("k", [0, 2])
def test_elements_are_read_and_written_as_in_python(function, k):
    (value, state), (expected, plain) = both(function, k)
    assert value == pytest.approx(expected)
    for name in ("places", "counts", "waves", "short"):
        np.testing.assert_allclose(getattr(state, name), getattr(plain, name))
    np.testing.assert_allclose(state.inner.numbers, plain.inner.numbers)
    np.testing.assert_array_equal(state.inner.flags, plain.inner.flags)


def test_numbers_views_and_plain_arrays_are_arguments_as_well():
    compiled = compose(mixed, {})
    for flag in (True, False):
        array = np.array([5.0, 6.0])
        given = flag, 2, View(1.0, 3.0), (0.5, 4), array
        assert compiled(*given) == mixed(*given[:4], array.copy())
        assert array[0] == 1.0


def test_arguments_of_other_types_are_compiled_for_anew():
    compiled = compose(mixed, {})
    for array in (np.zeros(2), np.zeros(2, dtype=np.int64)):
        assert compiled(True, 1, View(2.0, 0.0), (0.0, 0), array) == 1
        assert array[0] == 2


def test_an_array_in_another_order_is_refused():
    with pytest.raises(KernelError, match=r"shape \(3, 2\)\) does not lie in C order"):
        compose(mixed, {})(True, 1, View(2.0, 0.0), (0.0, 0), np.zeros((2, 3)).T)
