"""What every test run shares: one thread per process, no display, repeatable random examples."""

import compileall
import gc
import os
import signal
import sys
from pathlib import Path
from unittest import mock

import pytest
from hypothesis import settings

from flocsim.compiler import disk_cache, units

# Before numpy or numba is imported: they read these once.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(variable, "1")
os.environ.setdefault("MPLBACKEND", "Agg")

# Compiled code of the tests is kept apart from the user's, for all checkouts of this machine: a
# file of it is named by all that it is made of.
CACHE = disk_cache.cache_folder() / "tests"
try:
    CACHE.mkdir(parents=True, exist_ok=True)
except OSError:
    CACHE = Path(__file__).parents[1] / ".pytest_cache" / "flocsim"
os.environ.setdefault("FLOCSIM_CACHE", str(CACHE))

# Hundreds of processes import flocsim. Where Python is told to keep no bytecode, each would compile
# all of its sources first, and every run all of the tests: these are kept all the same.
KEEPS_NO_BYTECODE = sys.dont_write_bytecode
compileall.compile_dir(Path(__file__).parents[1] / "flocsim", quiet=2)
sys.dont_write_bytecode = False


# Nothing of what is collected is garbage, and a worker holds it to its end: it is not looked at.
gc.disable()


def pytest_collection_finish():
    """What tests write and import themselves is left to the settings of Python."""
    sys.dont_write_bytecode = KEEPS_NO_BYTECODE


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop():
    """From here on there is garbage, as in the process that hands out the tests."""
    gc.freeze()
    gc.enable()


# What a test's commands print must not depend on what was compiled before it.
say_what_is_compiled = units.say
units.say = lambda what: None


@pytest.fixture
def speaking(monkeypatch):
    """What is compiled is said, as in a new process."""
    monkeypatch.setattr(units, "say", say_what_is_compiled)
    monkeypatch.setattr(units, "quiet", False)
    monkeypatch.setattr(units, "_said", set())


# A first call may compile a kernel, so a deadline per example would fail on speed alone.
for profile, examples in (("few", 30), ("many", 100)):
    settings.register_profile(profile, deadline=None, derandomize=True, max_examples=examples)


def pytest_configure(config):
    """A property is tried for fewer examples where slow tests are left out."""
    settings.load_profile("few" if "not slow" in config.option.markexpr else "many")


# pytest.approx allows 1e-12 whatever it compares; in SI units that is more than most lengths,
# forces and masses of a floc are, and no test of them could fail. What is allowed is what a test
# says; tests/test_tolerances.py sees that this holds.
type(pytest.approx(1.0)).DEFAULT_ABSOLUTE_TOLERANCE = 0.0


@pytest.fixture
def environment():
    """The environment, as it was before once the test is over."""
    with mock.patch.dict(os.environ):
        yield os.environ


@pytest.fixture
def in_tmp(tmp_path, monkeypatch):
    """A temporary folder, which is the current folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def folder(in_tmp):
    """The current folder, with the small config in it, spheres only."""
    from tests.helpers.small_study import write_small

    write_small(in_tmp, vertices="[1]")
    return in_tmp


@pytest.fixture
def own_cache(tmp_path, environment):
    """A cache of compiled code that is empty at first."""
    environment["FLOCSIM_CACHE"] = str(tmp_path / "cache")
    return tmp_path / "cache"


@pytest.fixture
def at_once(monkeypatch):
    """Nobody waits for another job that writes to a journal, which might just be ending."""
    monkeypatch.setattr("flocsim.io.journal.LOCK_SECONDS", 0.1)


@pytest.fixture
def stopping(monkeypatch):
    """A signal has come that asks this process to stop."""
    monkeypatch.setattr("flocsim.process.INTERRUPTION.signal", signal.SIGTERM)


@pytest.fixture
def uninstalled(monkeypatch):
    """``uninstalled(name)``: Python does not find this library any more."""
    return lambda name: monkeypatch.setitem(sys.modules, name, None)


@pytest.fixture
def one_figure():
    """Of the figures of pairs, only the fourth of Tang et al. (2014) is drawn."""
    from flocsim.io.plots.results import FIGURES

    with mock.patch.dict(FIGURES, {"4": FIGURES["4"]}, clear=True):
        yield


@pytest.fixture
def interruptible():
    """SIGINT raises KeyboardInterrupt, also in what a shell has started in the background, which
    ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)
