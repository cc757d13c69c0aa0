"""`flocsim work-precision`: error, flips and CPU time of every setting."""

from pathlib import Path

import pytest

from flocsim.__main__ import main
from flocsim.commands import work_precision
from flocsim.integrators import Implicit
from tests.helpers.small_study import write_small

WORDS = ["work-precision", "small.toml", "--set", "shapes.vertices=[4]"]


@pytest.fixture
def implicit_alone(in_tmp, monkeypatch):
    """The small config; only the method that is compiled already, at two rungs."""
    write_small(in_tmp)
    monkeypatch.setattr(work_precision, "DormandPrince54", Implicit)
    monkeypatch.setattr(work_precision, "DECADES", 2)


def rows_of(text):
    """[{title: word}] of the printed rows; the unit of a tolerance is a word by itself."""
    titles = ["method", "setting", "m", "flips", "%", "low", "high", "error", "most"]
    lines = [line.split() for line in text.splitlines() if line.startswith("Implicit")]
    return [dict(zip(titles, words, strict=False)) for words in lines]


def test_a_row_for_every_type_and_setting(implicit_alone, capsys):
    assert main([*WORDS, "--count", "6"]) == 0
    text = capsys.readouterr().out
    assert "type I, 6 replicates" in text and "type III, 6 replicates" in text
    rows = rows_of(text)
    assert len(rows) == 8
    for loose, tight in zip(rows[::2], rows[1::2], strict=True):
        assert (loose["setting"], tight["setting"]) == ("1e-06", "1e-07")
        assert 0.0 < float(tight["most"]) < 1e-4 and 0.0 < float(loose["most"]) < 1e-4
    assert "the sampling error of the study, 37 %" in text


def test_the_figure_is_written_once(implicit_alone, capsys):
    words = [*WORDS, "--count", "2", "-o", "error.png"]
    assert main(words) == 0
    assert Path("error.png").read_bytes().startswith(b"\x89PNG")
    assert capsys.readouterr().out.endswith("error.png\n")
    assert main(words) == 2
    assert "error.png" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--set seed=x", "seed must be an integer"),
        ("--set bodies.surface_density=20", "an impact at"),
        ("-o error.gif", "error.gif: its name must end in .png"),
    ],
)
def test_what_is_wrong_is_one_line(implicit_alone, capsys, words, said):
    assert main(["work-precision", "small.toml", *words.split()]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert said in line
