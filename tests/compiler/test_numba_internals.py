"""What flocsim knows of numba's private parts still holds: every part that fails here is named."""

import gc
import re
import sys
from collections import namedtuple
from pathlib import Path

import numba
import numpy as np
import pytest
from numba.core import types

import flocsim
from flocsim.compiler import composer, numba_internals
from flocsim.compiler.composer import compose
from flocsim.compiler.numba_internals import (
    NO_COUNTING,
    address_of,
    call_by_address,
    compilers,
    kept_on_disk,
    quick_typing,
    remembering,
    type_text,
    typed_once,
)

ONE = numba.float64(numba.float64, numba.types.CPointer(numba.float64))


def root(x):
    return inner(x) + twice(x)


def inner(x):
    return np.sqrt(twice(x))


def twice(x):
    return 2.0 * x


@pytest.fixture
def fresh(monkeypatch, tmp_path):
    """Nothing compiled before is at hand."""
    monkeypatch.setenv("FLOCSIM_CACHE", str(tmp_path))
    monkeypatch.setattr(composer, "_composed", {})
    compilers.cache_clear()
    yield monkeypatch
    compilers.cache_clear()


def test_no_other_file_names_a_private_part_of_numba():
    package = Path(flocsim.__file__).parent
    private = re.compile(r"numba\.(core|experimental|np|cpython|typed|misc)\b|_nrt\b|fndesc")
    found = {path.name for path in package.rglob("*.py") if private.search(path.read_text("utf-8"))}
    assert found == {"numba_internals.py", "by_pointer.py"}


def test_kernels_without_counting_compile_and_compute_the_same():
    kernel = numba.njit(twice, **NO_COUNTING)
    assert kernel(3.0) == 6.0
    assert "NRT_" not in next(iter(kernel.inspect_llvm().values()))


def scaled(x, parameters):
    return x * parameters[0]


def failing(x, parameters):
    if x < 0.0:
        raise ValueError("below zero")
    return x


by_address = call_by_address(ONE)


@numba.njit
def calling(address, x, parameters):
    return by_address(address, x, parameters)


def test_a_function_is_called_by_its_address():
    function = numba.njit(ONE)(scaled)
    assert calling(address_of(function, ONE), 3.0, np.array([2.0])) == 6.0


def test_what_a_function_raises_comes_through_a_call_by_address():
    function = numba.njit(ONE)(failing)
    address = address_of(function, ONE)
    assert calling(address, 3.0, np.ones(1)) == 3.0
    with pytest.raises(ValueError, match="below zero"):
        calling(address, -3.0, np.ones(1))


def test_arguments_of_other_types_are_refused_when_compiled():
    with pytest.raises(numba.TypingError, match="a law takes"):
        calling(1, 3, np.ones(1))
    with pytest.raises(numba.TypingError, match="a law takes"):
        calling(1, 3.0, np.ones(4)[::2])


def test_inner_functions_are_linked_and_have_no_machine_code(fresh):
    linked, _ = numba_internals.libraries()
    asked = []
    fresh.setattr(linked, "finalize", lambda self: asked.append(self.name))
    assert linked.get_pointer_to_function(None, "inner") == 0


def test_of_a_whole_program_only_the_entry_can_be_called_from_outside(fresh):
    compiled = compose(root, {})
    assert compiled(2.0) == root(2.0)
    (dispatcher,) = compiled.made.values()
    (result,) = dispatcher.overloads.values()
    own = [each.name for each in result.library.get_defined_functions()]
    assert all("run" in each or "cpython" in each for each in own if "linkonce" not in each)


@pytest.mark.parametrize("name", ["compilers", "typed_once", "quick_typing"])
def test_each_part_can_be_left_out_and_the_same_is_computed(fresh, name):
    fresh.setattr(numba_internals, "WITHOUT", [name])
    assert compose(root, {})(2.0) == root(2.0)


def test_a_function_is_compiled_once_for_all_constants():
    kernel = typed_once(numba.njit(twice))

    @numba.njit
    def both():
        return kernel(1) + kernel(2)

    assert both() == 6.0
    assert len(kernel.signatures) == 1


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


def test_compiled_code_is_kept_by_ours_and_never_by_numbas_cache(fresh, tmp_path):
    kept = kept_on_disk(numba.njit(twice), "twice")
    assert kept(3.0) == 6.0
    [path] = tmp_path.iterdir()
    assert path.suffix == ".code"
    again = kept_on_disk(numba.njit(twice), "twice")
    again.compile((types.float64,))
    assert again.stats.cache_hits == {(types.float64,): 1}
    assert again(3.0) == 6.0
    # Another type is other code.
    assert kept(3) == 6
    assert len(list(tmp_path.iterdir())) == 2


def test_a_numba_that_is_installed_anywhere_is_not_taken_for_the_users(monkeypatch):
    is_installed = numba_internals.is_installed.__wrapped__
    assert is_installed(numba.__file__)
    assert not is_installed("/home/alice/numba/core/x.py")
    monkeypatch.setattr(numba, "__file__", "/home/alice/numba/__init__.py")
    assert is_installed("/home/alice/numba/core/x.py")


def test_the_text_of_a_type_has_the_names_of_fields_in_their_order():
    first, second = (namedtuple("View", names) for names in ("x y", "y x"))
    texts = {type_text((types.NamedUniTuple(types.float64, 2, kind),)) for kind in (first, second)}
    assert len(texts) == 2
    assert str(ONE.args[1]) in type_text(ONE.args)


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


def test_the_numba_in_use_is_one_that_the_suite_has_passed_with():
    """pyproject.toml states which; a newer one may well do, and this is where it is noticed."""
    import tomllib

    text = Path(flocsim.__file__).parents[1].joinpath("pyproject.toml").read_text("utf-8")
    (stated,) = (d for d in tomllib.loads(text)["project"]["dependencies"] if "numba" in d)
    low, high = re.fullmatch(r"numba>=([\d.]+),<([\d.]+)", stated).groups()
    number = [int(part) for part in numba.__version__.split(".")[:3]]
    assert [int(x) for x in low.split(".")] <= number < [int(x) for x in high.split(".")]
    assert sys.version_info >= (3, 11)
