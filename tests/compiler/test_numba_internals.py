"""What flocsim knows of numba's private parts still holds: every part that fails here is named."""

import gc
import re
import sys
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
    UNWRAPPED,
    call_by_address,
    compilers,
    object_code,
    quick_typing,
    remembering,
    returned_as,
    typed_once,
)
from flocsim.errors import KernelError

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


OPTIONS = {"nogil": True, **NO_COUNTING, **UNWRAPPED}


def address_of(function):
    """The address of a compiled function (number, parameters)."""
    with quick_typing():
        code, _, lasts = object_code(function, ONE.args, {**OPTIONS, **compilers()[1]})
    assert lasts
    return code.load()


def test_a_function_is_called_by_its_address():
    assert calling(address_of(scaled), 3.0, np.array([2.0])) == 6.0


def test_what_a_function_raises_comes_through_a_call_by_address():
    address = address_of(failing)
    assert calling(address, 3.0, np.ones(1)) == 3.0
    with pytest.raises(ValueError, match="below zero"):
        calling(address, -3.0, np.ones(1))


def test_arguments_of_other_types_are_refused_when_compiled():
    with pytest.raises(numba.TypingError, match="a law takes"):
        calling(1, 3, np.ones(1))
    with pytest.raises(numba.TypingError, match="a law takes"):
        calling(1, 3.0, np.ones(4)[::2])


def test_inner_functions_are_linked_and_have_no_machine_code(fresh):
    linked, _, _ = numba_internals.libraries()
    asked = []
    fresh.setattr(linked, "finalize", lambda self: asked.append(self.name))
    assert linked.get_pointer_to_function(None, "inner") == 0


def test_of_a_whole_program_only_the_entry_can_be_called_from_outside(fresh):
    seen = []
    real = numba_internals.ObjectCode

    def taken(code, entry, *more):
        seen.append((code, entry))
        return real(code, entry, *more)

    fresh.setattr(numba_internals, "ObjectCode", taken)
    assert compose(root, {})(2.0) == root(2.0)
    [(code, entry)] = seen
    names = set(re.findall(rb"_ZN\d+[^\0]*", code))
    assert [name for name in names if b"NumbaEnv" not in name] == [entry.encode()]


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


RETURNED = [
    (types.none, ""), (types.float64, "d"), (types.boolean, "?"), (types.literal(3), "q"),
    (types.Tuple((types.float64, types.boolean)), "d?"), (types.UniTuple(types.int64, 2), "qq"),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "expected"), RETURNED, ids=str)
def test_what_is_returned_is_read_as_it_lies(kind, expected):
    assert returned_as(kind) == expected


@pytest.mark.parametrize("kind", [types.complex128, types.float64[:], types.unicode_type], ids=str)
def test_what_is_no_number_is_not_returned(kind):
    with pytest.raises(KernelError, match="let it return numbers"):
        returned_as(kind)


def test_a_numba_that_is_installed_anywhere_is_not_taken_for_the_users(monkeypatch):
    is_installed = numba_internals.is_installed.__wrapped__
    assert is_installed(numba.__file__)
    assert not is_installed("/home/alice/numba/core/x.py")
    monkeypatch.setattr(numba, "__file__", "/home/alice/numba/__init__.py")
    assert is_installed("/home/alice/numba/core/x.py")


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
