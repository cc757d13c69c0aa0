"""numba's private parts: where they are, and that nothing but time hangs on them."""

import gc
import os
import re
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from numba.core import types

import flocsim
from flocsim.compiler import accelerator
from flocsim.compiler.composer import compile_law, compose
from flocsim.compiler.linker import apart
from flocsim.compiler.table_types import Elements
from flocsim.errors import KernelError
from tests.helpers.waiting import PATIENCE


@apart
def twice(x):
    return 2.0 * x


def root(x, parameters):
    return np.sqrt(twice(x)) + twice(x) + parameters[1]


def law(x, parameters):
    return x * parameters[0]


def wrong(x, parameters):
    return x.colour


GIVEN = types.float64, Elements(types.float64, (0,))


@pytest.fixture
def fresh(new_process, monkeypatch):
    """Nothing compiled before is at hand."""
    accelerator.is_on.cache_clear()
    yield monkeypatch
    accelerator.is_on.cache_clear()


def test_this_numba_has_all_parts():
    assert accelerator.is_on()


@pytest.mark.parametrize("absent", ["turned off", "another numba"])
def test_without_the_accelerator_everything_works(fresh, environment, new_process, absent):
    parameters = np.ones(2)
    expected = compose(root, {})(3.0, parameters)
    accelerator.is_on.cache_clear()
    environment["FLOCSIM_CACHE"] += "/other"
    if absent == "turned off":
        environment["FLOCSIM_ACCELERATOR"] = "0"
    else:  # one that has moved a part
        accelerator.pipelines.cache_clear()
        fresh.delattr("numba.core.codegen.JITCodeLibrary")
    assert not accelerator.is_on()
    for _ in range(2):  # compiled, then from the disk
        new_process()
        assert compose(root, {})(3.0, parameters) == expected == root(3.0, parameters)
    assert compile_law(law, "law", lambda: GIVEN) != 0
    with pytest.raises(KernelError, match=r"test_accelerator\.py:\d+: .*colour"):
        compose(wrong, {})(3.0, parameters)


def test_no_other_file_names_a_private_part_of_numba():
    package = Path(flocsim.__file__).parent
    private = re.compile(r"numba\.(core|experimental|np|cpython|typed|misc)\b.*|_nrt\b|fndesc")
    found = {
        (path.name, each[0])
        for path in package.rglob("*.py")
        for each in private.finditer(path.read_text("utf-8"))
        if path.name != "accelerator.py"
    }
    # The class that numba.extending.infer_getattr takes subclasses of.
    base = "numba.core.typing.templates import AttributeTemplate"
    assert found == {("table_types.py", base)}


@pytest.mark.parametrize("collecting", [True, False])
def test_all_is_as_it_was_afterwards(collecting):
    before = vars(types.Function).get("get_call_type"), types.Function.get_call_type
    try:
        gc.enable() if collecting else gc.disable()
        with pytest.raises(KeyboardInterrupt), accelerator.quick_typing():
            assert not gc.isenabled()
            assert types.Function.get_call_type is not before[1]
            raise KeyboardInterrupt
        assert gc.isenabled() == collecting
    finally:
        gc.enable()
    assert (vars(types.Function).get("get_call_type"), types.Function.get_call_type) == before


SCRIPT = """
import math, sys
from flocsim.compiler.composer import compose
from flocsim.compiler import units
units.quiet = True

def numbers(x, n):
    return math.exp(x) + math.hypot(x, 1.0), n + 1, x > 2.0

def nothing(x):
    x + 1.0

def lent(x):
    return math.gamma(x)

def raising(x):
    return (0.5, 1.5)[int(x)]

print(compose(numbers, {})(2.5, 3), compose(nothing, {})(1.0), compose(raising, {})(0.5))
try:
    compose(raising, {})(4.0)
except Exception:
    print("raised")
print("numba" in sys.modules)
print(compose(lent, {})(4.0))
"""


def test_a_later_process_needs_no_numba_but_where_numba_lends_something(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    env = {**os.environ, "FLOCSIM_CACHE": str(tmp_path / "cache")}

    def run():
        words = [sys.executable, str(script)]
        done = subprocess.run(words, capture_output=True, text=True, timeout=PATIENCE, env=env)
        assert (done.returncode, done.stderr) == (0, "")
        return done.stdout.splitlines()

    answers, raised, loaded, lent = run()
    assert (raised, loaded, lent) == ("raised", "True", "6.0")
    assert answers.endswith("4, True) None 0.5")
    assert run() == [answers, raised, "False", lent]


def bound():
    text = Path(flocsim.__file__).parents[1].joinpath("pyproject.toml").read_text("utf-8")
    return re.search(r'"numba>=([\d.]+)"', text)[1]


def test_numba_has_no_upper_bound():
    number = [int(part) for part in numba.__version__.split(".")[:3]]
    assert [int(x) for x in bound().split(".")] <= number
