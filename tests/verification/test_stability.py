"""A fixed part of the stability table: every family over its ranges, right or clearly failed.

The table itself is benchmarks/stability/run.py; here some of its cases go through the same
functions, in this process and without a limit of time.
"""

import numpy as np
import pytest

from benchmarks.stability.families import family_of
from benchmarks.stability.spheres import bounce, resting_overlap, settle
from benchmarks.stability.verdict import judge
from flocsim.integrators import Status
from tests.helpers.tiers import rest_slow
from tests.reference.closed_forms import impact

LONG = 600
"""Cases of the long run: the first of the table."""

FEW_SCENES = (
    "free spinning", "sphere impact", "deep overlap", "polygon impact", "sliver impact",
    "spinning impact", "unloaded rest",
)  # fmt: skip
"""Families of the default run: they share three compiled scenes."""

SHORT = [index for index in range(130) if family_of(index) in FEW_SCENES]

TYPED = {"REFUSED", *(status.name for status in Status)}


def assert_right_or_typed(index):
    """The case comes out right, or as a failure with a name."""
    verdict = judge(index)
    assert verdict.kind in ("right", "stated", "typed"), f"{verdict.family}: {verdict.detail}"
    assert verdict.kind != "typed" or verdict.detail.split()[0] in TYPED


@pytest.mark.parametrize("index", rest_slow(SHORT, lambda index: index < 14))
def test_cases_of_few_scenes(index):
    assert_right_or_typed(index)


@pytest.mark.slow
@pytest.mark.parametrize("index", [each for each in range(LONG) if each not in SHORT])
def test_more_cases(index):
    assert_right_or_typed(index)


@pytest.mark.parametrize("tension", [True, False])
@pytest.mark.parametrize("z", [0.0, 0.05, 0.3, 0.7, 0.95, 1.0, 1.5, 3.0])
def test_closed_form_of_an_impact(z, tension):
    """Parting at the restitution of Schwager & Pöschel, as the plain reference integrates it."""
    restitution, lasted, deepest = impact(z, tension)
    end = min(lasted, 50.0)
    gaps = [bounce(0.0, 1.0, 1.0, z, tension, end + after)[0] for after in (1.0, 2.0)]
    if np.isfinite(lasted):
        assert gaps[1] - gaps[0] == pytest.approx(restitution, rel=1e-8)
    assert bounce(0.0, 1.0, 1.0, z, tension, end + 2.0)[1] == pytest.approx(deepest, rel=1e-5)


def test_closed_form_of_rest_and_of_settling():
    assert resting_overlap(3.0, 2.0, 4.0, 1e3)[0] == pytest.approx(0.75)
    assert resting_overlap(3.0, 2.0, 0.0, 0.5 * np.pi)[1] == pytest.approx(1.5)
    assert settle(0.0, 2.0, 1e-9, 3.0) == pytest.approx(6.0)
    assert settle(5.0, 0.0, 1e9, 3.0) == pytest.approx(15.0)
