"""`flocsim check`: a study's own scene at its extremes, judged, with nothing silent."""

import math
from itertools import product

import attrs
import pytest

from flocsim.__main__ import main, make_parser
from flocsim.commands import check
from flocsim.ensembles.collision.draw import Draw
from flocsim.ensembles.config.loader import load_config
from flocsim.forces import Contact
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


def parsed(*words):
    return make_parser().parse_args(["check", "small.toml", *words])


def cases(*words):
    args = parsed(*words)
    config = check.sized(load_config(args.config), check.ends("--size", args.size, "m"))
    return config, list(check.cases_of(config, args))


@pytest.mark.parametrize("types", rest_slow([["III"], ["I", "III"]], lambda types: len(types) == 1))
def test_every_combination_of_ends_is_run_and_judged(folder, capsys, types):
    code, rows, last = call(capsys, "--count", "1", "--set", f"scene.types={types}")
    assert code == 0
    found = [row.split() for row in rows]
    assert {(row[0], row[2], row[4]) for row in found} == set(
        product(types, ("2", "200"), ("1e-09", "1e-11"))
    )
    assert len(rows) == 4 * len(types) and all(
        row.endswith(("right", "stated error")) for row in rows
    )
    for row in found:
        steps, error, stated = int(row[8]), float(row[10]), float(row[11])
        assert steps > 10 and error <= max(stated, float(row[4]))
    assert last.endswith(", 0 failed")
    assert [path.name for path in folder.iterdir()] == ["small.toml"]


def test_what_is_refused_fails_with_its_reason_and_the_others_go_on(folder, capsys):
    words = ["--stiffness", "1e-5 N/m", "20 N/m", "--count", "1", "--set", 'scene.types=["I"]']
    code, rows, last = call(capsys, *words)
    assert code == 1
    assert [("failed: I: an impact at" in row, "right" in row) for row in rows] == [
        (True, False), (True, False), (False, True), (False, True),
    ]  # fmt: skip
    assert last.startswith("2 right") and last.endswith("2 failed")


def test_a_run_that_does_not_end_fails_with_its_reason(folder, capsys):
    words = ["--count", "1", "--set", "integrator.max_steps=5", "--set", 'scene.types=["I"]']
    code, rows, _ = call(capsys, *words)
    assert code == 1
    assert all(row.endswith("failed: undecided (step budget)") for row in rows)


class Judged:
    """One case of the small study, as the command would judge it."""

    def __init__(self):
        config, found = cases("--count", "1")
        self.checker, self.case = check.Checker(config), found[0]

    def __call__(self):
        return self.checker.judge(self.case, 1e-13)


def test_an_error_beyond_the_tolerance_must_be_within_what_is_stated(folder, monkeypatch):
    judge = Judged()
    assert judge().kind == check.RIGHT
    monkeypatch.setattr(check, "allowed", lambda scene: 0.0)
    verdict = judge()
    assert verdict.kind == check.STATED and 0.0 < verdict.error <= verdict.stated
    monkeypatch.setattr(check.Run, "error", property(lambda run: 0.9 * verdict.error))
    assert judge().why.startswith("no good reference: off by ")
    monkeypatch.setattr(check.Run, "error", property(lambda run: 0.1 * verdict.error))
    beyond = judge()
    assert (beyond.kind, beyond.error) == (check.WRONG, verdict.error)
    assert beyond.why.endswith("10 times its stated error")


def test_an_outcome_that_is_not_the_references_fails(folder, monkeypatch):
    judge, rows = Judged(), []
    judge()  # warm

    def row_of(draw, run, status):
        rows.append(plain(draw, run, status))
        return rows[-1] | ({"outcome": 1} if len(rows) == 2 else {})

    plain = Draw.row
    monkeypatch.setattr(Draw, "row", row_of)
    verdict = judge()
    assert verdict.kind == check.WRONG
    assert verdict.why.startswith("A, inside, and the reference B, inside")


def test_without_a_reference_nothing_is_right(folder, monkeypatch):
    judge = Judged()
    judge()
    monkeypatch.setattr(check, "MORE_STEPS", 0)
    verdict = judge()
    assert verdict.kind == check.WRONG
    assert verdict.why == "no reference: it ends undecided (step budget)"


def test_an_exception_is_a_row(folder, monkeypatch):
    judge = Judged()
    monkeypatch.setattr(check, "judged", lambda *arguments: 1 / 0)
    assert judge().why == "ZeroDivisionError: division by zero"


def test_a_motion_that_amplifies_a_nudge_says_so(folder, monkeypatch):
    judge = Judged()
    monkeypatch.setattr(check, "allowed", lambda scene: 0.0)
    monkeypatch.setattr(check, "MOST_AMPLIFIED", 0.0)
    monkeypatch.setattr(check.Run, "error", property(lambda run: 1e-20))
    words = judge().why
    assert "; the motion amplifies a perturbation " in words
    # Spheres that fall head on forget what they were moved by along their way, and no more grows.
    assert 0.0 < float(words.split()[-2]) < 10.0


def test_the_ends_of_what_is_stated(folder):
    config, found = cases(
        "--size", "5 um", "40 um", "--tolerance", "1e-11", "1 um", "--count", "1",
        "--stiffness", "1 N/m", "1e3",
    )  # fmt: skip
    radii = [radii for _, radii in config.scene.given]
    assert [pair[1] for pair in radii] == [5e-6, 40e-6]
    assert all(pair[0] / pair[1] == pytest.approx(16.41 / 23.02, rel=5e-3) for pair in radii)
    assert {case.method.tolerance for case in found} == {1e-11, 1e-6}
    assert {case.stiffness for case in found} == {1.0, 1e3}
    assert len(found) == 8


def test_the_stiffness_takes_the_tangential_one_with_it(folder):
    law = check.law_of(check.stiff(load_config("small.toml"), 500.0))
    assert (law.k_n, law.k_t) == (500.0, 50.0)


def test_a_default_end_is_none_that_is_refused_anyway(folder):
    write_small(folder, vertices="[4]")
    config = load_config("small.toml", {"bodies": {"surface_density": 8.0}})
    assert check.stiffnesses(config, None) == [20.0, 200.0]
    assert check.stiffnesses(load_config("small.toml"), None) == [2.0, 200.0]


def test_a_law_without_k_n_is_run_as_it_is(folder):
    config = load_config("small.toml")
    others = tuple(force for force in config.forces if not isinstance(force, Contact))
    bare = attrs.evolve(config, forces=others)
    assert all(map(math.isnan, check.stiffnesses(bare, None)))
    assert check.stiff(bare, math.nan) is bare
    with pytest.raises(check.UsageError, match=r"--stiffness needs forces\.contact"):
        check.stiffnesses(bare, (1.0, 2.0))


VERLET = ["--set", "integrator.name=velocity_verlet", "--set", "integrator.step=1e-7"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--count", "0"], "--count must be at least 1, found 0"),
        (["--stiffness", "5", "1"], "--stiffness must be two values above 0, LOW and HIGH"),
        (["--tolerance", "nm", "1"], "--tolerance: "),
        (["--size", "1 um", "2 kg"], "--size: "),
        (["--tolerance", "1e-9", "1e-8", *VERLET], "has no tolerance: leave --tolerance out"),
        (["--set", "forces.contact=false"], "a collision needs a contact force"),
    ],
)
def test_what_is_wrong_is_one_line(folder, capsys, words, said):
    assert main(["check", "small.toml", *words]) == 2
    output, errors = capsys.readouterr()
    [line] = errors.splitlines()
    assert said in line
    assert output == ""


def ends(outcome, inside, distance):
    """What a row says of its end."""
    return {"outcome": OUTCOMES.index(outcome), "inside": inside, "d_c_collision": distance}


@pytest.mark.parametrize(
    ("one", "two", "expected"),
    [
        (ends("missed", 255, math.nan), ends("D", 0, 1e-5), True),
        (ends("B", 1, 1e-5), ends("missed", 255, math.nan), True),
        (ends("missed", 255, math.nan), ends("C", 0, 1e-5), False),
        (ends("A", 1, 1e-5), ends("C", 0, 1e-5 + 1e-10), True),
        (ends("A", 1, 1e-5), ends("C", 0, 1.1e-5), False),
        (ends("A", 1, 1e-5), ends("B", 1, 1e-5), False),
    ],
)
def test_a_graze_and_the_border_of_the_zone_are_close_calls(one, two, expected):
    assert check.is_close_call(one, two, 1e-9) is expected
