"""`flocsim check`: a study's own scene at its extremes, judged, with nothing silent."""

import math
from itertools import product

import pytest

from flocsim.__main__ import main
from flocsim.commands import check
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.diagnose.accuracy import Comparison
from flocsim.integrators import Implicit, VelocityVerlet
from flocsim.io.results.schema import OUTCOMES
from tests.helpers.small_study import write_small
from tests.helpers.tiers import rest_slow


def call(capsys, *words):
    """(exit code, the table's rows, the last line) of the command."""
    code = main(["check", "small.toml", *words])
    output, errors = capsys.readouterr()
    assert errors == ""
    lines = output.splitlines()
    return code, lines[4:-2], lines[-1]


@pytest.mark.parametrize("types", rest_slow([["III"], ["I", "III"]], lambda types: len(types) == 1))
def test_every_combination_of_ends_is_run_and_judged(folder, capsys, types):
    code, rows, last = call(capsys, "--count", "1", "--set", f"scene.types={types}")
    assert code == 0
    found = [row.split() for row in rows]
    assert {(row[0], row[3]) for row in found} == set(product(types, ("1e-09", "1e-11")))
    assert len(rows) == 2 * len(types) and all(
        row.endswith(("tolerance", "stated error")) for row in rows
    )
    for row in found:
        steps, error, stated = int(row[7]), float(row[9]), float(row[10])
        assert steps > 10 and error <= max(stated, float(row[3]))
    assert last.endswith(", 0 failed")
    assert [path.name for path in folder.iterdir()] == ["small.toml"]


def test_a_run_that_does_not_end_fails_with_its_reason(folder, capsys):
    words = ["--count", "1", "--set", "integrator.max_steps=5", "--set", 'scene.types=["I"]']
    code, rows, _ = call(capsys, *words)
    assert code == 1
    assert all(row.endswith("failed: undecided (step budget)") for row in rows)


def end(outcome, inside=1, distance=1e-5):
    """What a row says of its end."""
    return {
        "outcome": OUTCOMES.index(outcome), "inside": inside, "d_c_collision": distance,
        "failure": 0, "r_i": 1e-5, "r_j": 2e-5,
    }  # fmt: skip


def verdict(error, stated=0.0, slack=0.0, method=None, one=None, two=None):
    found = Comparison(
        one or end("A"), two or end("A"), error=error, stated=stated, slack=slack
    )  # fmt: skip
    return check.verdict_on(found, method or Implicit(1e-9))


def test_an_error_beyond_the_tolerance_must_be_within_what_is_stated():
    assert verdict(1e-9) == (check.RIGHT, "")
    assert verdict(1e-8, 2e-8) == (check.STATED, "")
    assert verdict(1e-8, 5e-9, 1e-9) == (
        check.WRONG, "error 1e-08 m, of the reference at most 1e-09 m",
    )  # fmt: skip


def test_a_method_without_a_tolerance_may_be_off_by_a_share_of_the_smaller_radius():
    fixed = VelocityVerlet(1e-8)
    assert verdict(0.9e-7, math.nan, method=fixed) == (check.RIGHT, "")
    assert verdict(1.1e-7, math.nan, method=fixed)[0] == check.WRONG


def test_an_outcome_that_is_not_the_references_fails():
    assert verdict(0.0, two=end("B")) == (check.WRONG, "A, inside, but B, inside in the reference")


@pytest.mark.parametrize(
    ("one", "two", "kind"),
    [
        (end("missed", 255, math.nan), end("D", 0), check.STATED),
        (end("B"), end("missed", 255, math.nan), check.STATED),
        (end("missed", 255, math.nan), end("C", 0), check.WRONG),
        (end("A"), end("C", 0, 1e-5 + 1e-10), check.STATED),
        (end("A"), end("C", 0, 1.1e-5), check.WRONG),
        (end("A"), end("B"), check.WRONG),
    ],
)
def test_a_graze_and_the_border_of_the_zone_are_close_calls(one, two, kind):
    assert verdict(1e-10, 0.0, one=one, two=two)[0] == kind
    assert verdict(1e-8, 0.0, one=one, two=two)[0] == check.WRONG


def test_without_a_reference_nothing_is_right():
    found = Comparison(end("A"), why="no reference: it ends undecided (step budget)")
    assert check.verdict_on(found, Implicit(1e-9)) == (check.WRONG, found.why)


def test_the_extremes_of_sizes_and_vertices(folder):
    more = {"scene": {"types": ["II", "I", "III"]}, "shapes": {"vertices": [4, 1, 16]}}
    assert check.extremes_of(load_config("small.toml", more)) == ([1, 2], [1, 16])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--set", "forces.contact=false"], "colliding bodies need a contact force"),
        (["--set", "bodies.surface_density=20"], "I: an impact at"),
    ],
)
def test_what_is_wrong_is_one_line(folder, capsys, words, said):
    write_small(folder, vertices="[4]")
    assert main(["check", "small.toml", *words]) == 2
    output, errors = capsys.readouterr()
    [line] = errors.splitlines()
    assert said in line
    assert output == ""
