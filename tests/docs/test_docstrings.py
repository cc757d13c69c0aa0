"""Exported classes and functions describe their arguments and what they return."""

import importlib
import inspect

import pytest

ROOMS = ["", ".ensembles", ".forces", ".hydrodynamics", ".integrators"]
EXPORTED = {
    f"{each.__module__}.{each.__qualname__}": each
    for room in map(importlib.import_module, (f"flocsim{room}" for room in ROOMS))
    for each in (getattr(room, name) for name in room.__all__)
    if callable(each)
}
MADE_BY_FLOCSIM = (
    "Results",
    "Comparison",
    "Trajectory",
    "State",
    "Status",
    "Relative",
    "PrismDrag",
)
CONTRACTS = ("Force", "Shape", "Integrator")


@pytest.mark.parametrize("name", EXPORTED)
def test_it_has_the_sections_that_it_needs(name):
    found = EXPORTED[name]
    sections = inspect.getdoc(found).partition("\n\n")[2]
    if not inspect.isclass(found):
        assert "Returns\n----" in sections
    if inspect.isabstract(found) or name.endswith(CONTRACTS):
        assert "Notes\n----" in sections or "Parameters\n----" in sections
    elif name.endswith(MADE_BY_FLOCSIM):
        assert "Attributes\n----" in sections or name.endswith("Status")
    elif inspect.signature(found).parameters:
        assert "Parameters\n----" in sections
