"""Counts, probabilities and intervals against closed forms, and what must not change them."""

import math
from types import SimpleNamespace

import attrs
import numpy as np
import pytest
from scipy.stats import binom, norm

from flocsim.ensembles.config.schema import StopConfig
from flocsim.ensembles.estimates.numerical import (
    change_columns,
    change_intervals,
    count_changes,
)
from flocsim.ensembles.estimates.statistics import (
    CODES,
    borders,
    count,
    stop_rule,
)
from flocsim.ensembles.parallel.communicator import Communicator
from flocsim.ensembles.report import format_table, numerics_line
from flocsim.ensembles.runner import run, run_to_file
from flocsim.ensembles.storage.resume import NEW, RESUME
from flocsim.errors import UsageError
from flocsim.io.confidence import bounds_quantile, proportion, wilson
from flocsim.io.results.events import events, events_of
from flocsim.io.results.file import read_results
from flocsim.io.results.schema import NOT_APPLICABLE, PROBABILITIES, Results
from tests.helpers.results_files import same_data
from tests.helpers.rounding import to_rounding
from tests.helpers.small_study import small_config
from tests.helpers.synthetic_results import bonds_of, draw_codes, make_results
from tests.helpers.tabulate import tabulate
from tests.helpers.tiers import rest_slow

Z = 1.959963984540054
COUNTS = ("n_total", "n_missed", "n_held", "n_undecided", "n_failed", "n_collided", "n_inside",
          "n_class", "n_bond")  # fmt: skip


@pytest.mark.parametrize(("n", "confidence"), [(1, 0.95), (7, 0.99), (50, 0.5), (4000, 0.95)])
def test_wilson_bounds_solve_the_score_equation(n, confidence):
    k, z = np.arange(n + 1), norm.ppf(0.5 + 0.5 * confidence)
    for bound in wilson(k, n, confidence):
        np.testing.assert_allclose((k / n - bound) ** 2, z**2 * bound * (1 - bound) / n, atol=1e-13)
    low, high = wilson([0, n], n)
    assert low[0] == 0.0 < high[0] and low[1] < 1.0 == high[1]


def test_wilson_is_nan_without_trials():
    low, high = wilson([0, 1], [0, 2])
    assert np.isnan([low[0], high[0]]).all()
    assert np.isfinite([low[1], high[1]]).all()


@pytest.mark.parametrize(("n", "published"), [(20, 0.953), (100, 0.950), (1000, 0.950)])
def test_wilson_coverage_averaged_over_p(n, published):
    p = np.linspace(0.1, 0.9, 3001)
    k = np.arange(n + 1)
    low, high = wilson(k, n)
    covers = (low[:, None] <= p) & (p <= high[:, None])
    coverage = (binom.pmf(k[:, None], n, p) * covers).sum(axis=0).mean()
    assert coverage == pytest.approx(published, abs=6e-4)


@pytest.mark.parametrize(
    ("successes", "trials"), [(-1, 5), (6, 5), (0.5, 5), (1, math.nan), (1, math.inf), ("a", 5)]
)
def test_wilson_refuses_what_cannot_be_counts(successes, trials):
    with pytest.raises(UsageError):
        wilson(successes, trials)


@pytest.mark.parametrize("confidence", [0.0, 1.0, 95, math.nan])
def test_wilson_refuses_impossible_confidence(confidence):
    with pytest.raises(UsageError, match="confidence"):
        wilson(1, 2, confidence)


def test_every_count_and_probability_of_a_small_case():
    #           A  A  A  B  C  D  D  missed held   undecided in, out, apart     failed in, apart
    outcome = [[0, 0, 0, 1, 2, 3, 3, 4, 7, 5, 5, 5, 6, 6]]
    inside = [[1, 1, 1, 1, 0, 0, 0, 255, 255, 1, 0, 255, 1, 255]]
    bond = [[1, 1, 2, 255, 3, *[255] * 9]]
    table = tabulate(outcome, inside, bond)
    counts = {name: table[name][0].tolist() for name in COUNTS}
    assert counts == {
        "n_total": 14,
        "n_missed": 1,
        "n_held": 1,
        "n_undecided": 3,
        "n_failed": 2,
        "n_collided": 10,
        "n_inside": 6,
        "n_class": [3, 1, 1, 2],
        "n_bond": [2, 1, 1],
    }
    assert table["pr_inside"][0] == 6 / 10
    assert table["pr_a_given_inside"][0] == 3 / 4
    assert table["pr_a_given_outside"][0] == 1 / 3
    assert table["pr_a"][0] == 4 / 7
    np.testing.assert_array_equal(table["pr_class"][0], np.array([3, 1, 1, 2]) / 7)
    np.testing.assert_array_equal(table["pr_bond"][0], np.array([2, 1, 1]) / 4)
    assert (table["pr_sticks"][0], table["pr_hangs"][0]) == (3 / 7, 1 / 7)
    # Two of the five without an outcome never touched: they may be inside, outside or miss. One
    # touched outside, so that it says nothing of collisions inside.
    known = {"pr_hangs": (1, 7, 5), "pr_a": (4, 7, 5), "pr_inside": (6, 10, 2),
             "pr_a_given_inside": (3, 4, 4), "pr_a_given_outside": (1, 3, 3)}  # fmt: skip
    for name, of in known.items():
        bounds = [table[f"{name}_low"][0], table[f"{name}_high"][0]]
        assert bounds == to_rounding(np.array(proportion(*of[:2], unknown=of[2])[1:])), name


def test_the_events_of_counts_are_those_of_codes():
    codes = draw_codes(np.random.default_rng(4), (2, 3, 2, 60))
    counted = events_of(tabulate(*codes))
    for name, each in events(*codes).items():
        for flags, number in zip(each, counted[name], strict=True):
            np.testing.assert_array_equal(flags.sum(axis=-1), number, err_msg=name)


@pytest.mark.parametrize("seed", range(10))
def test_whatever_the_unknown_come_to_is_in_the_interval(seed):
    rng = np.random.default_rng(seed)
    outcome, inside, bond = draw_codes(rng, (1, 1, 3, 12))
    hidden = rng.random(outcome.shape) < 0.4
    # Half of them are known to have touched.
    touched = hidden & (rng.random(outcome.shape) < 0.5)
    cut = tabulate(np.where(hidden, rng.choice([5, 6], outcome.shape), outcome),
                   np.where(hidden & ~touched, NOT_APPLICABLE, inside),
                   np.where(hidden, NOT_APPLICABLE, bond))  # fmt: skip
    decided = np.isin(outcome, [5, 6])
    outcome = np.where(decided, np.where(inside == 1, 1, 3), outcome)
    whole = tabulate(outcome, inside, bond)
    for name in PROBABILITIES:
        value = whole[name]
        seen = np.isfinite(value)
        assert np.all(cut[f"{name}_low"][seen] <= value[seen]), name
        assert np.all(value[seen] <= cut[f"{name}_high"][seen]), name


def test_the_quantile_falls_from_two_sided_to_one_sided():
    found = bounds_quantile(np.array([0.0, 1e-12, 0.5, 50.0]), np.ones(4))
    assert found[0] == pytest.approx(Z) == pytest.approx(found[1])
    assert found[3] == pytest.approx(norm.ppf(0.95))
    assert norm.cdf(found[2] + 0.5) - norm.cdf(-found[2]) == pytest.approx(0.95)


@pytest.mark.parametrize("share", [0.01, 0.05, 0.2, 0.6])
@pytest.mark.parametrize("n", [20, 200])
def test_intervals_with_unknown_ones_cover_the_decided_probability(share, n):
    # Worst for the interval: all that stay unknown are of one kind.
    rng = np.random.default_rng(7)
    p = 0.7
    aggregated = rng.random((4000, n)) < p
    hidden = aggregated & (rng.random(aggregated.shape) < share / p)
    s, u = (aggregated & ~hidden).sum(axis=1), hidden.sum(axis=1)
    _, low, high = proportion(s, n - u, unknown=u)
    assert np.mean((low <= p) & (p <= high)) > 0.94


def test_counts_are_whole_numbers_that_add_up():
    table = make_results().probabilities
    for name in COUNTS:
        assert table[name].dtype == np.int64
    ends = sum(table[name] for name in ("n_missed", "n_held", "n_undecided", "n_failed"))
    np.testing.assert_array_equal(table["n_total"], ends + table["n_class"].sum(axis=-1))
    aggregated = table["n_class"][..., [0, 2]].sum(axis=-1)
    np.testing.assert_array_equal(table["n_bond"].sum(axis=-1), aggregated)
    np.testing.assert_allclose(table["pr_a"], table["pr_sticks"] + table["pr_hangs"], atol=1e-15)


def test_no_events_give_nan_not_zero():
    table = tabulate(np.full((1, 5), 4), *[np.full((1, 5), NOT_APPLICABLE)] * 2)
    for name in [name for name in table if name.startswith("pr_")]:
        assert np.isnan(table[name]).all(), name


def test_swapping_inside_and_outside_mirrors_the_table():
    outcome, inside, bond = draw_codes(np.random.default_rng(3), (2, 2, 2, 50))
    swapped = np.choose(outcome, [2, 3, 0, 1, 4, 5, 6])
    other = np.where(inside == NOT_APPLICABLE, inside, 1 - inside)
    before, after = tabulate(outcome, inside, bond), tabulate(swapped, other, bond)
    np.testing.assert_array_equal(before["pr_a_given_inside"], after["pr_a_given_outside"])
    np.testing.assert_array_equal(before["pr_a"], after["pr_a"])
    np.testing.assert_allclose(before["pr_inside"], 1 - after["pr_inside"], atol=1e-15)


def test_inside_equals_a_plus_b_when_all_collisions_are_decided():
    outcome, inside, bond = draw_codes(np.random.default_rng(4), (3, 4, 5, 60))
    decided = outcome < 4
    codes = np.where(decided, outcome, 4), np.where(decided, inside, NOT_APPLICABLE)
    table = tabulate(*codes, bonds_of(codes[0], bond))
    np.testing.assert_allclose(table["pr_inside"], table["pr_class"][..., :2].sum(axis=-1))
    np.testing.assert_allclose(table["pr_class"].sum(axis=-1), 1.0)


@pytest.mark.parametrize("count", [0, 9, 60, 99_999])
def test_table_is_aligned_and_narrow(count):
    results = make_results(count=60)
    table = dict(results.probabilities)
    for name in COUNTS:
        table[name] = np.minimum(table[name] * count, count)
    for name in ("n_missed", "n_held", "n_undecided", "n_failed"):
        table[name] = np.zeros_like(table[name])
    text = format_table(attrs.evolve(results, probabilities=table), numerics=False)
    lines = text.splitlines()
    assert lines[-1].startswith("δ = 1: outlines just graze")
    rows = [line for line in lines[1:-3] if not line.startswith("type")]
    assert len(rows) == 3 * 4 * 5
    assert max(map(len, lines)) <= 100
    assert len({len(row) for row in rows}) == 1


def test_table_tells_the_numbers():
    outcome = np.array([0] * 6 + [3] * 3 + [4]).reshape(1, 1, 1, 10)
    inside = np.select([outcome == 0, outcome == 3], [1, 0], NOT_APPLICABLE)
    bond = bonds_of(outcome, np.array([1, 1, 2, 3, 1, 2, 1, 1, 1, 1]))
    results = Results(["II"], [16], [0.25], None, tabulate(outcome, inside, bond))
    lines = format_table(results, numerics=False).splitlines()
    assert lines[1] == "type II"
    cells = "16 0.25 10 0.667 [0.354, 0.879] 0.667 [0.354, 0.879] 6 0 0 3 1 missed"
    assert " ".join(lines[2].split()) == cells
    # All columns: how many of A and C hang, how many collided, and did so inside, and the rest.
    row = format_table(results, numerics=False, every=True).splitlines()[2]
    assert " ".join(row.split()[-11:]) == "6 0 0 3 0.333 9 6 1 0 0 0"


def test_table_shows_a_dash_without_events():
    table = tabulate(np.full((1, 1, 1, 2), 4), *[np.full((1, 1, 1, 2), NOT_APPLICABLE)] * 2)
    row = format_table(Results(["I"], [4], [0.5], None, table), numerics=False).splitlines()[2]
    assert " ".join(row.split()) == "4 0.5 2 – – 0 0 0 0 2 missed"


def test_table_tells_the_numerical_error():
    outcome = np.zeros((1, 1, 1, 40), dtype=int)
    first = outcome, outcome + 1, bonds_of(outcome)
    again = np.where(np.arange(40) < 4, 1, outcome)
    codes = *first, again, outcome + 1, bonds_of(again)
    changes = change_columns(change_intervals(count(*first) | count_changes(first, codes[3:])))
    results = Results(["III"], [1], [0.0], None, tabulate(*codes), numerics=changes)
    row = format_table(results, numerics=True).splitlines()[2]
    # Four of 40 have departed; all were run again, and none a third time.
    interval = "1.000 [0.912, 1.000]"
    assert " ".join(row.split()).startswith(
        f"1 0 40 {interval} −0.000 +0.000 {interval} −0.100 −0.100"
    )
    line = numerics_line(results)
    assert "4 of 40 re-runs changed" in line


RULE = {"half_width": 0.12, "least": 10}
SPHERES = {"shapes": {"vertices": [1]}, "replicates": 300}


def test_looks_are_fixed_and_end_with_all():
    assert borders(StopConfig(), 1000) == [1000]
    assert borders(StopConfig(half_width=0.1), 200) == [100, 125, 157, 197, 200]
    assert borders(StopConfig(half_width=0.1, least=300), 200) == [200]


def half_widths(table, names=("pr_inside", "pr_a")):
    """Half the widths of the intervals."""
    return [0.5 * (table[f"{name}_high"] - table[f"{name}_low"]) for name in names]


def test_a_study_ends_at_the_first_look_that_is_narrow_enough(tmp_path):
    results = run(small_config(tmp_path, SPHERES | {"stop": RULE}))
    looks = borders(StopConfig(**RULE), 300)
    assert results.count in looks[:-1]
    assert np.max(half_widths(results.probabilities)) <= 0.12
    before = looks[looks.index(results.count) - 1]
    codes = (results.replicates[name][..., :before] for name in CODES)
    assert np.max(half_widths(tabulate(*codes))) > 0.12


def test_the_study_goes_on_where_the_rule_is_made_stricter(tmp_path):
    config = small_config(tmp_path, SPHERES | {"stop": RULE})
    run_to_file(config, Communicator(), tmp_path / "r.h5", NEW)
    first = read_results(tmp_path / "r.h5").count
    stricter = small_config(tmp_path, SPHERES | {"stop": RULE | {"half_width": 0.05}})
    ended = run_to_file(stricter, Communicator(), tmp_path / "r.h5", RESUME)
    second = read_results(tmp_path / "r.h5").count
    assert second > first
    assert ended.computed >= 4 * (second - first)
    run_to_file(stricter, Communicator(), tmp_path / "fresh.h5", NEW)
    assert same_data(tmp_path / "r.h5", tmp_path / "fresh.h5") == []


class Drawn:
    """A store of made-up outcomes of one condition."""

    conditions = (None,)

    def __init__(self, outcome):
        """The outcomes: 0, inside and aggregated, or 1, inside and departed."""
        self.outcome = outcome

    def rows(self, place, first, stop):
        """Rows of replicates; those that collide do so inside, and those that hold for good."""
        part = self.outcome[first:stop]
        inside = np.where(part < 4, 1, 255)
        return {"outcome": part, "inside": inside, "bond": bonds_of(part)}


def rule_of(outcome, stop):
    """The rule of a study of these outcomes."""
    study = SimpleNamespace(config=SimpleNamespace(stop=stop))
    return stop_rule(study, Drawn(outcome))


def ended_at(outcome, stop):
    """How many of the outcomes the rule lets a study have."""
    rule = rule_of(outcome, stop)
    return next(look for look in borders(stop, len(outcome)) if rule(look) or look == len(outcome))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("share", "studies"),
    rest_slow(
        [(0.8, 100), (0.1, 400), (0.5, 400), (0.8, 400)], lambda share, studies: studies < 400
    ),
)
def test_intervals_of_a_study_that_was_ended_still_cover(share, studies):
    rng = np.random.default_rng(11)
    stop = StopConfig(half_width=0.08)
    covered = 0
    for _ in range(studies):
        outcome = (rng.random(1000) >= share).astype(int)
        number = ended_at(outcome, stop)
        assert number < 1000
        table = tabulate(outcome[:number], np.ones(number, int), bonds_of(outcome[:number]))
        covered += table["pr_a_low"] <= share <= table["pr_a_high"]
    spread = math.sqrt(0.95 * 0.05 / studies)
    assert -3.7 * spread < covered / studies - 0.95 < 3.2 * spread


def test_a_condition_without_events_holds_nothing_up():
    assert rule_of(np.full(100, 4), StopConfig(half_width=0.01))(5)
