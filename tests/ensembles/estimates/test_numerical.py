"""The numerical error of probabilities: what flips count as, and that the bound holds."""

import numpy as np
import pytest
from scipy.stats import nbinom

from flocsim.ensembles.estimates.numerical import count_changes, numerical_errors
from flocsim.ensembles.estimates.statistics import COUNTED, tabulate
from flocsim.ensembles.estimates.summary import added, sums_of, tables_of
from flocsim.io.confidence import numerical_error
from flocsim.io.results.events import events, events_of
from flocsim.io.results.schema import PROBABILITIES
from tests.helpers.synthetic_results import (
    bonds_of,
    draw_codes,
    draw_second_runs,
    make_results,
)

NOT = 255
OF_BONDS = ("pr_sticks", "pr_hangs", "pr_bond")


def test_a_hook_that_becomes_a_certificate_flips_between_hanging_and_sticking():
    first, again = ([[0, 2, 1]], [[1, 0, 1]], [[2, 1, NOT]]), ([[0, 2, 1]], [[1, 0, 1]],
                                                               [[1, 1, NOT]])  # fmt: skip
    table = tabulate(*first, *again)
    assert table["n_flipped"].tolist() == [0]
    assert [table[f"n_{kind}_pr_sticks"][0] for kind in ("checked", "gained", "lost")] == [3, 1, 0]
    assert [table[f"n_{kind}_pr_hangs"][0] for kind in ("checked", "gained", "lost")] == [3, 0, 1]
    assert table["n_gained_pr_bond"].tolist() == [[1, 0, 0]]
    assert table["n_lost_pr_bond"].tolist() == [[0, 1, 0]]
    assert table["n_checked_pr_bond"].tolist() == [[2, 2, 2]]


def test_every_kind_of_change_counts_as_it_should():
    #         same  A→B  C→A  D→missed  missed→A  B→undecided inside  not run again
    outcome = [[0, 0, 2, 3, 4, 1, 0]]
    inside = [[1, 1, 0, 0, NOT, 1, 1]]
    again = [[0, 1, 0, 4, 0, 5, NOT]]
    inside_again = [[1, 1, 1, NOT, 1, 1, NOT]]
    table = tabulate(outcome, inside, bonds_of(outcome), again, inside_again, bonds_of(again))
    found = {name: table[name][0].tolist() for name in table if name.startswith("n_")}
    assert (found["n_checked"], found["n_flipped"]) == (6, 5)
    counts = {name: [found[f"n_{kind}_{name}"] for kind in ("checked", "gained", "lost")]
              for name in PROBABILITIES if name not in OF_BONDS}  # fmt: skip
    assert counts == {
        # C → A comes in, D → missed was outside, missed → A is a new one inside.
        "pr_inside": [6, 3, 0],
        # A → B lost; C → A and missed → A gained; B → undecided no longer counts against.
        "pr_a_given_inside": [5, 3, 1],
        # C leaves, a success; D leaves, a failure.
        "pr_a_given_outside": [2, 1, 1],
        # A → B lost; D and B go, failures; missed → A gained.
        "pr_a": [6, 3, 1],
        "pr_class": [[6] * 4, [4, 2, 2, 1], [1, 2, 2, 2]],
    }


def test_classes_gain_and_lose_by_their_own_share():
    first, again = [[0, 0, 3]], [[0, 1, 4]]
    table = tabulate(first, [[1, 1, 0]], bonds_of(first), again, [[1, 1, NOT]], bonds_of(again))
    # A → B: A loses, B gains. D → missed: D loses, for the others a failure goes.
    assert table["n_gained_pr_class"].tolist() == [[1, 2, 1, 0]]
    assert table["n_lost_pr_class"].tolist() == [[1, 0, 0, 1]]
    assert table["n_checked_pr_class"].tolist() == [[3, 3, 3, 3]]


@pytest.mark.parametrize("seed", range(20))
def test_no_probability_moves_further_than_its_flips(seed):
    codes = draw_codes(np.random.default_rng(seed), (2, 3, 2, 200))
    drawn = draw_second_runs(codes, seed)
    checked = drawn["checked_outcome"] != NOT
    again = [np.where(checked, *pair) for pair in zip(drawn.values(), codes, strict=True)]
    first, second = tabulate(*codes), tabulate(*again)
    changes = count_changes(codes, again)
    trials = {name: each.trials for name, each in events_of(first).items()}
    moved = 0
    for name in PROBABILITIES:
        flips = changes[f"n_gained_{name}"] + changes[f"n_lost_{name}"]
        shift = second[name] - first[name]
        seen = np.isfinite(shift)
        bound = flips[seen] / trials[name][seen]
        assert np.all(np.abs(shift[seen]) <= bound + 1e-12)
        # What only gains does not fall, what only loses does not rise.
        assert np.all(shift[(changes[f"n_lost_{name}"] == 0) & seen] >= -1e-12)
        assert np.all(shift[(changes[f"n_gained_{name}"] == 0) & seen] <= 1e-12)
        moved += np.count_nonzero(flips)
    assert moved > 20


def test_events_are_what_the_probabilities_are_of():
    codes = draw_codes(np.random.default_rng(3), (2, 2, 2, 50))
    table = tabulate(*codes)
    assert set(events(*codes)) == set(PROBABILITIES)
    for name, (trial, success, _) in events(*codes).items():
        if name not in ("pr_class", "pr_bond"):
            counts = success.sum(-1), np.where(trial.any(-1), trial.sum(-1), np.nan)
            np.testing.assert_array_equal(table[name], counts[0] / counts[1])
            assert not np.any(success & ~trial)


def test_the_bound_is_the_quantile_of_a_negative_binomial_distribution():
    rng = np.random.default_rng(5)
    trials = rng.integers(1, 5000, (2, 30))
    checked = rng.integers(0, trials + 1)
    flipped = rng.binomial(checked, 0.03)
    found = numerical_error(flipped, checked, trials)
    for place in np.ndindex(trials.shape):
        f, c, n = flipped[place], checked[place], trials[place]
        others, others_flipped = checked[place[0]].sum() - c, flipped[place[0]].sum() - f
        rate = (others + 2) / (others_flipped + 1) + c
        more = nbinom.ppf(0.95, 1 + f, rate / (rate + n - c)) if n > c else 0
        assert found[place] == min((f + more) / n, 1.0)


def test_what_is_known_needs_no_prediction_and_what_is_unknown_has_none():
    np.testing.assert_array_equal(
        numerical_error([[3, 0]], [[50, 20]], [[50, 20]]), [[3 / 50, 0.0]]
    )
    nothing = numerical_error(np.zeros((2, 3)), np.zeros((2, 3)), np.full((2, 3), 40))
    assert np.isnan(nothing).all()
    # Where none of one condition was run again, the others of its type speak for it.
    borrowed = numerical_error([[0, 10]], [[0, 1000]], [[100, 1000]])[0]
    assert 0.01 < borrowed[0] < 0.1 and borrowed[1] == 0.01
    assert np.isnan(numerical_error([[0, 1]], [[0, 9]], [[0, 9]])[0, 0])


def test_more_checks_without_flips_make_it_smaller():
    bounds = [numerical_error([0], [c], [1000])[0] for c in (2, 20, 200, 900, 1000)]
    assert all(np.diff(bounds) < 0.0) and bounds[-1] == 0.0


@pytest.mark.parametrize("mean", [0.001, 0.01, 0.1])
@pytest.mark.parametrize("spread", ["alike", "exponential", "a few"])
def test_the_bound_holds_in_nine_of_ten_conditions(mean, spread):
    rng = np.random.default_rng(9)
    shape, trials, checked = (60, 20), 100, 16
    rates = {
        "alike": np.full(shape, mean),
        "exponential": rng.exponential(mean, shape),
        "a few": np.where(rng.random(shape) < 0.1, 10.0 * mean, 0.0),
    }[spread]
    rates = np.minimum(rates, 1.0)
    known = rng.binomial(checked, rates)
    true = (known + rng.binomial(trials - checked, rates)) / trials
    bound = numerical_error(known, np.full(shape, checked), np.full(shape, trials))
    assert np.mean(bound >= true) >= 0.9
    # It is no more than a few times the truth, where there is enough to tell.
    assert bound.mean() <= 5.0 * mean + 0.02


def test_tables_from_sums_are_those_of_all_replicates_together():
    results = make_results(count=40)
    columns = [results.replicates[name] for name in COUNTED]

    def codes(first, stop):
        return tuple(column[..., first:stop] for column in columns)

    sums = {}
    for first, stop in ((0, 7), (7, 31), (31, 40)):
        sums = added(sums, sums_of(codes, 60, first, stop))
    table, pooled, _ = tables_of(sums)
    whole = tabulate(*columns)
    assert set(table) == set(whole)
    for name in whole:
        np.testing.assert_array_equal(table[name], whole[name])
    over_delta = {name: values.sum(axis=2) for name, values in whole.items() if name[:2] == "n_"}
    for name, values in numerical_errors(over_delta).items():
        if name not in ("pr_class_numerical", "pr_bond_numerical"):
            np.testing.assert_array_equal(pooled[name], values)
