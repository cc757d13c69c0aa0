"""Figures are saved whole, equal and undated, whatever the user's settings."""

import io
import re

import pytest

from flocsim.errors import FileError, UsageError
from flocsim.io.plots.collision import draw_distance
from flocsim.io.plots.results import figure_4
from flocsim.io.plots.style import new_figure, save, set_log_axis
from tests.helpers.synthetic_results import make_results
from tests.helpers.tiers import rest_slow


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
    with pytest.raises(UsageError, match=r"\.png, \.pdf, \.svg"):
        save(draw_distance([0.0, 1.0], [1e-5, 2e-5]), tmp_path / name)


def test_an_unwritable_figure_is_told(tmp_path):
    with pytest.raises(FileError, match="absent"):
        save(draw_distance([0.0, 1.0], [1e-5, 2e-5]), tmp_path / "absent" / "figure.png")


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
