"""A fixed part of the stability table: every family over its ranges, right or clearly failed.

The table itself is benchmarks/stability/run.py; here some of its cases go through the same
functions, in this process and without a limit of time.
"""

import pytest

from benchmarks.stability.families import family_of
from benchmarks.stability.verdict import judge
from flocsim.integrators import Status
from tests.helpers.tiers import rest_slow

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
