"""The numerical error of probabilities: what flips count as, and that the bound holds."""

import attrs
import numpy as np
import pytest
from scipy.stats import nbinom, poisson

from benchmarks.accuracy.tolerance import outcome_changes
from examples.tang2014.changes import second_run_changes
from flocsim.ensembles.estimates.numerical import (
    MEANS,
    SHAPES,
    change_intervals,
    count_changes,
    flips_together,
    further_flips,
    further_of_kinds,
    numerical_of,
)
from flocsim.ensembles.estimates.statistics import COUNTED, EXACT_RUNS, by_runs, count
from flocsim.ensembles.estimates.summary import added, sums_of, tables_of
from flocsim.errors import UsageError
from flocsim.io.results.events import Events, events, events_of
from flocsim.io.results.schema import NOT_APPLICABLE, PROBABILITIES
from tests.helpers.paper_like import paper_results, relabelled
from tests.helpers.synthetic_results import (
    bonds_of,
    draw_codes,
    draw_second_runs,
    make_results,
)
from tests.helpers.tabulate import tabulate
from tests.helpers.tiers import rest_slow

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


@pytest.mark.parametrize("seed", rest_slow(range(20), lambda seed: seed < 6))
def test_no_probability_moves_further_than_its_flips(seed):
    codes = draw_codes(np.random.default_rng(seed), (2, 3, 2, 200))
    drawn = draw_second_runs(codes, seed)
    checked = drawn["checked_outcome"] != NOT
    again = [np.where(checked, *pair) for pair in zip(list(drawn.values())[:3], codes, strict=True)]
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


def test_further_flips_are_the_quantile_of_a_mixture_of_negative_binomials():
    rng = np.random.default_rng(5)
    checked = rng.integers(0, 200, 12)
    flipped, exposed = rng.binomial(checked, 0.03), rng.integers(1, 2000, 12)
    bound, mean, none = further_flips(flipped, checked, exposed, 0.975)
    logs, parts = [], []
    for m in MEANS:
        for k in SHAPES:
            seen = nbinom.logpmf(flipped, k, k / m / (k / m + checked))
            logs.append(np.where(checked > 0, seen, 0.0).sum() + 0.5 * np.log(m))
            parts.append((k + flipped, k / m + checked))
    weights = np.exp(np.array(logs) - np.max(logs))
    weights /= weights.sum()

    def at_most(q):
        terms = [nbinom.cdf(q, n, b / (b + exposed)) for n, b in parts]
        return weights @ np.array(terms)

    assert np.all(at_most(bound) >= 0.975 - 1e-5)
    assert np.all((at_most(bound - 1) < 0.975 + 1e-5) | (bound == 0))
    np.testing.assert_allclose(none, at_most(np.zeros(12)), rtol=1e-3)
    means = weights @ np.array([nbinom.mean(n, b / (b + exposed)) for n, b in parts])
    np.testing.assert_allclose(mean, np.minimum(means, exposed), rtol=1e-3)


def test_parts_together_need_less_than_the_sum_of_their_bounds_and_hold():
    rng = np.random.default_rng(6)
    means = np.array([0.2, 1.0, 6.0])
    parts = np.array([poisson.ppf(0.975, means), means, np.exp(-means)]).T
    bound = flips_together(parts)
    assert bound < parts[:, 0].sum()
    assert np.mean(rng.poisson(means, (100_000, 3)).sum(axis=1) <= bound) >= 0.975
    for part in parts:
        assert flips_together([part]) == part[0]
    rare = [(1.0, 0.01, 0.99)] * 2
    assert flips_together(rare) == 0.0 < flips_together(rare * 2)


def test_where_nothing_may_flip_nothing_does_and_nothing_seen_says_nothing():
    assert further_flips([3, 0], [50, 20], [0, 0])[0].tolist() == [0.0, 0.0]
    assert further_flips([0, 0], [0, 0], [5, 0])[0, 1] == 0.0
    assert np.isnan(further_flips([0, 0], [0, 0], [5, 0])[0, 0])
    # Where none of one condition was run again, the others speak for it.
    borrowed = further_flips([0, 10], [0, 1000], [100, 0], 0.95)[0]
    assert 1 < borrowed[0] < 50


def test_more_checks_without_flips_make_it_smaller():
    bounds = [float(further_flips([0], [c], [1000 - c])[0, 0]) for c in (2, 20, 200, 900, 1000)]
    assert all(np.diff(bounds) <= 0.0) and bounds[0] > bounds[1] > bounds[2] > bounds[-1] == 0.0


@pytest.mark.parametrize("mean", [0.001, 0.01, 0.1])
@pytest.mark.parametrize("spread", ["alike", "exponential", "a few"])
def test_the_bound_holds_also_in_the_conditions_that_flip(mean, spread):
    rng = np.random.default_rng(9)
    shape, trials, checked = (60, 20), 400, 40
    rates = {
        "alike": np.full(shape, mean),
        "exponential": rng.exponential(mean, shape),
        "a few": np.where(rng.random(shape) < 0.1, 10.0 * mean, 0.0),
    }[spread]
    rates = np.minimum(rates, 1.0)
    known = rng.binomial(checked, rates)
    more = rng.binomial(trials - checked, rates)
    bound = np.array([
        further_flips(each, np.full(20, checked), np.full(20, trials - checked))[0]
        for each in known
    ])  # fmt: skip
    assert np.mean(bound >= more) >= 0.95
    if mean >= 0.01:
        assert np.mean((bound >= more)[rates >= mean]) >= 0.85
    # It is no more than a few times the truth, where there is enough to tell.
    assert bound.mean() / trials <= 5.0 * mean + 0.03


def changes_of(first, again):
    """change_intervals of codes (outcome, inside) of first and second runs."""
    codes = [(*map(np.array, each), bonds_of(np.array(each[0]))) for each in (first, again)]
    return change_intervals(count(*codes[0]) | count_changes(*codes))


def test_what_was_run_again_is_known_with_its_sign():
    # One of 200, all of which were run again, departs where it had aggregated.
    outcome = np.zeros((1, 1, 200), dtype=int)
    again = outcome.copy()
    again[0, 0, 0] = 1
    inside = np.ones_like(outcome)
    low, high = changes_of((outcome, inside), (again, inside))["pr_a"]
    # All were run again, and none a third time: nothing more is known to change.
    assert low[0, 0] == high[0, 0] == pytest.approx(-1 / 200)


def test_what_changes_in_third_runs_alone_is_seen_and_counted():
    """A plateau: no second run ends otherwise than the first, some third runs do."""
    outcome = np.zeros((1, 1, 1000), dtype=int)
    inside = bond = np.ones_like(outcome)
    places = np.arange(1000).reshape(outcome.shape)

    def interval(flips):
        codes = outcome, inside, bond
        second = np.where(places < 200, codes, NOT)
        third = np.where(places < 50, codes, NOT)
        third[0][places < flips], third[2][places < flips] = 1, NOT
        counts = count(*codes) | count_changes(codes, tuple(second), tuple(third))
        assert (counts["n_third"], counts["n_third_flipped"]) == (50, flips)
        assert counts["n_flipped"] == counts["n_lost_pr_a"] == flips
        return change_intervals(counts)["pr_a"]

    plain, low = (float(interval(flips)[0][0, 0]) for flips in (0, 5))
    # 5 of 50 are known; of the other 950 about a tenth may depart as well.
    assert -0.3 < low < -0.1 and -0.06 < plain < 0.0
    assert interval(5)[1][0, 0] < 0.05


@pytest.mark.parametrize("plateau", [0.002, 0.02])
def test_the_interval_holds_what_is_seen_at_no_tolerance_but_the_last(plateau):
    """Flips of a rate of their own behind the second level, in a tenth of the conditions."""
    rng = np.random.default_rng(4)
    shape, held, widths = (20, 3, 300), [], []

    def only(*codes):
        return {"pr_a": events(*codes)["pr_a"]}

    for _ in range(10):
        outcome = rng.integers(0, 2, shape)
        inside = np.ones(shape, dtype=int)
        truth = outcome.copy()
        flips = rng.random(shape) < 10.0 * plateau * (rng.random((20, 3, 1)) < 0.1)
        truth[flips] ^= 1
        codes, exact = ((each, inside, bonds_of(each)) for each in (outcome, truth))
        checked = rng.random(shape) < 0.15
        thrice = checked & (rng.random(shape) < 0.25)
        second, third = (
            tuple(np.where(some, each, NOT) for each in of)
            for some, of in ((checked, codes), (thrice, exact))
        )
        counts = count_changes(codes, second, third, of=only)
        totals = {"pr_a": Events(*(each.sum(axis=-1) for each in only(*codes)["pr_a"]))}
        low, high = change_intervals(counts, totals)["pr_a"]
        change = truth.mean(axis=-1) - outcome.mean(axis=-1)
        change *= -1.0  # class B, code 1, is what departs
        held.append((low <= change + 1e-12) & (change <= high + 1e-12))
        widths.append(high - low)
    assert np.mean(held) >= 0.95 and np.mean(widths) < 0.12 + 15.0 * plateau


def test_a_second_run_without_an_outcome_may_have_come_to_anything():
    outcome = np.ones((1, 1, 100), dtype=int)
    inside = np.ones_like(outcome)
    again = outcome.copy()
    again[..., :20] = 5
    whole = changes_of((outcome, inside), (outcome, inside))["pr_a"]
    cut = changes_of((outcome, inside), (again, inside))["pr_a"]
    assert cut[1][0, 0] > 0.02 > whole[1][0, 0] and cut[0][0, 0] == 0.0


def test_kinds_count_for_as_many_as_there_are():
    """Hooks that flip say nothing of certificates, whatever share of either was run again."""
    outcome = np.zeros((1, 1, 1000), dtype=int)
    inside, bond = np.ones_like(outcome), np.ones_like(outcome)
    bond[..., :50] = 2
    places = np.arange(1000).reshape(outcome.shape)
    again = np.select([places < 25, places < 300], [1, 0], NOT)
    second = again, np.where(again == NOT, NOT, 1), np.where(again == 0, bond, NOT)
    codes = (outcome, inside, bond)
    low, high = change_intervals(count(*codes) | count_changes(codes, second))["pr_a"]
    # 25 are known to depart, and all hooks were run again; 700 certificates were not.
    assert low[0, 0] == pytest.approx(-0.025, abs=0.02) and low[0, 0] < -0.025
    assert high[0, 0] <= 0.0


@pytest.mark.slow
def test_tables_from_sums_are_those_of_all_replicates_together():
    results = make_results(count=40)
    columns = [results.replicates[name] for name in COUNTED]

    def codes(first, stop):
        return tuple(column[..., first:stop] for column in columns)

    sums = {}
    for first, stop in ((0, 7), (7, 31), (31, 40)):
        sums = added(sums, sums_of(codes, 60, first, stop))
    tables = tables_of(sums)
    whole = tabulate(*columns[: len(EXACT_RUNS)])
    assert set(tables["probabilities"]) == set(whole)
    for name in whole:
        np.testing.assert_array_equal(tables["probabilities"][name], whole[name])
    for name in PROBABILITIES:
        ends = (tables["numerics"][f"{name}_change{end}"] for end in ("_low", "_high"))
        np.testing.assert_array_equal(np.maximum(*map(np.abs, ends)), whole[f"{name}_numerical"])
    counted = count(*columns[:3]) | count_changes(*by_runs(columns)[:3])
    over_delta = {name: values.sum(axis=2) for name, values in counted.items()}
    for name, values in numerical_of(change_intervals(over_delta)).items():
        if name not in ("pr_class_numerical", "pr_bond_numerical"):
            np.testing.assert_array_equal(tables["pooled"][name], values)


def test_of_a_kind_that_was_never_run_again_all_may_flip():
    checked = np.array([[[0], [0]], [[12], [12]]])  # of (kind, type, N)
    exposed = np.array([[[2.0], [0.0]], [[0.0], [0.0]]])
    more = flips_together(further_of_kinds(np.zeros((2, 2, 1)), checked, exposed))
    assert more.tolist() == [[2.0], [0.0]]
    nothing = further_of_kinds(np.zeros((2, 2, 1)), np.zeros((2, 2, 1)), exposed)
    nothing = flips_together(nothing)
    assert np.isnan(nothing[0, 0]) and nothing[1, 0] == 0.0


def change(outcome, inside):
    outcome[0, 0, 0, 0] = 1  # A to B: aggregation
    outcome[0, 0, 1, 0], inside[0, 0, 1, 0] = 2, 0  # A to C: zone
    outcome[0, 0, 2, 0], inside[0, 0, 2, 0] = 4, 255  # A to missed


def test_changes_are_told_apart():
    changes = outcome_changes(paper_results(), paper_results(change))
    places = [np.argwhere(each).tolist() for each in (changes.aggregation, changes.zone)]
    assert places == [[[0, 0, 0, 0]], [[0, 0, 1, 0]]]
    assert np.count_nonzero(changes.outcome) == 3
    assert np.count_nonzero(~changes.both) == 1


def test_other_conditions_are_refused():
    with pytest.raises(UsageError, match="same conditions"):
        outcome_changes(paper_results(), relabelled(paper_results(), delta=(0, 0.1, 0.2, 0.3, 0.4)))


def test_changes_of_second_runs_are_those_of_two_studies_where_both_are():
    found = make_results(count=30)
    again = found.replicates["checked_outcome"]
    checked = again != NOT_APPLICABLE
    codes = {name: np.where(checked, found.replicates[f"checked_{name}"], found.replicates[name])
             for name in ("outcome", "inside")}  # fmt: skip
    exact = attrs.evolve(found, replicates=found.replicates | codes)
    one, other = second_run_changes(found), outcome_changes(found, exact)
    np.testing.assert_array_equal(one.checked, checked)
    assert one.outcome.any() and one.zone.any() and one.aggregation.any()
    for name in ("zone", "aggregation", "outcome"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    np.testing.assert_array_equal(one.both, other.both & checked)
    counted = found.probabilities["n_flipped"].sum()
    assert counted >= one.outcome.sum()
