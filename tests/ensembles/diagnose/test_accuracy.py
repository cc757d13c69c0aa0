"""A run compared with a more exact one of the same replicate."""

import math

import pytest

from flocsim.ensembles.diagnose.accuracy import Bench, number, table_line
from flocsim.integrators import Implicit
from tests.helpers.small_study import small_study

TASK = ((1, 4, 0.0), 1)


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    return Bench(small_study(tmp_path_factory.mktemp("study")), Implicit(1e-12))


def test_a_run_ends_as_in_the_study(bench):
    row = bench.study.run(*TASK[0], TASK[1])
    found = bench.compare(TASK, bench.study.config.integrator.method)
    assert [found.row[name] for name in ("outcome", "inside", "t_end")] == [
        row[name] for name in ("outcome", "inside", "t_end")
    ]
    assert not found.flipped and found.why == ""
    assert found.cpu > 0.0 and found.steps > 0


def test_errors_fall_with_the_tolerance_and_vanish_at_the_references_own(bench):
    loose, tight, same = (
        bench.compare(TASK, Implicit(tolerance)) for tolerance in (1e-6, 1e-9, 1e-12)
    )
    assert same.error == 0.0 < tight.error < loose.error < 1e-4
    assert all(each.stated > 0.0 for each in (loose, tight, same))


def test_a_run_without_an_end_has_no_error(bench):
    found = bench.compare(TASK, Implicit(1e-9), budget=2)
    assert math.isnan(found.error) and found.why == "undecided (step budget)"
    assert found.flipped


def test_an_exception_costs_one_run(bench):
    found = bench.compare((("no type", 4, 0.0), 1), Implicit(1e-9))
    assert found.why.startswith("TypeError: ") and math.isnan(found.error)


def test_a_table(bench):
    columns = {"a": -4, "b": 6}
    assert table_line(columns) == "a        b"
    assert table_line(columns, ["x", number(math.nan)]) == "x        -"
    assert number(0.00123) == "1.2e-03"
