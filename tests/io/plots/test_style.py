"""Figures are saved whole, equal and undated, whatever the user's settings."""

import copy
import io
import os
import re
import subprocess
import sys
import warnings
from pathlib import Path

import attrs
import numpy as np
import pytest

from flocsim.errors import FileError, UsageError
from flocsim.geometry.shapes.spheropolygon import SpheroPolygon
from flocsim.io.labelled import Column
from flocsim.io.plots.collision import draw_distance, draw_energies, draw_forces
from flocsim.io.plots.curves import against_key, over_time
from flocsim.io.plots.results import figure_4
from flocsim.io.plots.style import keep_titles_whole, new_figure, plain, save, set_log_axis
from flocsim.io.results.sweep_file import SweepResults, Swept
from flocsim.io.trajectory import StoredTrajectory
from flocsim.trajectories.figures import drawn
from tests.helpers.results_files import write_results
from tests.helpers.swarm_study import make_swarm_results
from tests.helpers.synthetic_results import make_results
from tests.helpers.tiers import rest_slow

ODD = "$\\frac{\x1b[31m\n" + "W" * 5000 + "$"
"""What a file may have in the place of a word."""


@pytest.mark.parametrize(
    ("suffix", "start"),
    rest_slow(
        [("png", b"\x89PNG"), ("pdf", b"%PDF"), ("SVG", b"<?xml")],
        lambda suffix, start: suffix != "pdf",
    ),
)
def test_saved_pictures_are_whole_equal_and_undated(tmp_path, suffix, start):
    paths = [tmp_path / f"{name}.{suffix}" for name in ("one", "two")]
    for path in paths:
        save(figure_4(make_results(types=("I",), count=4)), path)
    content = paths[0].read_bytes()
    assert content.startswith(start)
    assert content == paths[1].read_bytes()
    assert not re.search(rb"CreationDate|<dc:date>|tIME", content)


@pytest.mark.parametrize("name", ["figure", "figure.jpg", "figure.png.txt"])
def test_other_suffixes_are_refused(tmp_path, name):
    with pytest.raises(UsageError, match=r"must end in \.png or \.pdf or \.svg"):
        save(draw_distance([0.0, 1.0], [1e-5, 2e-5]), tmp_path / name)


def test_an_unwritable_figure_is_told(tmp_path):
    with pytest.raises(FileError, match="absent"):
        save(draw_distance([0.0, 1.0], [1e-5, 2e-5]), tmp_path / "absent" / "figure.png")


def test_a_notebooks_backend_that_is_not_installed_is_no_obstacle(tmp_path):
    """A command in a notebook's shell inherits the backend of the notebook."""
    write_results(tmp_path / "r.h5", make_results(types=("I",), vertices=(1,), count=4))
    env = os.environ | {"MPLBACKEND": "no_such_backend"}
    command = [sys.executable, "-m", "flocsim", "plot", "r.h5", "--figures", "size"]
    done = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "r-size.png\n"), done.stderr


def test_a_figure_shows_itself_in_a_notebook():
    figure = draw_distance([0.0, 1.0], [1e-5, 2e-5])
    assert figure._repr_png_().startswith(b"\x89PNG")
    assert copy.deepcopy(figure).axes, "it can be copied"


def test_the_users_matplotlibrc_changes_nothing():
    import matplotlib

    def picture():
        buffer = io.BytesIO()
        figure = figure_4(make_results(types=("I",), count=4))
        figure.savefig(buffer, dpi=50)
        return buffer.getvalue()

    usual = picture()
    with matplotlib.rc_context({"font.size": 30, "lines.linewidth": 9, "axes.facecolor": "red"}):
        assert picture() == usual


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        (0.4, 12.0, ["0.5", "1", "2", "5", "10"]),
        (1e3, 2e6, ["1000", "10000", "100000", r"$10^{6}$"]),
        (5e-5, 3e-4, [r"$5\times10^{-5}$", r"$10^{-4}$", r"$2\times10^{-4}$"]),
        (6e4, 1.3e5, ["60000", "80000", "100000", "120000"]),
    ],
)
def test_a_logarithmic_axis_has_round_numbers_that_fit(low, high, words):
    axes = new_figure(3.0, 2.0).subplots()
    axes.set(xscale="log", xlim=(low, high))
    set_log_axis(axes.xaxis)
    at = axes.xaxis.get_majorticklocs()
    labels = axes.xaxis.get_major_formatter().format_ticks(at)
    shown = [word for place, word in zip(at, labels, strict=True) if low <= place <= high]
    assert shown == words


def test_of_a_long_text_the_middle_is_left_out_and_no_letter_has_a_meaning():
    assert plain("5 $ or 6 $") == r"5 \$ or 6 \$"
    assert plain("a\nb\x1b") == r"a\nb\x1b"
    assert plain("x" * 40) == "x" * 40
    assert plain("first" + "x" * 90 + "last", 10) == "firs…xlast"


def swept_over(results, group, swept):
    """The SweepResults of equal results at each value of a key."""
    found, count = results.labelled(group), len(swept.values)
    columns = {
        name: Column(("key", *each.axes), np.stack([each.values] * count), each.about)
        for name, each in found.columns.items()
    }
    axes = {"key": swept.column("key"), **found.axes}
    joined = attrs.evolve(found, axes=axes, columns=columns)
    return SweepResults(Path("s.h5"), {"key": swept}, {group: joined})


def pairs_over(swept):
    return against_key(swept_over(make_results(types=("I",), count=4), "probabilities", swept))


def motion_of(figure):
    """A figure of a trajectory file that says ODD of how it ended."""
    square = SpheroPolygon(1e-6 * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]), 1e-7)
    position = np.array([[[0.0, 0.0, 0.0], [5e-6 - k * 1e-6, 0.0, 0.0]] for k in range(3)])
    found = StoredTrajectory(
        np.arange(3.0), position, np.zeros_like(position), (square, square), {"status": ODD}
    )
    return drawn(found, figure, 3)


ODD_FIGURES = {
    "type": lambda: figure_4(make_results(types=(ODD,), count=4)),
    "key": lambda: pairs_over(Swept(ODD, [1.0, 2.0], "V")),
    "unit": lambda: pairs_over(Swept("a.b", [1.0, 2.0], ODD)),
    "values": lambda: pairs_over(Swept("a.b", [ODD, "1"])),
    "key of swarms": lambda: over_time(
        swept_over(make_swarm_results(), "counts", Swept(ODD, [1.0, 2.0], ODD))
    ),
    "values of swarms": lambda: over_time(
        swept_over(make_swarm_results(), "counts", Swept("a.b", [ODD, "1"]))
    ),
    "strip": lambda: motion_of("strip"),
    "distance": lambda: motion_of("distance"),
    "forces": lambda: draw_forces([0.0, 1.0], {ODD: [1e-9, 2e-9]}),
    "energies": lambda: draw_energies([0.0, 1.0], {ODD: [0.0, 1e-15]}, [0.0, 1e-15]),
}


@pytest.mark.parametrize("name", ODD_FIGURES)
def test_words_of_a_file_are_drawn_whatever_they_are_and_leave_the_panels_room(name):
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # matplotlib says so where there is no room, or no letter
        figure = ODD_FIGURES[name]()
        figure.canvas.draw()
        keep_titles_whole(figure)
    for axes in figure.axes:
        assert not axes.get_visible() or axes.get_window_extent().height > 60.0
