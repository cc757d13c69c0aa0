"""`flocsim work-precision`: the table of one replicate."""

import pytest

from flocsim.__main__ import main
from flocsim.commands import work_precision
from flocsim.integrators import DormandPrince54, Implicit, VelocityVerlet
from tests.helpers.small_study import write_small


@pytest.fixture
def few(monkeypatch, tmp_path):
    """The small config, with few settings to run."""
    write_small(tmp_path)
    monkeypatch.chdir(tmp_path)
    # One method: each is compiled.
    settings = [("Implicit", f"{t:.0e} m", Implicit(t)) for t in (1e-8, 1e-10)]
    monkeypatch.setattr(work_precision, "methods", lambda duration: settings)


def rows_of(text):
    """{(method, setting): (error, end)} of the printed table."""
    table = text.split(work_precision.HEADER)[1].strip().splitlines()
    words = [line.split() for line in table]
    return {(w[0], w[1]): (w[3], " ".join(w[6:])) for w in words}


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
    found = list(work_precision.methods(1e-3))
    assert {type(method) for _, _, method in found} == {Implicit, DormandPrince54, VelocityVerlet}
    assert all(name == type(method).__name__ for name, _, method in found)
    tolerances = [method.tolerance for _, _, method in found if isinstance(method, Implicit)]
    assert max(tolerances) / min(tolerances) >= 1e5


def test_a_method_that_fails_shows_no_error(few, monkeypatch):
    from flocsim.ensembles.config.loader import load_config

    system, duration, _ = work_precision.replicate(load_config("small.toml"), (0, 4, 0.0), 0)
    monkeypatch.setattr(work_precision, "MOST_STEPS", 2)
    exact = system.run(1e-9, record=False).position[-1]
    line = work_precision.row(system, duration, exact, "Implicit", "1e-09 m", Implicit(1e-9))
    words = line.split()
    assert words[3] == "-" and words[6:] == ["step", "budget"]


def test_a_replicate_starts_where_the_ensemble_starts_it(few):
    from flocsim.ensembles.config.loader import load_config

    config = load_config("small.toml")
    system, duration, row = work_precision.replicate(config, (0, 4, 0.0), 1)
    assert system.bodies[0].angle == row["angle_i"]
    assert duration == row["t_end"]
    end = system.run(duration, record=False)
    gap = end.position[-1, 1, :2] - end.position[-1, 0, :2]
    # The same motion in other steps, as one knows when it ends: as far apart as both may err.
    distance = (gap @ gap) ** 0.5
    assert abs(distance - row["d_c_last"]) < row["error"] + end.error
    assert distance == pytest.approx(row["d_c_last"], rel=1e-2)


def test_an_unknown_type_is_one_line(few, capsys):
    assert main(["work-precision", "small.toml", "--type", "IV"]) == 2
    assert capsys.readouterr().err == "flocsim: --type must be one of I, III, found IV\n"
