"""Too little address space is told in one line before a library hangs or crashes for want of it."""

import os
import resource
import subprocess
import sys

import pytest

from flocsim import process
from tests.helpers.tiers import rest_slow
from tests.helpers.waiting import PATIENCE


def limited(size, *words):
    """A command that may take so many bytes of address space, ended."""
    limit = lambda: resource.setrlimit(resource.RLIMIT_AS, (size, size))  # noqa: E731
    env = {name: value for name, value in os.environ.items() if name != process.BLAS_THREADS}
    return subprocess.run(
        [sys.executable, *words], preexec_fn=limit, env=env, capture_output=True, text=True,
        timeout=PATIENCE,
    )  # fmt: skip


@pytest.mark.parametrize("size", rest_slow([150e6, 300e6, 500e6], lambda size: size == 300e6))
@pytest.mark.parametrize("words", [["flocsim.ensemble", "none.toml"], ["flocsim", "info", "none"]])
def test_too_little_to_load_the_libraries_is_one_line(size, words):
    done = limited(int(size), "-m", *words)
    [line] = done.stderr.splitlines()
    assert done.returncode == 70
    assert line.startswith(f"flocsim: the address space is limited to {size / 1e6:.0f} MB")
    assert "ulimit -v" in line


def test_enough_to_load_them_is_enough():
    done = limited(int(process.LOADING), "-m", "flocsim.ensemble", "none.toml")
    assert done.returncode == 2
    assert done.stderr.startswith("flocsim: none.toml: no such file")


SCRIPT = """
from flocsim.compiler.composer import compose
from flocsim.errors import FlocsimError

def entry(x):
    return 5.0 * x + 2.0

try:
    print(compose(entry, {})(1.0))
except FlocsimError as error:
    print(error)
"""


def test_too_little_to_compile_is_one_line(tmp_path, own_cache):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    said = "the address space is limited to 1000 MB, and compiling takes 1500 MB"
    assert limited(10**9, str(script)).stdout.startswith(said)
    assert limited(2 * 10**9, str(script)).stdout == "7.0\n"


@pytest.mark.skipif(process.is_limited(), reason="there is a limit")
def test_without_a_limit_nothing_is_changed(environment):
    environment.pop(process.BLAS_THREADS, None)
    process.check_memory()
    assert process.BLAS_THREADS not in environment
    assert process.lacking(process.COMPILING, "compiling") == ""
