"""The integrators that every generic test is run with, so that a new one meets all of them."""

import pytest

from flocsim.integrators import DormandPrince54, Implicit, VelocityVerlet
from tests.helpers.tiers import rest_slow

METHODS = [VelocityVerlet(1e-8), DormandPrince54(1e-10), Implicit(1e-10)]
"""Overdamped is not among them: it has no inertia, which most of these tests rely on."""

ADAPTIVE = METHODS[1:]


def name_of(integrator):
    """How a test's name calls an integrator."""
    return type(integrator).__name__


def is_adaptive(integrator, *_):
    """What is tried by default; VelocityVerlet by the slow run, and by default uncompiled: by
    tests/integrators/test_order.py and test_methods_battery.py."""
    return not isinstance(integrator, VelocityVerlet)


by_method = pytest.mark.parametrize("integrator", rest_slow(METHODS, is_adaptive), ids=name_of)
by_adaptive = pytest.mark.parametrize("integrator", ADAPTIVE, ids=name_of)


def by_setting(*cases):
    """Parametrises ``integrator`` and ``allowed`` by pairs of them."""
    ids = [name_of(case[0]) for case in cases]
    return pytest.mark.parametrize(
        ("integrator", "allowed"), rest_slow(cases, is_adaptive), ids=ids
    )
