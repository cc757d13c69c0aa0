"""Compiled code that is on the disk runs without numba, and does what it did with it."""

import os
import subprocess
import sys

import numba
import pytest

from flocsim.compiler import processor
from tests.helpers.tiers import rest_slow
from tests.helpers.waiting import PATIENCE

SCRIPT = """
import math, sys
from flocsim.compiler import composer, disk_cache
from flocsim.compiler.composer import compose

def numbers(x, n):
    return math.exp(x) + math.hypot(x, 1.0), n + 1, x > 2.0

def nothing(x):
    x + 1.0

def lent(x):
    return math.gamma(x)

def raising(x):
    if x > 1.0:
        raise ValueError("too large")
    return x

print(compose(numbers, {})(2.5, 3), compose(nothing, {})(1.0), compose(raising, {})(0.5))
try:
    compose(raising, {})(4.0)
except ValueError as error:
    print(error)
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
    assert (raised, loaded, lent) == ("too large", "True", "6.0")
    assert answers.endswith("4, True) None 0.5")
    assert run() == [answers, raised, "False", lent]


def test_settings_are_the_same_whether_numba_is_loaded_or_not(monkeypatch):
    assert numba.config.USING_SVML is False
    loaded = processor.numba_settings()
    monkeypatch.delitem(sys.modules, "numba")
    for name in list(os.environ):
        if name.startswith("NUMBA_"):
            monkeypatch.delenv(name)
    assert processor.numba_settings() is processor.SETTINGS
    assert loaded == processor.SETTINGS


@pytest.mark.parametrize(
    ("name", "value", "told"),
    rest_slow(
        [("NUMBA_OPT", "1", "_OptLevel(1)"), ("NUMBA_CPU_NAME", "generic", "generic")],
        lambda name, value, told: name == "NUMBA_OPT",
    ),
)
def test_what_is_set_in_the_environment_is_told_by_numba(name, value, told):
    code = (
        "from flocsim.compiler.processor import numba_settings, compiled_for\n"
        f"print(numba_settings()[{name[6:]!r}], compiled_for())"
    )
    said = [
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, timeout=PATIENCE, env=env
        ).stdout
        for env in (dict(os.environ), {**os.environ, name: value})
    ]
    assert said[0] != said[1] and said[1].startswith(told)


def test_settings_in_a_file_are_told_whatever_they_set(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    before = processor.compiled_for()
    (tmp_path / processor.CONFIG_FILE).write_text("enable_avx: 0\n")
    assert processor.compiled_for() != before
