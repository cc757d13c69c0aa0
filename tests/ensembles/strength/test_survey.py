"""The bound doublets of a file in flows: which are tested, their distribution, file and command."""

import math
import signal
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from flocsim import __main__ as program
from flocsim.commands import plot
from flocsim.ensembles.strength import survey as module
from flocsim.ensembles.strength.opening import Opening
from flocsim.ensembles.strength.survey import Survey, bound_doublets, gathered, in_words
from flocsim.errors import UsageError
from flocsim.io.plots.curves import over_rate
from flocsim.io.results.strength_file import (
    FAILED,
    OPENED,
    QUANTILES,
    quantiles_of,
    read_strengths,
    table_of,
)
from tests.helpers.small_rates import AXES, mixed
from tests.helpers.small_study import small_config


class FakeResults:
    """A results file of 2 × 2 × 2 conditions of three replicates, run again by nobody."""

    types, vertices, delta = AXES
    path = "study.h5"

    def __init__(self, folder, seed=1):
        over = {"shapes": {"vertices": [1, 16]}}
        self.seed, self.config = seed, small_config(folder, over)
        self.run = {"preset": "tang2014", "flocsim_version": "0.2.0"}
        outcome = np.full((2, 2, 2, 3), 4)
        outcome[0, 0, 0] = (0, 1, 2)
        outcome[1, 1, 1] = (0, 0, 0)
        self.replicates = {"outcome": outcome, "bond": np.where(outcome < 4, 1 + outcome % 3, 255)}
        self.asked = []

    def replicate(self, *place):
        self.asked.append(place)
        return place

    def stored(self, name):
        return {"seed": self.seed}


def test_every_process_opens_the_results_itself(monkeypatch):
    """After a fork two processes share the position in a file that was open before."""
    monkeypatch.setattr(
        module,
        "StudyResults",
        lambda path, allowed: SimpleNamespace(path=path, config=SimpleNamespace(forces=())),
    )
    monkeypatch.setattr(module, "refuse_outlines", lambda forces, what: None)
    survey = Survey("opened by two.h5")
    first = survey.results
    assert survey.results is first
    monkeypatch.setattr(module.os, "getpid", lambda: 0)
    assert survey.results is not first


def opening_of(start):
    """What is found of a doublet: it opens at 100/s times one more than its replicate."""
    rate = 100.0 * (1 + start[0])
    return Opening(0.99 * rate, rate, OPENED, 20, 1e-11)


@pytest.fixture
def fake(monkeypatch, tmp_path):
    """The results, and doublets that nobody runs."""

    def doublet(start, flow):
        return SimpleNamespace(opening=lambda precision: opening_of(start))

    monkeypatch.setattr(module, "Doublet", doublet)
    results = FakeResults(tmp_path)
    monkeypatch.setattr(module, "opened", lambda *_: results)
    return results


def survey(results, count=None, **given):
    """The Strengths that a survey finds."""
    made = Survey("study.h5", count=count, **given)
    tested = {each: made.test(each) for each in bound_doublets(results, count)}
    return gathered(made, tested, True)


def test_every_one_is_run_again(fake):
    found = survey(fake)
    assert fake.asked == [
        (0, "I", 1, 0.0),
        (2, "I", 1, 0.0),
        *((k, "III", 16, 0.5) for k in range(3)),
    ]
    assert found.column("opens").tolist() == [100.0, 300.0, 100.0, 200.0, 300.0]
    assert found.column("bond").tolist() == [1, 3, 1, 1, 1]
    assert found.table("n_bound")[0, 0, 0] == found.table("n_tested")[0, 0, 0] == 2
    assert found.table("rate")[1, 1, 1, 2] == 200.0
    assert np.isnan(found.table("rate")[0, 1]).all()
    assert found.complete and found.progress == "5 doublets"


def test_what_is_found_is_told_in_words():
    assert in_words(Opening(297.0, 300.0, OPENED, 20)) == "opens at 300 1/s (20 runs)"
    assert in_words(Opening(4.0, math.nan, FAILED, 3)) == "a run failed above 4 1/s (3 runs)"


def test_a_count_takes_the_first_of_every_condition(fake):
    found = survey(fake, count=1)
    assert found.column("replicate").tolist() == [0, 0]
    assert found.table("n_bound")[1, 1, 1] == 3 and found.table("n_tested")[1, 1, 1] == 1


@pytest.mark.parametrize(
    ("given", "words"),
    [({"flow": "rain"}, "flow must be one of shear, extension"),
     ({"precision": 0.0}, "precision must lie between")],
)  # fmt: skip
def test_bad_input_is_refused(given, words):
    with pytest.raises(UsageError, match=words):
        Survey("study.h5", **given)


def test_a_study_without_a_bond_is_refused(fake):
    fake.replicates["outcome"][:] = 4
    with pytest.raises(UsageError, match="has no bound doublet"):
        bound_doublets(fake)


def test_quantiles_count_what_holds_as_never():
    assert quantiles_of(np.array([3.0, 1.0, 2.0]), 0).tolist() == [1.0, 1.0, 2.0, 3.0, 3.0]
    assert quantiles_of(np.array([1.0]), 3).tolist() == [1.0, 1.0, math.inf, math.inf, math.inf]
    assert np.isnan(quantiles_of(np.array([]), 0)).all()


def test_counts_of_a_condition():
    found = mixed()
    counts = [int(found.table(f"n_{name}")[1, 0, 1])
              for name in ("bound", "tested", "opened", "holding", "failed")]  # fmt: skip
    assert counts == [6, 4, 2, 1, 1]
    assert found.table("rate")[1, 0, 1].tolist() == [0.5, 0.5, 2.0, math.inf, math.inf]
    lines = table_of(found).splitlines()
    assert len(lines) == 2 and lines[1].split()[:6] == ["III", "1", "0.5", "6", "4", "2"]


def test_the_file_comes_back_and_says_whether_it_is_complete(tmp_path):
    mixed(complete=False).write(tmp_path / "s.h5")
    back = read_strengths(tmp_path / "s.h5")
    assert same(mixed(complete=False), back) and back.table("quantile").tolist() == list(QUANTILES)
    assert not back.complete and mixed().complete
    assert plot.read_content(tmp_path / "s.h5")[2] == "unfinished: 4 doublets"


def test_the_figure_shows_the_share_that_has_opened():
    figure = over_rate(mixed())
    lines = [line for axes in figure.axes for line in axes.get_lines() if len(line.get_xdata())]
    assert any(np.allclose(line.get_ydata(), [1 / 3, 2 / 3]) for line in lines)


@pytest.fixture
def command(fake, in_tmp):
    """Runs the command in a folder where study.h5 is the fake one."""
    (in_tmp / "study.h5").write_bytes(b"never read here")
    before = {each: signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)}
    yield lambda *words: program.main(["strength", "study.h5", *map(str, words)])
    for each, action in before.items():
        signal.signal(each, action)


def same(one, other):
    """Whether two surveys have found the same of the same."""
    for group in ("doublets", "conditions"):
        for name, values in one.groups[group].items():
            np.testing.assert_array_equal(values, other.groups[group][name])
    known = [{k: v for k, v in each.about.items() if k != "date"} for each in (one, other)]
    assert known[0] == known[1]
    return True


def test_the_command_writes_one_file_and_a_figure_and_replaces_none(
    fake, command, tmp_path, capsys
):
    assert command() == 0
    assert "III" in capsys.readouterr().out
    names = {path.name for path in tmp_path.iterdir()}
    assert names >= {"study-strength.h5", "study-strength.png"} and len(names) == 4
    assert read_strengths("study-strength.h5").about["flow"] == "shear"
    kind, found, *_ = plot.read_content("study-strength.h5")
    assert kind.figures(found).keys() == {"strength"}
    before = (tmp_path / "study-strength.h5").read_bytes()
    fake.asked.clear()
    assert command("--flow", "extension") == 2
    assert not fake.asked and "already exists" in capsys.readouterr().err
    assert (tmp_path / "study-strength.h5").read_bytes() == before
    assert command("--flow", "extension", "--overwrite", "--quiet") == 0
    assert (tmp_path / "study-strength.1.h5").read_bytes() == before
    assert read_strengths("study-strength.h5").about["flow"] == "extension"
    assert command("-o", "study.h5", "--overwrite") == 2
    assert "which is an input" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        command("--jobs", "0")


def test_a_stopped_command_keeps_what_it_has_tested_and_is_resumed(fake, command, capsys):
    run_again = fake.replicate

    def third_stopped(*place):
        if len(fake.asked) == 2:
            signal.raise_signal(signal.SIGTERM)
        return run_again(*place)

    fake.replicate = third_stopped
    assert command() == 75
    *_, why, how = capsys.readouterr().err.splitlines()
    assert "stopped by SIGTERM: 2 tested doublets are in study-strength.h5" in why
    assert how.endswith("--resume")
    assert program.main(["info", "study-strength.h5"]) == 0
    assert "2 doublets so far; continue with --resume" in capsys.readouterr().out
    fake.replicate = run_again
    before = Path("study-strength.h5").read_bytes()
    assert command() == 2 and command("--resume", "--flow", "extension") == 2
    told = capsys.readouterr().err
    assert "continue it with --resume" in told and "flow is 'shear' in the file" in told
    assert Path("study-strength.h5").read_bytes() == before
    fake.asked.clear()
    assert command("--resume") == 0 and len(fake.asked) == 3
    assert same(read_strengths("study-strength.h5"), survey(fake))


def test_resume_tests_more_and_keeps_what_is_there(fake, command):
    assert command("--resume", "--count", "1", "--quiet") == 0
    assert read_strengths("study-strength.h5").complete
    fake.asked.clear()
    assert command("--resume", "--quiet") == 0 and len(fake.asked) == 3
    assert same(read_strengths("study-strength.h5"), survey(fake))
    # A smaller count drops nothing.
    assert command("--resume", "--count", "1", "--quiet") == 0
    assert same(read_strengths("study-strength.h5"), survey(fake))


def test_a_survey_of_other_data_is_not_continued(fake, command, capsys):
    assert command("--count", "1", "--quiet") == 0
    fake.seed = 2
    assert command("--resume") == 2
    assert "study_digest is" in capsys.readouterr().err


def test_a_file_of_something_else_is_not_replaced(command):
    Path("other.h5").write_bytes(b"mine")
    assert command("--resume", "-o", "other.h5") != 0
    assert Path("other.h5").read_bytes() == b"mine"
