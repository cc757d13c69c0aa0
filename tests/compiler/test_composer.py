"""The composer: one name per content, never stale, and clear about what it cannot compile."""

import importlib.util
import sys
import warnings

import numba
import numpy as np
import pytest

from flocsim import Body, Sphere, System
from flocsim.compiler import composer, disk_cache
from flocsim.compiler.composer import compile_law, compose
from flocsim.compiler.fingerprint import fingerprint
from flocsim.compiler.numba_internals import COLOURED, call_by_address
from flocsim.errors import KernelError
from flocsim.forces import Contact, Gravity, StokesDrag, VanDerWaals
from flocsim.integrators.loop.driver import advance

MODULE = """\
import math
import numpy
import constants_beside
from constants_beside import OTHER

SCALE = 2.0
TABLE = [1.0]


def doubled(x):
    return 2.0 * x


def scaled(x):
    return SCALE * x


def nested(x):
    return doubled(x) + 1.0


def by_module(x):
    return constants_beside.SCALE * x


def by_function_of_module(x):
    return constants_beside.helper(x)


def imported(x):
    return OTHER * x


def by_default(x, factor=3.0):
    return factor * x


def mutable(x):
    return TABLE[0] * x


def scaled_view(x, parameters):
    return SCALE * x


def unknown(x, parameters):
    return x.no_such_attribute


def outside(x):
    return math.sqrt(x) + numpy.pi
"""

BESIDE = """\
SCALE = 2.0
OTHER = 5.0


def helper(x):
    return 3.0 * x
"""


@pytest.fixture
def load(tmp_path, monkeypatch):
    """A function that (re)writes the two modules with replacements, and imports them afresh."""

    def write(*replacements):
        loaded = None
        for name, text in (("constants_beside", BESIDE), ("kernels", MODULE)):
            for old, new in replacements:
                text = text.replace(old, new)
            path = tmp_path / f"{name}.py"
            path.write_text(text)
            spec = importlib.util.spec_from_file_location(name, path)
            loaded = importlib.util.module_from_spec(spec)
            monkeypatch.setitem(sys.modules, name, loaded)
            exec(compile(text, str(path), "exec"), vars(loaded))
        return loaded

    return write


SIGNATURE = numba.float64(numba.float64, numba.types.CPointer(numba.float64))
by_address = call_by_address(SIGNATURE)


def entry_by_address(address, x, parameters):
    return by_address(address, x, parameters)


EDITS = {
    "scaled": ("SCALE = 2.0\nTABLE", "SCALE = 2.5\nTABLE"),
    "doubled": ("2.0 * x", "2.5 * x"),
    "nested": ("2.0 * x", "2.5 * x"),
    "imported": ("OTHER = 5.0", "OTHER = 5.5"),
    "by_default": ("factor=3.0", "factor=3.5"),
    "by_module": ("SCALE = 2.0\nOTHER", "SCALE = 2.5\nOTHER"),
    "by_function_of_module": ("3.0 * x", "3.5 * x"),
}


@pytest.mark.parametrize("name", EDITS)
def test_the_hash_follows_the_code_and_every_constant_that_it_reads(load, name):
    before = fingerprint(getattr(load(), name), {})
    assert fingerprint(getattr(load(), name), {}) == before
    assert fingerprint(getattr(load(EDITS[name]), name), {}) != before


def test_comments_docstrings_aside_lines_and_files_do_not_matter(load):
    before = fingerprint(load().nested, {})
    moved = load(("SCALE = 2.0\nTABLE", "# a comment\n\n\nSCALE = 2.0\nTABLE"))
    assert fingerprint(moved.nested, {}) == before
    told = load(("def doubled(x):", 'def doubled(x):\n    """Twice x."""'))
    other = load(("def doubled(x):", 'def doubled(x):\n    """2 x."""'))
    assert fingerprint(told.doubled, {}) == fingerprint(other.doubled, {})


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


def test_an_edited_kernel_returns_the_new_physics_from_a_warm_cache(load, tmp_path, monkeypatch):
    folder = tmp_path / "cache"
    monkeypatch.setenv("FLOCSIM_CACHE", str(folder))

    def answer(*edits):
        monkeypatch.setattr(composer, "_composed", {})
        return compose(load(*edits).scaled, {})(3.0)

    def files():
        return sorted(path.name for path in folder.rglob("*.code"))

    assert answer() == 6.0
    first = files()
    assert answer() == 6.0 and files() == first
    assert answer(EDITS["scaled"]) == 7.5
    assert len(files()) == 2 * len(first)
    assert answer() == 6.0 and len(files()) == 2 * len(first)


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


def test_a_law_is_called_by_its_address_and_compiled_anew_only_where_it_was_edited(
    load, tmp_path, monkeypatch
):
    monkeypatch.setenv("FLOCSIM_CACHE", str(tmp_path / "cache"))
    scale = numba.njit(entry_by_address)

    def answer(*edits):
        monkeypatch.setattr(composer, "_composed", {})
        return scale(
            compile_law(load(*edits).scaled_view, "scaled", lambda: SIGNATURE), 3.0, np.ones(1)
        )

    def files():
        return sorted(path.name for path in (tmp_path / "cache").rglob("*.code"))

    assert answer() == 6.0
    first = files()
    assert len(first) == 1
    assert answer() == 6.0 and files() == first
    assert answer(EDITS["scaled"]) == 7.5 and len(files()) == 2


def test_a_law_that_cannot_be_compiled_is_named_by_file_and_line(load):
    with pytest.raises(KernelError, match=r"kernels\.py:\d+: .*use plain arithmetic on scalars"):
        compile_law(load().unknown, "unknown", lambda: SIGNATURE)


def test_a_closure_is_refused_by_file_and_line():
    strength = 2.0

    def kernel(x):
        return strength * x

    with pytest.raises(KernelError, match=rf"\({__file__}:\d+\) captures strength; make it a"):
        compose(kernel, {})


def test_a_mutable_global_is_refused(load):
    with pytest.raises(KernelError, match=r"kernels\.py:\d+\) reads the global 'TABLE', a list"):
        compose(load().mutable, {})


@pytest.mark.parametrize("name", [*EDITS, "outside"])
def test_uncompiled_functions_are_linked_to_the_same_answers(load, name):
    function = getattr(load(), name)
    arguments = (3.0, 4.0) if name == "by_default" else (3.0,)
    assert compose(function, {}, jit=False)(*arguments) == function(*arguments)


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


def test_a_cache_folder_that_cannot_be_written_is_said_once_and_costs_no_result(
    tmp_path, monkeypatch
):
    # A file in the way stops even the superuser, whom no permission bits would.
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("FLOCSIM_CACHE", str(tmp_path / "file" / "cache"))
    monkeypatch.setattr(disk_cache, "_warned", set())
    monkeypatch.setattr(composer, "_composed", {})
    with pytest.warns(UserWarning, match="FLOCSIM_CACHE") as caught:
        assert compose(entry, {hooked: filling})(1.0) == 20.0
    assert len(caught) == 1 and str(tmp_path / "file" / "cache") in str(caught[0].message)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert compose(entry, {})(1.0) == 0.0
    assert list(tmp_path.iterdir()) == [tmp_path / "file"]


def refused_by_the_compiler(x):
    return x.colour


def test_an_error_of_the_compiler_has_no_colours(monkeypatch):
    """As numba writes them where colorama is installed."""

    def colour(self, text):
        return f"\x1b[1m{text}\x1b[0m"

    scheme = type(numba.core.errors.termcolor())
    for name in COLOURED:
        monkeypatch.setattr(scheme, name, colour)
    with pytest.raises(KernelError) as caught:
        compose(refused_by_the_compiler, {})(1.0)
    line = refused_by_the_compiler.__code__.co_firstlineno + 1
    assert f"test_composer.py:{line}: " in str(caught.value)
    assert "\x1b" not in str(caught.value)
    assert scheme.code is colour
