"""The study's scripts write into their folder without destroying what lies there."""

import csv
from pathlib import Path

import pytest

from flocsim.io.plots.collision import draw_distance
from tests.helpers.paper_like import paper_fits, paper_results, relabelled

FOLDER = Path(__file__).parents[2] / "examples" / "tang2014"


def test_pages_and_figures_that_differ_are_kept(example, tmp_path):
    output = example("output")
    for number in (0, 0, 1):
        output.write_page(tmp_path / "summary.md", f"{number}\n")
    (tmp_path / "figure-4.png").write_bytes(b"a photograph")
    output.save_all(draw_distance([0.0, 1.0], [1e-5, 2e-5]), tmp_path / "figure-4")
    assert (tmp_path / "summary.1.md").read_text() == "0\n"
    assert (tmp_path / "figure-4.1.png").read_bytes() == b"a photograph"
    assert len(list(tmp_path.iterdir())) == 5


def test_tables_are_kept_where_they_differ(example, tmp_path):
    output, path = example("output"), tmp_path / "table.csv"
    for rows in ([["a", "b"], [1, 2]], [["a", "b"], [1, 2]], [["a", "b"], [1, 3]]):
        output.write_table(path, rows)
    with path.open() as file:
        assert list(csv.reader(file)) == [["a", "b"], ["1", "3"]]
    assert (tmp_path / "table.1.csv").read_text() == "a,b\n1,2\n"
    assert len(list(tmp_path.iterdir())) == 2


def test_a_table_of_something_else_is_not_added_to(example, tmp_path, capsys):
    steps, path = example("steps"), tmp_path / "steps.csv"
    steps.check(path)
    steps.note(path, "fits", 1.0, "flocsim fit")
    steps.check(path)
    path.write_text("stairs,height\n")
    with pytest.raises(SystemExit) as caught:
        steps.check(path)
    assert caught.value.code == 2 and "is no table of steps" in capsys.readouterr().err


def test_the_outlines_of_flocs_that_contradict_are_drawn(example):
    """One pair of Type III collides outside; its two flocs are shown, and no other."""

    def outside(outcome, inside):
        outcome[2, 1, 4, 7], inside[2, 1, 4, 7] = 3, 0

    exceptions = example("exceptions")
    entries = paper_fits(radii=(1.0,))
    names = tuple(entry.floc_id.partition(" r=")[0] for entry in entries)
    clean = relabelled(paper_results(), flocs=names)
    assert exceptions.exceptions_figure(clean, entries) is None
    study = relabelled(paper_results(outside), flocs=names)
    study.replicates["floc_i"][2, 1, 4, 7], study.replicates["floc_j"][2, 1, 4, 7] = 3, 5
    figure = exceptions.exceptions_figure(study, entries)
    titles = {axes.get_title() for axes in figure.axes}
    assert titles == {f"{names[k]}\nin 1 of 1 pairs" for k in (3, 5)}
