"""While a scene compiles, types are remembered and garbage waits; then all is as it was."""

import gc

import pytest
from numba.core import types

from flocsim import numba_internals as typing_memory
from flocsim.numba_internals import quick_typing, remembering


def test_each_case_is_asked_once():
    asked = []

    def real(function, context, arguments, keywords):
        asked.append((function, arguments, keywords))
        return len(asked)

    memory = remembering(real)
    plus, minus = object(), object()
    assert memory(plus, None, (1, 2), {}) == memory(plus, None, (1, 2), {}) == 1
    assert memory(plus, None, (1, 3), {}) == 2
    assert memory(minus, None, (1, 2), {}) == 3
    assert memory(minus, None, (1, 2), {"out": 1}) == 4
    assert memory(minus, None, (1, 2), {"out": 1}) == 4


def test_what_cannot_be_typed_is_asked_again():
    def real(function, context, arguments, keywords):
        raise TypeError("no such case")

    memory = remembering(real)
    for _ in range(2):
        with pytest.raises(TypeError):
            memory("plus", None, (), {})


@pytest.mark.parametrize("collecting", [True, False])
def test_all_is_as_it_was_afterwards(collecting):
    before = vars(types.Function).get("get_call_type"), types.Function.get_call_type
    try:
        gc.enable() if collecting else gc.disable()
        with pytest.raises(KeyboardInterrupt), quick_typing():
            assert not gc.isenabled()
            assert types.Function.get_call_type is not before[1]
            raise KeyboardInterrupt
        assert gc.isenabled() == collecting
    finally:
        gc.enable()
    assert (vars(types.Function).get("get_call_type"), types.Function.get_call_type) == before


def test_a_numba_that_is_not_what_it_was_remembers_nothing(monkeypatch):
    monkeypatch.setattr(types, "Function", object)
    with typing_memory.types_remembered():
        assert not hasattr(object, "get_call_type")
