"""`flocsim work-precision` of a whole study: flips, errors of d_c and CPU time at every rung; and
the picture: every rung has its place, what never flipped has one, too."""

import numpy as np
import pytest

from flocsim.__main__ import main
from flocsim.commands import work_precision
from flocsim.commands.work_precision import COLOURS, Rung, draw_ladders
from flocsim.ensembles.pilot.trials import Job, Task, sample_of
from flocsim.ensembles.study import Study
from flocsim.integrators import Implicit
from tests.helpers.small_study import small_config, small_study, write_small


@pytest.fixture
def implicit_alone(monkeypatch, tmp_path):
    """The small config; only the method that is compiled already, at two rungs."""
    write_small(tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(work_precision, "DormandPrince54", Implicit)
    monkeypatch.setattr(work_precision, "DECADES", (1.0, 1e-2))
    return tmp_path


def test_the_table_and_the_picture(implicit_alone, capsys):
    words = "work-precision small.toml --vertices 4 --count 6 -o a.png"
    assert main(words.split()) == 0
    text = capsys.readouterr().out
    assert "type I, 6 replicates" in text and "type III, 6 replicates" in text
    rows = [line.split() for line in text.splitlines() if line.startswith("Implicit")]
    assert len(rows) == 8
    for loose, tight in zip(rows[::2], rows[1::2], strict=True):
        assert (loose[1], tight[1]) == ("1e-06", "1e-08")
        errors = [float(row[row.index("m") + 5]) for row in (loose, tight)]
        assert errors[1] < errors[0] < 1e-4
    assert "with 3 replicates the sampling error is 37 %" in text
    assert "I: Implicit, tolerance = " in text or "I: none of these" in text
    assert (implicit_alone / "a.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--count 0", "--count must be at least 1, found 0"),
        ("--replicate 1 --count 3", "--count is for the whole study"),
        ("--replicate 1 -o a.png", "--output is for the whole study"),
        ("-o a.gif", "a.gif: a figure's name must end in one of .png, .pdf, .svg"),
        ("--delta 0.3", "--delta must be one of 0.0, 1.0, found 0.3"),
    ],
)
def test_what_is_wrong_is_one_line(implicit_alone, capsys, words, said):
    assert main(["work-precision", "small.toml", *words.split()]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert said in line


def test_what_is_measured_ends_as_in_the_study(tmp_path):
    study = small_study(tmp_path)
    row = study.run(1, 4, 0.0, 1)
    task = Task(1, 4, 0.0, 1)
    job = Job(task, study.config.integrator.method, study.config.integrator.max_steps)
    trial, end = work_precision.measured(study, job)
    assert (trial.outcome, trial.inside, trial.time) == (
        row["outcome"], row["inside"], row["t_end"],
    )  # fmt: skip
    assert end.distance == pytest.approx(row["d_c_last"], rel=1e-9)
    # On the way, as exactly: of the same run as a reference, that took other steps.
    exact = end._replace(job=job._replace(integrator=Implicit(1e-12)))
    for instant in (0.3 * end.time, 0.7 * end.time):
        found = [work_precision.distance_at(study, each, instant) for each in (end, exact)]
        assert found[0] == pytest.approx(found[1], abs=1e-8) and found[0] > end.distance


def test_a_sample_of_any_size(tmp_path):
    config = small_config(tmp_path, {"shapes": {"vertices": [1]}})
    assert [len(tasks) for tasks in sample_of(config, 4)] == [4, 4]
    # Three replicates at two displacements are all there are.
    assert [len(set(tasks)) for tasks in sample_of(config, 100)] == [6, 6]
    assert Study(config).size == 12


def rung(method, tolerance, flips, cpu):
    return Rung(method, tolerance, 50, flips, 0.0, 0.1, tolerance, 10 * tolerance, cpu, 0)


PANELS = {
    "I": [rung("Implicit", 1e-6, 5, 1.0), rung("Implicit", 1e-7, 0, 2.0),
          rung("DormandPrince54", 1e-6, 4, 4.0), rung("DormandPrince54", 1e-7, 1, 3.0)],
    "III": [rung("Implicit", 1e-6, 0, 1.0), rung("Implicit", 1e-7, 0, 2.0)],
}  # fmt: skip


def lines_of(axes):
    """{label: (x, y)} of the lines of an axes."""
    found = {each.get_label(): each[0] for each in axes.containers}
    return {name: np.array(found[name].get_data(), float) for name in COLOURS}


def test_what_flips_is_drawn_where_it_was_measured():
    figure = draw_ladders(PANELS, {"I": ("Implicit", 1e-7)}, 0.01)
    axes = figure.axes
    assert [each.get_title(loc="left") for each in axes[:2]] == ["(a) Type I", "(b) Type III"]
    lines = lines_of(axes[0])
    np.testing.assert_allclose(lines["Implicit"], [[1.0], [10.0]])
    np.testing.assert_allclose(lines["DormandPrince54"], [[4.0, 3.0], [8.0, 2.0]])
    assert all(each.get_xscale() == each.get_yscale() == "log" for each in axes)


def test_what_is_recommended_has_a_ring_in_both_panels():
    figure = draw_ladders(PANELS, {"I": ("Implicit", 1e-7), "III": ("Implicit", 3e-7)}, 0.01)
    rings = [sum(line.get_markersize() == 11 for line in each.lines) for each in figure.axes]
    assert rings == [1, 0, 1, 0]
