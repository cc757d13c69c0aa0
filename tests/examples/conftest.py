"""Scripts of examples/tang2014, imported as they import each other."""

import importlib
import sys

import pytest

from tests.helpers.small_study import ROOT

FOLDER = ROOT / "examples" / "tang2014"


@pytest.fixture
def example(monkeypatch):
    """Import a script of the example by its name."""
    before = set(sys.modules)
    monkeypatch.syspath_prepend(str(FOLDER))
    yield importlib.import_module
    for name in set(sys.modules) - before:
        if str(FOLDER) in str(getattr(sys.modules[name], "__file__", "")):
            del sys.modules[name]
