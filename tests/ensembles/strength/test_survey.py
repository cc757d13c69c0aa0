"""All bound doublets of a file: which are tested, their distribution, the file, and the command."""

import math
import signal
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from flocsim import __main__ as program
from flocsim.commands import plot
from flocsim.commands.strength import Stop
from flocsim.ensembles.strength import survey as module
from flocsim.ensembles.strength.distribution import quantiles_of, table_of
from flocsim.ensembles.strength.opening import OPENED, Opening
from flocsim.ensembles.strength.survey import Bound, bound_doublets, survey
from flocsim.errors import FileError, UsageError
from flocsim.io.plots.strength import over_rate
from flocsim.io.results.strength_file import QUANTILES, read_strengths, write_strengths
from tests.helpers.small_rates import AXES, mixed


class FakeResults:
    """A results file of 2 × 2 × 2 conditions of three replicates, run again by nobody."""

    types, vertices, delta = AXES
    path, source, folder = "study.h5", "study.h5", "."

    def __init__(self, seed=1):
        self.seed = seed
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


@pytest.fixture
def fake(monkeypatch):
    """Doublets that open at 100/s times one more than their replicate."""

    def doublet(start, flow):
        rate = 100.0 * (1 + start[0])
        return SimpleNamespace(
            opening=lambda precision: Opening(0.99 * rate, rate, OPENED, 20, 1e-11)
        )

    monkeypatch.setattr(module, "Doublet", doublet)
    results = FakeResults()
    monkeypatch.setattr("flocsim.ensembles.studies.opened.open_results", lambda _: results)
    return results


def test_the_bound_ones_are_those_of_classes_a_and_c():
    found = list(bound_doublets(FakeResults()))
    assert found == [
        Bound(0, 0, 0, 0, 1),
        Bound(0, 0, 0, 2, 3),
        *(Bound(1, 1, 1, k, 1) for k in range(3)),
    ]


def test_every_one_is_run_again_and_told(fake):
    said = []
    found = survey(fake, tell=said.append)
    assert fake.asked == [
        (0, "I", 1, 0.0),
        (2, "I", 1, 0.0),
        *((k, "III", 16, 0.5) for k in range(3)),
    ]
    assert found.column("opens").tolist() == [100.0, 300.0, 100.0, 200.0, 300.0]
    assert found.table("n_bound")[0, 0, 0] == found.table("n_tested")[0, 0, 0] == 2
    assert found.table("rate")[1, 1, 1, 2] == 200.0
    assert np.isnan(found.table("rate")[0, 1]).all()
    assert said[1] == "2 of 5: type I, N = 1, delta 0, replicate 2: opens at 300 1/s (20 runs)"


def test_a_count_takes_the_first_of_every_condition(fake):
    found = survey(fake, count=1)
    assert found.column("replicate").tolist() == [0, 0]
    assert found.table("n_bound")[1, 1, 1] == 3 and found.table("n_tested")[1, 1, 1] == 1


@pytest.mark.parametrize(
    ("given", "words"),
    [({"flow": "rain"}, "flow must be one of shear, extension"), ({"count": 0}, "count must be"),
     ({"precision": 0.0}, "precision must lie between"), ({"jobs": 0}, "jobs must be")],
)  # fmt: skip
def test_bad_input_is_refused(fake, given, words):
    with pytest.raises(UsageError, match=words):
        survey(fake, **given)
    fake.replicates["outcome"][:] = 4
    with pytest.raises(UsageError, match="holds no bound doublet"):
        survey(fake)


def same(one, other):
    """Whether two surveys have found the same of the same."""
    left_out = {"date"}
    for group in ("doublets", "conditions"):
        for name, column in getattr(one, group).columns.items():
            np.testing.assert_array_equal(column.values, getattr(other, group).columns[name].values)
    known = [{k: v for k, v in each.about.items() if k not in left_out} for each in (one, other)]
    assert known[0] == known[1]
    return True


def stopped(results, after, **given):
    """What has been kept of a survey that Ctrl-C has stopped after so many doublets."""
    kept, run_again = [], results.replicate

    def replicate(*place):
        if len(results.asked) == after:
            raise KeyboardInterrupt
        return run_again(*place)

    results.replicate = replicate
    with pytest.raises(KeyboardInterrupt):
        survey(results, keep=kept.append, **given)
    results.replicate = run_again
    results.asked.clear()
    return kept


def test_what_is_tested_is_kept_as_it_goes(fake):
    kept = []
    found = survey(fake, keep=kept.append, every=0.0)
    assert [int(each.table("n_tested").sum()) for each in kept] == [1, 2, 3, 4, 5, 5]
    assert [each.complete for each in kept] == [False] * 4 + [True] * 2
    assert kept[1].progress == "2 of 5 doublets" and kept[1].table("n_bound").sum() == 5
    assert same(kept[-1], found)
    few = []
    survey(fake, keep=few.append)
    assert len(few) == 1  # at the end: that took no 20 s


@pytest.mark.parametrize("after", [1, 2, 4])
def test_a_survey_that_was_stopped_goes_on_to_the_same(fake, after):
    whole = survey(FakeResults())
    [kept] = stopped(fake, after)
    assert len(kept.column("status")) == after and not kept.complete
    said = []
    assert same(survey(fake, known=kept, tell=said.append), whole)
    assert len(fake.asked) == 5 - after and said[0].startswith(f"{after + 1} of 5: ")


def test_what_is_there_stays_and_more_is_tested(fake):
    few = survey(fake, count=1)
    assert few.complete and few.progress == "2 of 2 doublets"
    more = survey(fake, known=few)
    assert same(more, survey(FakeResults())) and more.about["date"] == few.about["date"]
    # Less is not asked for by a smaller count.
    fake.asked.clear()
    assert same(survey(fake, known=more, count=1), more) and not fake.asked


@pytest.mark.parametrize(
    ("change", "words"),
    [({"flow": "extension"}, "its flow is extension, not shear"),
     ({"precision": 0.1}, "its precision is 0.1, not 0.005"),
     ({"study": "other.h5"}, "it is of the study other.h5, not of study.h5"),
     ({"study_digest": "0"}, "the study study.h5 holds other data"),
     ({"flocsim_version": "0.0"}, "it was made by flocsim 0.0, and this is"),
     ({"code": None}, "flocsim has changed how it tests doublets")],
)  # fmt: skip
def test_no_survey_goes_on_with_another_one(fake, change, words):
    known = survey(fake, count=1)
    known.about.update(change)
    with pytest.raises(UsageError, match=words):
        survey(fake, known=known)


def test_data_of_another_study_are_seen(fake):
    known = survey(fake, count=1)
    for other in (FakeResults(seed=2), FakeResults(), FakeResults()):
        if other.seed == 1:
            other.replicates["outcome"][0, 1, 1, 2] = 2
        with pytest.raises(UsageError, match="holds other data"):
            survey(other, known=known)
    known.doublets.columns["replicate"].values[0] = 1
    with pytest.raises(UsageError, match="doublets that the study does not have"):
        survey(FakeResults(), known=known)


def test_rows_are_in_the_order_of_the_study_whoever_is_done_first(fake, monkeypatch):
    asked = []

    def backwards(begin, given, tasks, jobs):
        asked.append((given, jobs))
        for each in reversed(tasks):
            yield each, module.opening_of(fake, each, *given[2:])

    monkeypatch.setattr(module, "dealt", backwards)
    kept = []
    found = survey(fake, jobs=3, keep=kept.append, every=0.0)
    assert asked == [(("study.h5", ".", "shear", 0.005), 3)]
    assert kept[1].column("replicate").tolist() == [1, 2]
    assert same(found, survey(FakeResults()))


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


def test_the_file_comes_back(tmp_path):
    found, path = mixed(), tmp_path / "s.h5"
    write_strengths(path, found)
    back = read_strengths(path)
    assert back.about == found.about
    for group in ("doublets", "conditions"):
        one, other = getattr(found, group), getattr(back, group)
        for name, column in one.columns.items():
            np.testing.assert_array_equal(column.values, other.columns[name].values)
            assert column.values.dtype == other.columns[name].values.dtype
    assert back.conditions.axes["quantile"].values.tolist() == list(QUANTILES)


def test_a_file_says_whether_it_is_complete(tmp_path, capsys):
    write_strengths(tmp_path / "s.h5", mixed(complete=False))
    back = read_strengths(tmp_path / "s.h5")
    assert not back.complete and mixed().complete
    assert plot.read_content(tmp_path / "s.h5")[2] == "unfinished: 4 of 4 doublets"
    words = ["plot", str(tmp_path / "s.h5"), "--output-dir", str(tmp_path)]
    assert program.main(words) == 0
    assert (tmp_path / "s-strength.png").exists()


def test_a_damaged_or_strange_file_is_refused(tmp_path):
    path = tmp_path / "s.h5"
    write_strengths(path, mixed())
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    with pytest.raises(FileError):
        read_strengths(path)
    wrong = mixed()
    wrong.doublets.columns["type"].values[0] = 7
    write_strengths(tmp_path / "t.h5", wrong)
    with pytest.raises(FileError, match="no type of the file"):
        read_strengths(tmp_path / "t.h5")


def test_the_figure_shows_the_share_that_has_opened():
    figure = over_rate(mixed())
    lines = [line for axes in figure.axes for line in axes.get_lines() if len(line.get_xdata())]
    assert any(np.allclose(line.get_ydata(), [1 / 3, 2 / 3]) for line in lines)


def run(folder, *words):
    return program.main(["strength", str(folder / "study.h5"), *map(str, words)])


def test_the_command_writes_one_file_and_a_figure_and_replaces_none(
    fake, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.h5").write_bytes(b"never read here")
    assert run(tmp_path, "--quiet") == 0
    assert "III" in capsys.readouterr().out
    assert read_strengths("study-strength.h5").about["flow"] == "shear"
    assert plot.read_content("study-strength.h5")[1].keys() == {"strength"}
    before = (tmp_path / "study-strength.h5").read_bytes()
    fake.asked.clear()
    assert run(tmp_path, "--flow", "extension") == 2
    assert not fake.asked and "exists already" in capsys.readouterr().err
    assert (tmp_path / "study-strength.h5").read_bytes() == before
    assert run(tmp_path, "--flow", "extension", "--overwrite", "--quiet") == 0
    assert (tmp_path / "study-strength.1.h5").read_bytes() == before
    assert read_strengths("study-strength.h5").about["flow"] == "extension"
    assert run(tmp_path, "-o", "study.h5", "--overwrite") == 2
    assert "which is read" in capsys.readouterr().err


def test_a_command_that_is_stopped_before_any_is_tested_writes_nothing(
    fake, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.h5").write_bytes(b"never read here")

    def interrupted(*place):
        raise KeyboardInterrupt

    fake.replicate = interrupted
    assert run(tmp_path) == 130
    assert "nothing has been written" in "".join(capsys.readouterr())
    assert sorted(path.name for path in tmp_path.iterdir()) == ["study.h5"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_command_that_is_stopped_keeps_what_it_has_and_goes_on(
    fake, tmp_path, monkeypatch, capsys, number
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.h5").write_bytes(b"never read here")
    run_again = fake.replicate

    def third_stopped(*place):
        if len(fake.asked) == 2:
            signal.raise_signal(number)
        return run_again(*place)

    fake.replicate = third_stopped
    assert run(tmp_path) == 130
    told = capsys.readouterr().err
    assert f"stopped by {signal.Signals(number).name}: 2 of 5 doublets are in " in told
    assert "study-strength.h5; go on with --resume" in told
    part = read_strengths("study-strength.h5")
    assert part.table("n_tested").sum() == 2 and not part.complete
    assert sorted(path.name for path in tmp_path.iterdir()) == ["study-strength.h5", "study.h5"]
    fake.replicate = run_again
    # Without --resume it is in the way, and another flow does not go on with it.
    before = Path("study-strength.h5").read_bytes()
    assert run(tmp_path) == 2
    assert "go on with it by --resume" in capsys.readouterr().err
    assert run(tmp_path, "--resume", "--flow", "extension") == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert "cannot be gone on with: its flow is shear, not extension; name another" in told
    assert run(tmp_path, "--resume", "--overwrite") == 2
    assert Path("study-strength.h5").read_bytes() == before
    fake.asked.clear()
    assert run(tmp_path, "--resume") == 0
    assert len(fake.asked) == 3
    assert same(read_strengths("study-strength.h5"), survey(FakeResults()))
    names = ["study-strength.h5", "study-strength.png", "study.h5"]
    assert sorted(path.name for path in tmp_path.iterdir()) == names
    # A finished one has nothing left to test.
    fake.asked.clear()
    assert run(tmp_path, "--resume") == 0 and not fake.asked


def test_a_signal_waits_until_the_file_is_whole():
    stop, said = Stop(), []

    def write(found):
        signal.raise_signal(signal.SIGTERM)
        said.append(found)

    with stop.listening(), pytest.raises(KeyboardInterrupt):
        stop.unbroken(write)("all of it")
    assert said == ["all of it"] and stop.name == "SIGTERM"


def test_resume_begins_where_there_is_nothing(fake, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.h5").write_bytes(b"never read here")
    assert run(tmp_path, "--resume", "--quiet") == 0
    assert read_strengths("study-strength.h5").complete
    # A file of something else is no strengths, and stays.
    Path("other.h5").write_bytes(b"mine")
    assert run(tmp_path, "--resume", "-o", "other.h5") == 74
    assert Path("other.h5").read_bytes() == b"mine"
