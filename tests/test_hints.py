"""Whatever the packages export says what it takes and returns; kernels, which numba types, do not.

mypy checks that hints are right (setup.cfg); here it is that none is missing.
"""

import importlib
import inspect

import pytest

from flocsim.forces import Force
from flocsim.integrators import Integrator

PACKAGES = [
    "flocsim", "flocsim.forces", "flocsim.integrators", "flocsim.geometry.fit", "flocsim.ensembles",
]  # fmt: skip


def public_functions(name, exported):
    """(name, function) of an exported function, or of all public methods of a class of flocsim."""
    if inspect.isfunction(exported):
        yield name, exported
    if not inspect.isclass(exported):
        return
    for owner in exported.__mro__:
        if not owner.__module__.startswith("flocsim"):
            continue
        for attribute, value in vars(owner).items():
            if isinstance(value, staticmethod) and issubclass(owner, Force | Integrator):
                continue  # A kernel.
            if isinstance(value, staticmethod | classmethod):
                value = value.__func__
            elif isinstance(value, property):
                value = value.fget
            value = getattr(value, "func", value)  # Of a cached property.
            if inspect.isfunction(value) and not attribute.startswith("_"):
                yield f"{owner.__module__}.{owner.__name__}.{attribute}", value


def missing_hints(function):
    """Parameters without a hint, and "return"."""
    parameters = list(inspect.signature(function).parameters)
    if parameters[:1] in (["self"], ["cls"]):
        parameters = parameters[1:]
    return [each for each in [*parameters, "return"] if each not in function.__annotations__]


@pytest.mark.parametrize("package", PACKAGES)
def test_what_is_exported_has_hints(package):
    module = importlib.import_module(package)
    bare = {
        name: missing
        for exported in module.__all__
        for name, function in public_functions(exported, getattr(module, exported))
        if (missing := missing_hints(function))
    }
    assert not bare
