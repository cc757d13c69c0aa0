"""All bound doublets of a file: which are tested, their distribution, the file, and the command."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from flocsim import __main__ as program
from flocsim.commands import plot
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
    path = "study.h5"

    def __init__(self):
        outcome = np.full((2, 2, 2, 3), 4)
        outcome[0, 0, 0] = (0, 1, 2)
        outcome[1, 1, 1] = (0, 0, 0)
        self.replicates = {"outcome": outcome, "bond": np.where(outcome < 4, 1 + outcome % 3, 255)}
        self.asked = []

    def replicate(self, *place):
        self.asked.append(place)
        return place


@pytest.fixture
def fake(monkeypatch):
    """Doublets that open at 100/s times one more than their replicate."""

    def doublet(start, flow):
        rate = 100.0 * (1 + start[0])
        return SimpleNamespace(opening=lambda precision: Opening(0.99 * rate, rate, OPENED, 20))

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
     ({"precision": 0.0}, "precision must lie between")],
)  # fmt: skip
def test_bad_input_is_refused(fake, given, words):
    with pytest.raises(UsageError, match=words):
        survey(fake, **given)
    fake.replicates["outcome"][:] = 4
    with pytest.raises(UsageError, match="holds no bound doublet"):
        survey(fake)


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


def test_a_command_that_is_stopped_writes_nothing(fake, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.h5").write_bytes(b"never read here")

    def interrupted(*place):
        raise KeyboardInterrupt

    fake.replicate = interrupted
    assert run(tmp_path) == 130
    assert "nothing has been written" in "".join(capsys.readouterr())
    assert sorted(path.name for path in tmp_path.iterdir()) == ["study.h5"]
