"""Outcomes that change between two runs of one study."""

import attrs
import numpy as np
import pytest

from benchmarks.accuracy.tolerance import outcome_changes, percent_changed
from flocsim.ensembles.estimates.outcome_changes import second_run_changes
from flocsim.errors import UsageError
from flocsim.io.results.schema import NOT_APPLICABLE
from tests.helpers.paper_like import paper_results, relabelled
from tests.helpers.synthetic_results import make_results


def test_nothing_changes_in_a_run_against_itself():
    changes = outcome_changes(paper_results(), paper_results())
    assert changes.both.all()
    assert not (changes.aggregation | changes.zone | changes.outcome).any()


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


def test_the_shorter_run_decides():
    whole = paper_results(change)
    few = {name: array[..., :10] for name, array in whole.replicates.items()}
    changes = outcome_changes(paper_results(), relabelled(whole, replicates=few))
    assert changes.both.shape[-1] == 10
    assert percent_changed(changes.outcome, np.ones_like(changes.outcome)) == pytest.approx(
        100 * 3 / 600
    )


def test_other_conditions_are_refused():
    with pytest.raises(UsageError, match="same conditions"):
        outcome_changes(paper_results(), relabelled(paper_results(), delta=(0, 0.1, 0.2, 0.3, 0.4)))


def test_the_share_of_nothing_is_unknown():
    nothing = np.zeros(3, dtype=bool)
    assert np.isnan(percent_changed(nothing, nothing))


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
