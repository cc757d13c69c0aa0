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
    compilers,
    quick_typing,
    returned_as,
)
from flocsim.errors import KernelError


def root(x):
    return np.sqrt(twice(x)) + twice(x)


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


@pytest.mark.parametrize("name", ["compilers", "typed_once", "quick_typing"])
def test_each_part_can_be_left_out_and_the_same_is_computed(fresh, name):
    fresh.setattr(numba_internals, "WITHOUT", [name])
    assert compose(root, {})(2.0) == root(2.0)


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
