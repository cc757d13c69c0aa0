"""A script of examples/, to be tested."""

import importlib.util

from tests.helpers.small_study import ROOT


def example_script(name):
    """The module of examples/name.py."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "examples" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
