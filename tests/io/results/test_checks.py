"""Rows of replicates that no run can have given are refused, each by the column that is wrong."""

import numpy as np
import pytest

from flocsim.io.results.checks import check_rows
from flocsim.io.results.schema import BLANKS, NOT_APPLICABLE, REPLICATES
from tests.helpers.synthetic_results import bonds_of


def rows(outcome, inside, bond):
    """Two rows, the first of a collision inside that aggregated, the second with these codes."""
    columns = {name: np.full(2, BLANKS[kind]) for name, (kind, _, _) in REPLICATES.items()}
    columns |= {name: np.ones(2) for name, (kind, _, _) in REPLICATES.items() if kind == "f8"}
    columns |= {"outcome": np.array([0, outcome]), "inside": np.array([1, inside])}
    return columns | {"bond": np.array([1, bond]), "failure": np.zeros(2, int)}


@pytest.mark.parametrize(("outcome", "inside"), [(0, 1), (3, 0), (4, 255), (5, 0), (6, 255)])
def test_rows_that_can_be_are_taken(outcome, inside):
    check_rows(rows(outcome, inside, bonds_of(outcome)).__getitem__, 7, 1)


@pytest.mark.parametrize(
    ("outcome", "inside"), [(0, 0), (1, 255), (2, 1), (3, 255), (4, 0), (4, 1), (7, 1), (5, 2)]
)
def test_contradictions_are_refused(outcome, inside):
    with pytest.raises(ValueError, match="1 values of replicates/inside are impossible"):
        check_rows(rows(outcome, inside, bonds_of(outcome)).__getitem__, 7, 1)


@pytest.mark.parametrize(("outcome", "bond"), [(0, 255), (0, 0), (0, 4), (1, 1), (5, 3)])
def test_a_bond_that_does_not_go_with_the_outcome_is_refused(outcome, bond):
    inside = NOT_APPLICABLE if outcome == 5 else 1
    with pytest.raises(ValueError, match="1 values of replicates/bond are impossible"):
        check_rows(rows(outcome, inside, bond).__getitem__, 7, 1)
