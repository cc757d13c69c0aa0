"""`flocsim work-precision`: the table of one replicate."""

import pytest

from flocsim.__main__ import main
from flocsim.commands import work_precision
from flocsim.commands.check import HEADER
from flocsim.integrators import DormandPrince54, Implicit, VelocityVerlet
from tests.helpers.small_study import write_small


@pytest.fixture
def few(monkeypatch, tmp_path):
    """The small config, with few settings to run."""
    write_small(tmp_path)
    monkeypatch.chdir(tmp_path)
    # One method: each is compiled.
    settings = [Implicit(1e-8), Implicit(1e-10)]
    monkeypatch.setattr(work_precision, "methods", lambda duration: settings)


def rows_of(text):
    """{(method, setting): (error, verdict)} of the printed table."""
    table = text.split(HEADER)[1].strip().splitlines()
    words = [line.split() for line in table]
    return {(w[4], w[5]): (w[11], " ".join(w[13:])) for w in words}


@pytest.fixture
def table(few, capsys):
    """What the command prints."""
    command = "work-precision small.toml --type III --vertices 4 --replicate 2"
    assert main(command.split()) == 0
    return capsys.readouterr().out


def test_it_says_the_replicate_and_the_error_at_each_tolerance(table):
    assert table.startswith("type III, N = 4, delta = 0, replicate 2: A after ")
    assert float(rows_of(table)["Implicit", "1e-08"][0]) < 1e-7


def test_errors_fall_with_the_tolerance(table):
    assert float(rows_of(table)["Implicit", "1e-10"][0]) < 1e-9


def test_every_method_gets_its_settings():
    found = work_precision.methods(1e-3)
    assert {type(method) for method in found} == {Implicit, DormandPrince54, VelocityVerlet}
    tolerances = [method.tolerance for method in found if isinstance(method, Implicit)]
    assert max(tolerances) / min(tolerances) >= 1e5


def test_a_method_that_fails_shows_no_error(few, monkeypatch, capsys):
    monkeypatch.setattr(work_precision, "MOST_STEPS", 2)
    assert main(["work-precision", "small.toml", "--replicate", "0"]) == 0
    found = rows_of(capsys.readouterr().out)
    assert set(found.values()) == {("-", "failed: undecided (step budget)")}


def test_an_unknown_type_is_one_line(few, capsys):
    assert main(["work-precision", "small.toml", "--type", "IV"]) == 2
    assert capsys.readouterr().err == "flocsim: --type must be one of I, III, found IV\n"
