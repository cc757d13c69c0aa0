"""The error by the shape: changes of the same replicates with outlines cut otherwise."""

import numpy as np
import pytest

from flocsim.ensembles.estimates.statistics import CODES, COUNTED
from flocsim.ensembles.estimates.summary import (
    added,
    outline_changes,
    outline_sums,
    sums_of,
    tables_of,
)
from flocsim.io.results.schema import NOT_APPLICABLE, OUTCOMES, OUTLINES
from tests.helpers.tabulate import tabulate

A, B, C, D, MISSED, UNDECIDED = (
    OUTCOMES.index(name) for name in ("A", "B", "C", "D", "missed", "undecided")
)


def codes(outcomes):
    """Outcome, inside and bond of replicates of one condition."""
    outcome = np.array(outcomes, "u1").reshape(1, 1, 1, -1)
    inside = np.select([np.isin(outcome, (A, B)), np.isin(outcome, (C, D))], [1, 0], NOT_APPLICABLE)
    bond = np.where(np.isin(outcome, (A, C)), 1, NOT_APPLICABLE)
    return outcome, inside, bond


def changes(cut, closer, wider):
    """The arrays of OUTLINES of one condition."""
    first = codes(cut)
    sums = outline_sums(first, [codes(closer), codes(wider)])
    return outline_changes(sums, tabulate(*first))


CUT = [A] * 12 + [B] * 8
LESS = [A] * 6 + [B] * 14
MORE = [A] * 15 + [B] * 5


def test_changes_are_those_of_the_same_replicates():
    found = changes(CUT, LESS, MORE)
    assert set(found) == set(OUTLINES)
    assert found["pr_a_closer"].item() == pytest.approx(-0.3)
    assert found["pr_a_wider"].item() == pytest.approx(0.15)
    assert found["pr_class_closer"].squeeze().tolist() == pytest.approx([-0.3, 0.3, 0.0, 0.0])
    assert found["pr_a_shape_low"] < -0.3 and found["pr_a_shape_high"] > 0.15


def test_the_ends_may_be_exchanged():
    one, other = changes(CUT, LESS, MORE), changes(CUT, MORE, LESS)
    for name in ("pr_a", "pr_class", "pr_inside"):
        np.testing.assert_array_equal(one[f"{name}_closer"], other[f"{name}_wider"])
        for end in ("low", "high"):
            np.testing.assert_array_equal(one[f"{name}_shape_{end}"], other[f"{name}_shape_{end}"])


def test_an_end_that_changes_nothing_narrows_with_the_number_of_replicates():
    few, many = (changes(CUT * count, CUT * count, CUT * count) for count in (1, 50))
    assert few["pr_a_closer"].item() == many["pr_a_wider"].item() == 0.0
    assert few["pr_a_shape_low"] < many["pr_a_shape_low"] < 0.0
    assert many["pr_a_shape_high"] < 0.03


def test_no_change_leads_beyond_0_or_1():
    found = changes([A] * 10, [A] * 10, [A] * 10)
    assert found["pr_a_shape_high"] == 0.0 and found["pr_a_shape_low"] < 0.0


def test_what_is_undecided_with_other_outlines_is_in_the_interval():
    known = changes(CUT, CUT, CUT)
    open_ = changes(CUT, [UNDECIDED] * 4 + CUT[4:], CUT)
    assert open_["pr_a_shape_low"] < known["pr_a_shape_low"]
    assert open_["pr_a_closer"].item() == 0.0  # of those that count both times


def test_nothing_is_said_where_none_was_run():
    none = np.full((1, 1, 1, 20), NOT_APPLICABLE)
    assert outline_sums(codes(CUT), [(none, none, none)] * 2) == {}


def test_sums_of_blocks_add_up():
    """Also where the first block has none that was run with other outlines."""
    random = np.random.default_rng(3)
    columns = [
        np.concatenate(each, axis=-1)
        for each in zip(*(codes(random.choice([A, B, C, D, MISSED], 40)) for _ in range(5)),
                        strict=True)
    ]  # fmt: skip
    first, checked, third, closer, wider = (
        [column[..., 40 * run : 40 * run + 40].copy() for column in columns] for run in range(5)
    )
    for run in (checked, third, closer, wider):
        for column in run:
            column[..., :10] = NOT_APPLICABLE
    every = [*first, *checked, *third, *closer, *wider]
    assert len(every) == len(COUNTED) == 5 * len(CODES)

    def read(start, stop):
        return tuple(column[..., start:stop] for column in every)

    whole = sums_of(read, 1, 0, 40)
    first_two = added(sums_of(read, 1, 0, 10), sums_of(read, 1, 10, 23))
    parts = added(first_two, sums_of(read, 1, 23, 40))
    assert whole.keys() == parts.keys()
    found = tables_of(parts)["outlines"]
    for name, values in tables_of(whole)["outlines"].items():
        np.testing.assert_array_equal(values, found[name])
