"""The integrators that every generic test is run with, so that a new one meets all of them."""

import pytest

from flocsim.integrators import DormandPrince54, Implicit, VelocityVerlet

METHODS = [VelocityVerlet(1e-8), DormandPrince54(1e-10), Implicit(1e-10)]
"""Overdamped is not among them: it has no inertia, which most of these tests rely on."""

ADAPTIVE = METHODS[1:]


def name_of(integrator):
    """How a test's name calls an integrator."""
    return type(integrator).__name__


by_method = pytest.mark.parametrize("integrator", METHODS, ids=name_of)
by_adaptive = pytest.mark.parametrize("integrator", ADAPTIVE, ids=name_of)


def by_setting(*cases):
    """Parametrises ``integrator`` and ``allowed`` by pairs of them."""
    return pytest.mark.parametrize(
        ("integrator", "allowed"), cases, ids=[name_of(case[0]) for case in cases]
    )
