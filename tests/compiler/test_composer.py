"""The composer: one name per content, never stale, and clear about what it cannot compile."""

import numba
import numpy as np
import pytest

from flocsim import Body, Sphere, System
from flocsim.compiler.composer import compile_law, compose
from flocsim.compiler.fingerprint import fingerprint
from flocsim.compiler.table_types import Elements, call_of
from flocsim.errors import KernelError
from flocsim.forces import Contact, Gravity, StokesDrag, VanDerWaals
from flocsim.integrators.loop.driver import advance

GIVEN = numba.float64, Elements(numba.float64, (0,))
NOTHING = np.zeros(2, dtype=np.int64)
"""A table of an array without numbers: its address, its size."""
scale_by_address = numba.njit(call_of(lambda given: ("", "d")))


SCALED = "SCALE = @\n\ndef scaled(x):\n    return SCALE * x\n"
SCALED_LAW = "SCALE = @\n\ndef scaled(x, parameters):\n    return SCALE * x\n"
DOUBLED = 'def doubled(x):\n    """{}"""\n    return 2.0 * x\n'


def test_comments_docstrings_and_lines_do_not_matter(load):
    first = load(DOUBLED.format("Twice x."), 2).doubled
    second = load("# a comment\n\n" + DOUBLED.format("2 x."), 2).doubled
    assert fingerprint(first, {}) == fingerprint(second, {})


def test_which_of_two_functions_of_one_name_is_called_matters():
    def one(x):
        return 1.0

    def two(x):
        return 2.0

    one.__qualname__ = two.__qualname__ = "helper"

    def calling(third):
        known = {"a": plain("a", one), "b": plain("b", two), "c": plain("c", third)}
        entry = "def entry(x):\n    return a(x) + 10.0 * b(x) + 100.0 * c(x)\n"
        exec(entry, known)
        return known["entry"]

    def plain(name, helper):
        known = {"helper": helper}
        exec(f"def {name}(x):\n    return helper(x)\n", known)
        return known[name]

    assert fingerprint(calling(one), {}) != fingerprint(calling(two), {})
    composed = [compose(calling(helper), {}, jit=False)(0.0) for helper in (one, two)]
    assert composed == [121.0, 221.0]


def as_function(kernels):
    return compose(kernels.scaled, {})(3.0)


def as_law(kernels):
    law = compile_law(kernels.scaled, "scaled", lambda: GIVEN)
    return scale_by_address(law, 3.0, NOTHING.ctypes.data)


@pytest.mark.parametrize("text, answer", [(SCALED, as_function), (SCALED_LAW, as_law)])
def test_edited_code_returns_the_new_physics_from_a_warm_cache(
    load, own_cache, new_process, text, answer
):
    def answer_of(number):
        new_process()
        return answer(load(text, number)), len(list(own_cache.rglob("*.code")))

    assert answer_of(2.0) == answer_of(2.0) == (6.0, 1)
    assert answer_of(2.5) == answer_of(2.5) == (7.5, 2)
    assert answer_of(2.0) == (6.0, 2)


def fingerprints(*forces, density=2650.0):
    """{what is compiled: its fingerprint} of two spheres with these forces."""
    system = System([Body(Sphere(5e-6), density=density)] * 2, forces)
    laws = {name: fingerprint(law, {}) for name, law in system.pieces.laws.items()}
    return {"engine": fingerprint(advance, system.fillings()), **laws}


def test_parameter_values_leave_the_hashes_alone_and_other_forces_change_laws_only():
    found = fingerprints(Gravity(9.81), VanDerWaals(1e-18), Contact(20.0))
    assert found == fingerprints(Gravity(1.6), VanDerWaals(1e-20), Contact(7.0))
    assert found == fingerprints(Gravity(), VanDerWaals(), Contact(), density=1100.0)
    surface = fingerprints(Gravity(), VanDerWaals(gap="surface"), Contact())
    assert surface.keys() ^ found.keys() == {
        "centre_force", "centre_derivatives", "surface_force", "surface_derivatives",
    }  # fmt: skip
    dragged = fingerprints(Gravity(), StokesDrag(), VanDerWaals(), Contact())
    assert dragged["body_force"] != found["body_force"]
    for others in (surface, dragged):
        for name in ("engine", "contact_force"):
            assert others[name] == found[name]


def test_a_law_that_cannot_be_compiled_is_named_by_file_and_line(load):
    with pytest.raises(KernelError, match=r"kernels\.py:\d+: .*use plain arithmetic on scalars"):
        kernels = load("def unknown(x, parameters):\n    return x.no_such_attribute\n", 2)
        compile_law(kernels.unknown, "unknown", lambda: GIVEN)


def test_a_law_that_raises_is_told_from_one_that_answers(load):
    text = "def f(x, p):\n    return (3.0, 4.0)[int(x)]\n"
    law = compile_law(load(text, 2).f, "f", lambda: GIVEN)
    assert scale_by_address(law, 0.0, NOTHING.ctypes.data) == 3.0
    with pytest.raises(RuntimeError):
        scale_by_address(law, 2.0, NOTHING.ctypes.data)


def hooked(x):
    return 0.0


def filling(x):
    return x + 1.0


def entry(x):
    return 10.0 * hooked(x)


def test_hooks_are_filled_in_the_clone_and_nowhere_else():
    assert compose(entry, {hooked: filling}, jit=False)(1.0) == 20.0
    assert compose(entry, {}, jit=False)(1.0) == 0.0 == entry(1.0)
    assert fingerprint(entry, {hooked: filling}) != fingerprint(entry, {})


def refused_by_the_compiler(x):
    return x.colour


@pytest.mark.parametrize("colours", ["no_color", "dark_bg"])
def test_an_error_of_the_compiler_has_no_colours(monkeypatch, colours):
    """Where colorama is installed, numba writes some."""
    monkeypatch.setattr(numba.config, "COLOR_SCHEME", colours)
    with pytest.raises(KernelError) as caught:
        compose(refused_by_the_compiler, {})(1.0)
    line = refused_by_the_compiler.__code__.co_firstlineno + 1
    assert f"test_composer.py:{line}: " in str(caught.value)
    assert "x1b" not in str(caught.value)
