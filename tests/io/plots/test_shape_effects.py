"""Pr[A] against shapes: shares of variance by closed forms, bins, what is left out."""

import numpy as np
import pytest

from flocsim.io.confidence import explained_share
from flocsim.io.plots.outcomes import shape_effect
from flocsim.io.results.schema import BLANKS, OUTCOMES, REPLICATES


def rows_of(outcome, **columns):
    """Rows (delta, replicate) with these outcomes; the rest is blank."""
    outcome = np.asarray(outcome)
    rows = {name: np.full(outcome.shape, BLANKS[kind]) for name, (kind, _, _) in REPLICATES.items()}
    rows |= {
        name: np.broadcast_to(each, outcome.shape).astype(REPLICATES[name][0])
        for name, each in columns.items()
    }
    return rows | {
        "outcome": outcome,
        "inside": np.where(outcome < 2, 1, np.where(outcome < 4, 0, 255)),
        "bond": np.where(np.isin(outcome, [0, 2]), 1, 255),
    }


def drawn(probabilities, count, seed=0, deltas=1):
    """Rows of replicates of which every ``k``-th has a circularity of its own, and Pr[A]."""
    rng = np.random.default_rng(seed)
    kind = rng.integers(0, len(probabilities), count)
    outcome = np.where(rng.random((deltas, count)) < np.array(probabilities)[kind], 0, 1)
    shape = 0.3 + 0.1 * kind
    return rows_of(
        outcome, circularity_i=shape, circularity_j=shape, aspect_ratio_i=1.0 + rng.random(count),
        aspect_ratio_j=1.5, solidity_i=0.9, solidity_j=0.9, r_i=2e-6, r_j=1e-6,
        floc_i=kind, floc_j=kind,
    )  # fmt: skip


def test_what_decides_by_a_known_share_is_said_to():
    """Pr of .2 and .8, half each: the variance between is .09, of an outcome .25."""
    found = shape_effect(drawn([0.2, 0.8], 20_000), "circularity")
    assert found.explained[0] == pytest.approx(0.36, abs=0.02)
    assert found.by_pair[0] == pytest.approx(found.explained[0])
    assert found.measure.tolist() == pytest.approx([0.3, 0.4])
    assert found.pr_a[0] == pytest.approx([0.2, 0.8], abs=0.02)
    assert np.all(found.pr_a[1] < [0.2, 0.8]) and np.all(found.pr_a[2] > [0.2, 0.8])
    assert found.pr_class[0].sum(axis=0) == pytest.approx([1.0, 1.0])


def test_what_does_not_matter_explains_nothing():
    found = shape_effect(drawn([0.2, 0.8], 5000), "aspect_ratio")
    assert found.explained[0] < 0.005 and found.explained[1] == 0.0
    assert len(found.measure) == 5 and np.all(np.diff(found.measure) > 0)


def test_one_value_explains_no_variance():
    for name in ("solidity", "size_ratio"):
        found = shape_effect(drawn([0.2, 0.8], 100), name)
        assert len(found.measure) == 1 and np.isnan(found.explained).all()
    assert found.measure == pytest.approx([0.5])


@pytest.mark.slow
def test_intervals_hold_the_share_95_times_in_100():
    held = 0
    for seed in range(300):
        rows = drawn([0.3, 0.5, 0.7], 200, seed)
        _, low, high = shape_effect(rows, "circularity").explained
        held += low <= 0.08 / 3 / 0.25 <= high
    assert 0.91 <= held / 300 <= 0.99


def test_equal_groups_share_nothing_and_apart_all():
    assert explained_share(np.repeat([0, 1], 4), np.repeat([0.0, 1.0], 4)) == (1.0, 1.0, 1.0)
    assert explained_share(np.repeat([0, 1], 4), np.tile([0.0, 1.0], 4))[0] == 0.0
    assert np.isnan(explained_share(np.zeros(5, int), np.arange(5.0))).all()
    assert np.isnan(explained_share(np.arange(5), np.arange(5.0))).all()


def test_replicates_without_an_outcome_or_a_shape_are_left_out():
    rows = drawn([0.5, 0.5], 50)
    failed = OUTCOMES.index("failed")
    rows["outcome"] = np.where(np.arange(50) < 5, failed, rows["outcome"])
    rows["inside"] = np.where(rows["outcome"] == failed, 255, rows["inside"])
    rows["bond"] = np.where(rows["outcome"] == failed, 255, rows["bond"])
    for name in ("circularity_i", "circularity_j"):
        rows[name] = np.where(np.arange(50) < 3, np.nan, rows[name])
    found = shape_effect(rows, "circularity")
    assert np.isfinite(found.pr_a).all()


def test_the_share_of_a_large_study_has_an_interval():
    """The noncentral F distribution underflows far from it."""
    groups = np.arange(100_000) % 8
    values = groups + np.random.default_rng(1).normal(0.0, 9.0, len(groups))
    share, low, high = explained_share(groups, values)
    assert 0.0 < low < share < high < low + 0.01
