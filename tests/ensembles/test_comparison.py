"""Differences between two results files: intervals from the literature, pairs, what is refused."""

import json
import re

import attrs
import numpy as np
import pytest

import flocsim
from flocsim.__main__ import main
from flocsim.ensembles.estimates.statistics import EXACT_RUNS, between, newcombe
from flocsim.errors import UsageError
from flocsim.io.results.file import read_results
from tests.helpers.results_files import write_results
from tests.helpers.synthetic_results import make_results
from tests.helpers.tabulate import tabulate
from tests.helpers.tiers import rest_slow


def test_independent_samples_as_published():
    # R. G. Newcombe, Stat. Med. 17 (1998) 873, table II (a), method 10.
    found = between(56, 70, 48, 80)
    np.testing.assert_allclose(found, (0.2, 0.0524, 0.3339), atol=5e-5)
    assert np.isnan(between(0, 0, 1, 2)).all()


def changed(path, results, **columns):
    """The results with other columns of replicates, counted anew, in a file."""
    rows = {**results.replicates, **columns}
    codes = [rows[name] for name in ("outcome", "inside", "bond")]
    again = {name: rows[name] for name in EXACT_RUNS[3:]}
    table = tabulate(*codes, **again)
    made = attrs.evolve(results, replicates=rows, probabilities=table, pooled={}, differences={})
    write_results(path, made)
    return path


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Two files of one study: in the second, every second aggregate inside has departed."""
    tmp_path = tmp_path_factory.mktemp("compared")
    first = make_results()
    write_results(tmp_path / "a.h5", first)
    first = read_results(tmp_path / "a.h5")
    outcome, bond = (first.replicates[name].copy() for name in ("outcome", "bond"))
    departs = (outcome == 0) & (np.arange(outcome.shape[-1]) % 2 == 0)
    outcome[departs], bond[departs] = 1, 255
    return first, tmp_path / "a.h5", changed(tmp_path / "b.h5", first, outcome=outcome, bond=bond)


def test_pairs_are_used_where_the_draws_are_common(files):
    first, a, b = files
    comparison = flocsim.compare(flocsim.open(a), flocsim.open(b))
    assert comparison.paired and comparison.pairs == first.count
    one, other = read_results(a), read_results(b)
    found = comparison.arrays["pr_a"]
    change = other.probabilities["pr_a"] - one.probabilities["pr_a"]
    np.testing.assert_allclose(found["difference"], change, atol=1e-15)
    # No replicate has changed the other way.
    place = (-1, -1, -1)
    outcomes = [each.replicates["outcome"][place] for each in (one, other)]
    held = [np.isin(each, (0, 2)) for each in outcomes]
    decided = outcomes[0] < 4
    cells = [
        (held[0] & held[1])[decided].sum(), (held[1] & ~held[0])[decided].sum(),
        (held[0] & ~held[1])[decided].sum(), (~held[0] & ~held[1])[decided].sum(),
    ]  # fmt: skip
    assert cells[1] == 0 < cells[2]
    # What is unknown both times may have aggregated in the first alone, or in the second alone.
    unknown = np.isin(outcomes[0], (5, 6)).sum()
    assert found["difference_low"][place] == newcombe(*np.add(cells, [0, 0, unknown, 0]))[1]
    assert found["difference_high"][place] == newcombe(*np.add(cells, [0, unknown, 0, 0]))[2]
    alone = between(held[1][decided].sum(), decided.sum(), held[0][decided].sum(), decided.sum())
    assert np.diff(newcombe(*cells)[1:]) < alone[2] - alone[1]
    assert not comparison.arrays["pr_inside"]["difference"].any()


@pytest.mark.slow
def test_other_draws_are_independent_samples(files, tmp_path):
    first, a, _ = files
    other = changed(tmp_path / "c.h5", first, angle_i=first.replicates["angle_i"] + 1e-9)
    comparison = flocsim.compare(flocsim.open(a), flocsim.open(other))
    assert not comparison.paired and "independent" in comparison.table()
    counts = first.probabilities["n_class"]
    held, decided = counts[..., [0, 2]].sum(-1), counts.sum(-1)
    unknown = first.probabilities["n_undecided"] + first.probabilities["n_failed"]
    most = decided + unknown
    np.testing.assert_array_equal(
        comparison.arrays["pr_a"]["difference_high"], between(held + unknown, most, held, most)[2]
    )


def test_conditions_that_both_have_are_found_by_their_names(files, tmp_path):
    first, a, _ = files
    fewer = attrs.evolve(
        first, types=first.types[::-1][:2], delta=first.delta[1:],
        replicates={k: v[::-1][:2, :, 1:] for k, v in first.replicates.items()},
        probabilities={k: v[::-1][:2, :, 1:] for k, v in first.probabilities.items()},
        pooled={}, differences={}, radii={k: v[::-1][:2] for k, v in first.radii.items()},
    )  # fmt: skip
    write_results(tmp_path / "d.h5", fewer)
    comparison = flocsim.compare(flocsim.open(a), flocsim.open(tmp_path / "d.h5"))
    axes = {name: each.values.tolist() for name, each in comparison.axes.items()}
    assert axes["type"] == [*first.types[1:]] and len(axes["delta"]) == 4
    assert not np.nan_to_num(comparison.arrays["pr_a"]["difference"]).any()
    none = attrs.evolve(fewer, types=("X", "Y"))
    write_results(tmp_path / "e.h5", none)
    with pytest.raises(UsageError, match="no types in common"):
        flocsim.compare(flocsim.open(a), flocsim.open(tmp_path / "e.h5"))


def comparison_without_numerics(a, b):
    """The Comparison of two files whose numerical errors were zero."""
    found = flocsim.compare(flocsim.open(a), flocsim.open(b))
    none = np.zeros_like(found.arrays["pr_a"]["change_low"])
    exact = {"change_low": none, "change_high": none}
    return attrs.evolve(found, arrays={"pr_a": found.arrays["pr_a"] | exact})


def test_the_command_says_what_differs(files, capsys):
    _, a, b = files
    assert main(["compare", str(a), str(b)]) == 0
    said = capsys.readouterr().out
    assert "replicates that both have, paired" in said
    assert re.search(r"-0\.211 \[-0\.330, -0\.071\]  -0\.\d+ \+0\.\d+\n", said)
    exact = comparison_without_numerics(a, b)
    assert re.search(r"-0\.211 \[-0\.330, -0\.071\] +\*\n", exact.table())
    opened = flocsim.open(a), flocsim.open(b)
    for each, value in zip(opened, (1.0, 2.0), strict=True):
        each.run["identity"] = json.dumps({"forces.contact.k_n": value})
    line = "forces.contact.k_n is 1.0 in the first, 2.0 in the second"
    comparison = flocsim.compare(*opened)
    assert comparison.changes == (line,) and comparison.table().startswith(line)
    with pytest.raises(UsageError, match="probability must be one of"):
        comparison.table("pr_class")


def test_tables_have_the_numbers(files):
    pytest.importorskip("xarray")
    _, a, b = files
    comparison = flocsim.compare(flocsim.open(a), flocsim.open(b))
    frame, data = comparison.to_pandas("pr_a"), comparison.to_xarray("pr_a")
    np.testing.assert_array_equal(frame["difference"].to_numpy(), data["difference"].values.ravel())


@pytest.mark.slow
def test_aggregations_per_approach_count_those_that_never_touched(files, tmp_path):
    first, a, _ = files
    outcome, inside = (first.replicates[name].copy() for name in ("outcome", "inside"))
    departed = np.isin(outcome, (1, 3))
    outcome[departed], inside[departed] = 4, 255
    outcome[..., :2][departed[..., :2]] = 7
    other = changed(tmp_path / "m.h5", first, outcome=outcome, inside=inside)
    comparison = flocsim.compare(flocsim.open(a), flocsim.open(other))
    # What departs in one file misses, or is held apart, in the other.
    assert not np.nan_to_num(comparison.arrays["pr_a_per_approach"]["difference"]).any()
    assert np.nan_to_num(comparison.arrays["pr_a"]["difference"]).max() == 0.0
    ends = np.isin(first.replicates["outcome"], range(5)).sum(axis=-1)
    np.testing.assert_array_equal(comparison.arrays["pr_a_per_approach"]["n_first"], ends)
    assert "Pr[aggregation | decided approach]" in comparison.table("pr_a_per_approach")


@pytest.mark.parametrize(
    "identity",
    rest_slow(['{"seed": 1e999}', '{"seed": 99999999999999999999}', "["], lambda each: each == "["),
)
def test_what_no_flocsim_wrote_is_refused_in_one_line(in_tmp, capsys, identity):
    made = make_results(vertices=(1, 4), delta=(0.0, 1.0), count=12)
    write_results(in_tmp / "a.h5", attrs.evolve(made, run=made.run | {"identity": identity}))
    write_results(in_tmp / "b.h5", made)
    assert main(["compare", "a.h5", "b.h5"]) == 74
    [line] = capsys.readouterr().err.splitlines()
    assert "a.h5 has no readable results: run/identity cannot be read" in line
