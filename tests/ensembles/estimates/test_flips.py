"""Flips between two runs of one study."""

import numpy as np
import pytest

from flocsim.ensembles.estimates.flips import flips_between, share
from flocsim.errors import UsageError
from tests.helpers.paper_like import paper_results, relabelled


def test_a_run_does_not_flip_against_itself():
    flips = flips_between(paper_results(), paper_results())
    assert flips.both.all()
    assert not (flips.aggregation | flips.zone | flips.outcome).any()


def change(outcome, inside):
    outcome[0, 0, 0, 0] = 1  # A to B: aggregation
    outcome[0, 0, 1, 0], inside[0, 0, 1, 0] = 2, 0  # A to C: zone
    outcome[0, 0, 2, 0], inside[0, 0, 2, 0] = 4, 255  # A to missed


def test_flips_are_told_apart():
    flips = flips_between(paper_results(), paper_results(change))
    places = [np.argwhere(each).tolist() for each in (flips.aggregation, flips.zone)]
    assert places == [[[0, 0, 0, 0]], [[0, 0, 1, 0]]]
    assert np.count_nonzero(flips.outcome) == 3
    assert np.count_nonzero(~flips.both) == 1


def test_the_shorter_run_decides():
    whole = paper_results(change)
    few = {name: array[..., :10] for name, array in whole.replicates.items()}
    flips = flips_between(paper_results(), relabelled(whole, replicates=few))
    assert flips.both.shape[-1] == 10
    assert share(flips.outcome, np.ones_like(flips.outcome)) == pytest.approx(100 * 3 / 600)


def test_other_conditions_are_refused():
    with pytest.raises(UsageError, match="same conditions"):
        flips_between(paper_results(), relabelled(paper_results(), delta=(0, 0.1, 0.2, 0.3, 0.4)))


def test_the_share_of_nothing_is_unknown():
    nothing = np.zeros(3, dtype=bool)
    assert np.isnan(share(nothing, nothing))
