"""Differences from paired replicates, and pooled probabilities with correlated ones."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flocsim.ensembles.estimates.statistics import (
    clustered_probabilities,
    joint_counts,
    newcombe,
    paired_differences,
    pooled_sums,
    scrambled_difference,
)
from flocsim.io.confidence import wilson
from flocsim.io.results.schema import NOT_APPLICABLE
from tests.helpers.synthetic_results import bonds_of, draw_codes
from tests.helpers.tabulate import tabulate

CELLS = st.tuples(*[st.integers(0, 60)] * 4).filter(any)


@given(CELLS)
def test_exchanging_the_two_changes_the_sign(cells):
    both, here, there, neither = cells
    difference, low, high = newcombe(*cells)
    # So does exchanging success and failure.
    for mirrored in (newcombe(both, there, here, neither), newcombe(neither, there, here, both)):
        np.testing.assert_allclose(mirrored, (-difference, -high, -low), atol=1e-12)
    assert -1.0 <= low <= difference <= high <= 1.0


def test_without_correlation_the_two_wilson_intervals_are_joined_by_squares():
    one, low, high = newcombe(25, 25, 25, 25)
    below, above = wilson(50, 100)
    assert (one, -low) == (0.0, high)
    assert high == pytest.approx(np.hypot(above - 0.5, 0.5 - below), rel=1e-12)


def test_pairs_that_agree_tell_more_than_independent_samples():
    def width(cells):
        _, low, high = newcombe(*cells)
        return high - low

    assert width((45, 5, 5, 45)) < 0.6 * width((25, 25, 25, 25))


@pytest.mark.parametrize(
    ("p", "q", "overlap"), [(0.5, 0.4, 0.35), (0.9, 0.7, 0.68), (0.2, 0.2, 0.1)]
)
def test_the_interval_covers_as_often_as_it_says(p, q, overlap):
    rng = np.random.default_rng(5)
    shares = [overlap, p - overlap, q - overlap, 1.0 - p - q + overlap]
    _, low, high = newcombe(*rng.multinomial(80, shares, 4000).T)
    covered = np.mean((low <= p - q) & (p - q <= high))
    assert 0.935 < covered < 0.985


def test_joint_counts_are_the_counts_of_pairs():
    outcome, inside, bond = draw_codes(np.random.default_rng(1), (2, 3, 2, 50))
    joint = joint_counts(outcome, inside)
    assert joint.shape == (3, 3, 2, 2, 3, 2, 4)
    known = joint[0]
    table = tabulate(outcome, inside, bond)
    # Against itself an event happens in both or in neither.
    for axis, first in enumerate([np.s_[0], np.s_[:, 0], np.s_[:, :, 0]]):
        own = known[axis][(slice(None), *([first] if axis == 0 else first))]
        assert not own[..., 1:3].any()
        assert np.all(own[0][..., 0] == table["n_inside"][first])
    # One pair of conditions, counted plainly: N = the second against the first, by replicate.
    decided = (outcome < 4) & (outcome[:, :1] < 4)
    a, b = np.isin(outcome, [0, 2]), np.isin(outcome[:, :1], [0, 2])
    np.testing.assert_array_equal(known[1, 1, ..., 1], (decided & a & ~b).sum(axis=-1))
    np.testing.assert_array_equal(known[1, 1].sum(axis=-1), decided.sum(axis=-1))


def test_blocks_of_replicates_add_up():
    outcome, inside, bond = draw_codes(np.random.default_rng(2), (1, 2, 3, 40))
    parts = [np.s_[..., :13], np.s_[..., 13:]]
    np.testing.assert_array_equal(
        joint_counts(outcome, inside), sum(joint_counts(outcome[p], inside[p]) for p in parts)
    )
    whole = pooled_sums(outcome, inside, bond)
    sums = [pooled_sums(outcome[p], inside[p], bond[p]) for p in parts]
    for name in whole:
        np.testing.assert_array_equal(whole[name], sums[0][name] + sums[1][name])


def test_no_pairs_give_nan():
    outcome = np.full((1, 1, 2, 3), 4)
    table = paired_differences(joint_counts(outcome, np.full(outcome.shape, NOT_APPLICABLE)))
    assert np.isnan(table["difference"]).all() and np.isnan(table["difference_low"]).all()
    assert not table["n_pairs"].any()


def independent(shape, seed=3):
    """Codes of collisions that are decided, inside, and aggregate half of the time."""
    outcome = np.random.default_rng(seed).integers(0, 2, shape)
    return outcome, np.ones(shape, int), bonds_of(outcome)


def test_independent_displacements_are_worth_their_number():
    table = clustered_probabilities(pooled_sums(*independent((1, 2, 5, 4000))))
    effective = table["n_effective_pr_a"]
    assert np.all((effective > 0.9 * 20_000) & (effective <= 20_000))
    np.testing.assert_allclose(table["pr_inside"], 1.0)


def test_displacements_that_all_agree_are_worth_one():
    codes = independent((1, 1, 1, 4000))
    pooled = clustered_probabilities(pooled_sums(*(np.repeat(code, 5, axis=2) for code in codes)))
    alone = clustered_probabilities(pooled_sums(*codes))
    np.testing.assert_allclose(pooled["n_effective_pr_a"], 4000, rtol=1e-3)
    np.testing.assert_allclose(pooled["pr_a_low"], alone["pr_a_low"], rtol=1e-3)


def test_no_events_pooled_give_nan():
    outcome = np.full((1, 1, 2, 3), 4)
    table = clustered_probabilities(
        pooled_sums(outcome, *[np.full(outcome.shape, NOT_APPLICABLE)] * 2)
    )
    assert all(np.isnan(values).all() for values in table.values())


def test_differences_of_scrambles_cover_and_tell_more_than_independent_points():
    """Points of a scramble are even: both events depend on a grid shifted at random."""
    rng = np.random.default_rng(2)
    places = (np.arange(32) + rng.random((400, 16, 1))) / 32.0
    here, there = places < 0.63, places < 0.5
    flags = (here & there, here & ~there, ~here & there, ~here & ~there)
    cells = np.stack([np.sum(each, axis=-1) for each in flags], axis=-1)
    difference, low, high = scrambled_difference(cells)
    assert 0.93 < np.mean((low <= 0.13) & (high >= 0.13)) <= 1.0
    np.testing.assert_allclose(scrambled_difference(cells[..., [0, 2, 1, 3]])[0], -difference)
    _, plain_low, plain_high = newcombe(*np.moveaxis(cells.sum(axis=1), -1, 0))
    assert np.mean(high - low) < 0.5 * np.mean(plain_high - plain_low)


def test_joint_counts_of_scrambles_add_up_to_those_of_all():
    codes = draw_codes(np.random.default_rng(6), (2, 2, 3, 64))[:2]
    whole = joint_counts(*codes)
    parts = joint_counts(*codes, 0, 16)
    np.testing.assert_array_equal(parts.sum(axis=-2), whole)
    late = [each[..., 5:] for each in codes]
    early = joint_counts(*(each[..., :5] for each in codes), 0, 16)
    np.testing.assert_array_equal(early + joint_counts(*late, 5, 16), parts)
    found = paired_differences(parts, scrambled=True)
    np.testing.assert_array_equal(found["n_pairs"], paired_differences(whole)["n_pairs"])
