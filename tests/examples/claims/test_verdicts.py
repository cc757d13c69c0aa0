"""The rules from statistic to verdict, and the rank correlation, against plain ones."""

import numpy as np
import pytest
from scipy.stats import kendalltau

from examples.tang2014.claims.resampling import counts_of
from examples.tang2014.claims.trends import kendall
from examples.tang2014.claims.verdicts import above, always, below, occurs, within


def samples(middle, spread=1.0):
    """An estimate and resamples that lie evenly around it."""
    return np.concatenate([[middle], middle + spread * np.linspace(-1.0, 1.0, 401)])


@pytest.mark.parametrize(
    ("middle", "verdict"),
    [(1.5, "holds"), (0.5, "undecided"), (-0.5, "undecided"), (-1.5, "fails")],
)
def test_above_and_below_mirror_each_other(middle, verdict):
    up, down = above("", samples(middle)), below("", samples(-middle))
    assert (up.verdict, down.verdict) == (verdict, verdict)
    assert np.allclose((up.value, up.low, up.high), (-down.value, -down.high, -down.low))


def test_a_constant_at_the_level_is_not_above_it():
    assert above("", np.zeros(10)).verdict == "fails"


def test_without_events_nothing_is_decided():
    assert above("", np.full(10, np.nan)).verdict == "undecided"


@pytest.mark.parametrize(
    ("middle", "verdict"), [(5.0, "holds"), (0.5, "undecided"), (-2.0, "fails"), (12.0, "fails")]
)
def test_within(middle, verdict):
    assert within("", samples(middle), 0.0, 10.0).verdict == verdict


def test_always_needs_many_and_no_exception():
    found = [always("", *counts).verdict for counts in ((100, 100), (99, 100), (5, 5), (0, 0))]
    assert found == ["holds", "fails", "undecided", "undecided"]


def test_occurs_needs_one_or_many_without():
    found = [occurs("", *counts).verdict for counts in ((1, 100), (0, 1000), (0, 10), (0, 0))]
    assert found == ["holds", "fails", "undecided", "undecided"]


def test_rank_correlation_is_kendalls():
    values = np.random.default_rng(1).random((9, 1, 3))
    expected = [kendalltau(np.arange(9), values[:, 0, k]).statistic for k in range(3)]
    assert np.allclose(kendall(values), expected)


def test_the_first_sample_is_the_ensemble_itself():
    from tests.helpers.synthetic_results import make_results

    results = make_results()
    counts = counts_of(results, resamples=20)
    table = results.probabilities
    assert np.array_equal(counts.collided[..., 0], table["n_collided"])
    assert np.array_equal(counts.inside[..., 0], table["n_inside"])
    assert np.array_equal(np.moveaxis(counts.classes[..., 0], 0, -1), table["n_class"])
    assert np.allclose(counts.pr_inside[..., 0], table["pr_inside"], equal_nan=True)
