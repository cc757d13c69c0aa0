"""What tests of compiled code share: modules that are edited and imported afresh."""

import importlib.util
import re
import sys

import pytest

from flocsim.compiler import composer

NEIGHBOURS = {
    "deeper": "K = @\n",
    "colorsys": "LIST = [@]\n",
    "beside": """\
import numba
import deeper
K = @
LIST = [@]
def helper(x):
    return @ * x
@numba.njit
def fast(x):
    return K * x
def through(x):
    return deeper.K * x
""",
}
"""Modules that a kernel may import; @ stands for a number."""


@pytest.fixture
def new_process(own_cache):
    """``new_process()`` forgets what this process has compiled, but for what is on the disk."""
    composer._composed.clear()
    return composer._composed.clear


@pytest.fixture
def load(new_process, tmp_path, monkeypatch):
    """``load(text, number)`` writes a module and its neighbours and imports them afresh."""

    def write(text, number):
        loaded = None
        for name, source in {**NEIGHBOURS, "kernels": text}.items():
            path = tmp_path / f"{name}.py"
            path.write_text(re.sub(r"@(?!\w)", str(number), source))  # not the decorators
            spec = importlib.util.spec_from_file_location(name, path)
            loaded = importlib.util.module_from_spec(spec)
            monkeypatch.setitem(sys.modules, name, loaded)
            exec(compile(path.read_text(), str(path), "exec"), vars(loaded))
        return loaded

    return write
