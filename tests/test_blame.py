"""A force that gives no number costs the replicates that meet it, and is named in them."""

import math

import pytest

from flocsim import System
from flocsim.__main__ import main
from flocsim.ensembles.collision.draw import FAILED, FAILURES
from flocsim.ensembles.diagnose.preflight import check_study
from flocsim.ensembles.kind import Condition, Overseer
from flocsim.ensembles.study import Study
from flocsim.errors import KernelError, KernelWarning, UsageError
from flocsim.forces import Contact
from flocsim.integrators import Implicit
from flocsim.io.results.file import read_results
from tests.helpers.small_study import load_text
from tests.helpers.tiers import rest_slow
from tests.helpers.trial_scenes import head_on

FORCE = """\
import math
import attrs
from flocsim.forces import BodyForce, CentreForce, ContactForce, SurfaceForce

@attrs.frozen
class Wrong({kind}):
    {more}
    @staticmethod
    def kernel(view):
        return {answer}
"""
STUDY = """\
preset = "tang2014"
seed = 1
replicates = {replicates}
[scene]
types = ["III"]
delta = [0.0]
[shapes]
vertices = [1]
[forces.wrong]
class = "wrong:Wrong"
[stop]
failed = {allowed}
[output]
file = "r.h5"
"""
SLOPE = "@staticmethod\n    def slope(view):\n        return math.nan\n"
REACH = "reach = 5e-6"

CASES = {
    "always": ("CentreForce", "", "math.nan", "gives nan at a gap of 2e-06 m"),
    "near": ("CentreForce", "", "math.inf if view.gap < 1e-6 else 0.0", "at a gap of 1e-06 m"),
    "surface": ("SurfaceForce", REACH, "math.nan if view.gap < 1e-7 else 0.0", "a gap of 1e-07"),
    "overflow": ("CentreForce", "", "math.exp(2e-3 / view.gap)", "gives inf at a gap of 2e-06"),
    "too large": ("CentreForce", "", "math.exp(1e-3 / view.gap)", "e+217 at a gap of 2e-06 m"),
    "by zero": ("CentreForce", "", "1e-12 / (view.gap - view.gap)", "gives inf at a gap of"),
    "slope": ("CentreForce", SLOPE, "0.0", "Wrong.slope (X) gives a slope of nan at a gap of"),
    "contact": ("ContactForce", "", "(math.nan, 0.0)", "gives nan at an overlap of"),
    "stiff": ("ContactForce", "", "(1e300 * view.overlap, 0.0)", "at an overlap of"),
    "late": ("BodyForce", "", "(math.nan if view.time > 1e-3 else 0.0, 0.0, 0.0)", "t = 0.001 s"),
}

LATE = "math.nan if view.time > 1e-3 else 0.0"
"""Of which nothing shows before anything runs."""


def write(folder, kind, more, answer):
    (folder / "wrong.py").write_text(FORCE.format(kind=kind, more=more, answer=answer))


def wrong_study(folder, replicates=2, allowed=1):
    return load_text(folder, STUDY.format(replicates=replicates, allowed=allowed))


def task(study, replicate):
    """(row, note) of a replicate of spheres of type III."""
    [row], notes = study.run_some(Condition("III", 1, 0.0), replicate, replicate + 1, Overseer())
    return row, next(iter(notes), None)


@pytest.mark.parametrize("name", CASES)
def test_a_force_that_gives_no_number_is_named(tmp_path, name):
    kind, more, answer, said = CASES[name]
    write(tmp_path, kind, more, answer)
    row, note = task(Study(wrong_study(tmp_path)), 0)
    assert (row["outcome"], FAILURES[row["failure"]]) == (FAILED, "not finite")
    told = note["why"]
    assert told.startswith("not finite: Wrong.") and f"{tmp_path}/wrong.py:" in told
    assert said.partition(" (X) ")[0] in told and said.rpartition(" (X) ")[2] in told
    assert math.isfinite(row["t_end"])


def test_a_force_that_gives_no_number_to_some_costs_these_alone(tmp_path):
    write(tmp_path, "BodyForce", "", "(math.nan if view.angle > 3.0 else 0.0, 0.0, 0.0)")
    study = Study(wrong_study(tmp_path))
    found = {}
    for replicate in range(12):
        row, note = task(study, replicate)
        lost = row["outcome"] == FAILED
        assert lost == (max(row["angle_i"], row["angle_j"]) > 3.0) == (note is not None)
        found.setdefault(lost, []).append(row)
    assert len(found[True]) and len(found[False])
    write(tmp_path, "BodyForce", "", "(0.0, 0.0, 0.0)")
    sound = Study(wrong_study(tmp_path))
    for row in found[False]:
        assert row["outcome"] == 0 and row["steps"] > 10
    assert task(sound, 0)[1] is None


@pytest.mark.parametrize(
    "answer", ["(math.nan, 0.0, 0.0)", "(1e-12 / (view.vx - view.vx), 0.0, 0.0)"]
)
def test_a_body_force_without_a_number_at_the_start_is_named_before_anything_runs(tmp_path, answer):
    write(tmp_path, "BodyForce", "", answer)
    with pytest.raises(UsageError, match=r"no terminal velocity: Wrong.kernel \(.*wrong.py:\d+\)"):
        check_study(wrong_study(tmp_path))


@pytest.mark.parametrize("name", ["near", "surface", "by zero", "contact"])
def test_no_number_where_all_collide_is_refused_before_anything_runs(tmp_path, name):
    kind, more, answer, _ = CASES[name]
    write(tmp_path, kind, more, answer)
    with pytest.raises(
        KernelError, match=r"^Wrong: Wrong.kernel \(.*wrong.py:\d+\) gives (nan|inf)"
    ):
        check_study(wrong_study(tmp_path))


def test_a_run_of_a_system_names_the_force_that_gives_no_number(tmp_path):
    write(tmp_path, "SurfaceForce", REACH, "math.nan if view.gap < 5e-8 else 0.0")
    force = wrong_study(tmp_path).forces[-1]
    system = System(head_on(), [force, Contact()], Implicit(1e-9))
    with pytest.warns(
        KernelWarning, match=r"ended at t = .* s \(STALLED\): Wrong.kernel \(.*wrong.py:\d"
    ):
        assert system.run(until=1e-3).status.name == "STALLED"


@pytest.mark.parametrize(
    ("answer", "allowed", "words", "said", "kept"),
    rest_slow([
        (LATE, 1, (), "no replicate has reached an outcome, 3 failed and 0 are und", True),
        (LATE, 0.1, (), "1 replicate failed, more than stop.failed allows", False),
        ("0.0", 1, ("--set", "integrator.max_steps=5"), "0 failed and 3 are undecided: raise int",
         True),
    ], lambda answer, allowed, words, said, kept: not words and allowed == 1),
)  # fmt: skip
def test_a_study_in_which_nothing_is_decided_ends_with_70(
    in_tmp, capsys, answer, allowed, words, said, kept
):
    write(in_tmp, "CentreForce", "", answer)
    (in_tmp / "c.toml").write_text(STUDY.format(replicates=3, allowed=allowed))
    assert main(["ensemble", "c.toml", *words]) == 70
    told = capsys.readouterr()
    [line] = [each for each in told.err.splitlines() if each.startswith("flocsim: ")]
    assert said in line and ("Wrong.kernel (" in line) == (answer != "0.0")
    assert (in_tmp / "r.h5").exists() == kept
    if kept:
        counts = read_results(in_tmp / "r.h5").probabilities
        assert int(counts["n_failed"].sum() + counts["n_undecided"].sum()) == 3
        table = [line.split() for line in told.out.splitlines()]
        ends = ["3", "failed"] if answer == LATE else ["3", "undecided"]
        assert any(words[-2:] == ends for words in table)
