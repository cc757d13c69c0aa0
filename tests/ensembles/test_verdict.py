"""What a study of pairs ends with where replicates have no outcome."""

import attrs
import numpy as np
import pytest

from flocsim.ensembles.pairs.results import CONTENTS
from flocsim.ensembles.report import verdict
from flocsim.io.results.schema import NOT_APPLICABLE, OUTCOMES
from flocsim.process import WITHHELD
from tests.helpers.synthetic_results import make_results
from tests.helpers.tabulate import tabulate


def with_ends(undecided, failed, limit=None, count=40):
    """Results in which so many replicates of one condition have no outcome; all else miss."""
    outcome = np.full((1, 2, 1, count), OUTCOMES.index("missed"))
    outcome[0, 1, 0, :undecided] = OUTCOMES.index("undecided")
    outcome[0, 1, 0, undecided : undecided + failed] = OUTCOMES.index("failed")
    none = np.full(outcome.shape, NOT_APPLICABLE)
    found = make_results(types=("I",), vertices=(1, 4), delta=(0.0,), count=count)
    run = {} if limit is None else {"most_undecided": limit}
    return attrs.evolve(
        found, probabilities=tabulate(outcome, none, none), run=run, pooled={}, differences={}
    )


@pytest.mark.parametrize(
    ("undecided", "failed", "limit", "code"),
    [
        (0, 0, None, 0),
        (1, 1, None, 0),
        (2, 1, None, WITHHELD),
        (2, 1, 0.1, 0),
        (1, 0, 0.0, WITHHELD),
    ],
)  # fmt: skip
def test_too_many_without_an_outcome_have_a_code_of_their_own(undecided, failed, limit, code):
    found, line = verdict(with_ends(undecided, failed, limit))
    assert found == code
    if code:
        assert line.startswith("warning: of 80 replicates") and "stop.undecided" in line
        assert f"{failed} failed and {undecided} are undecided" in line
        assert "raise integrator.max_steps" in line
    else:
        assert line == ""


def test_the_table_has_the_interval_of_what_may_be_anything():
    assert "[0.000, 1.000]" in CONTENTS.table(with_ends(2, 0))
