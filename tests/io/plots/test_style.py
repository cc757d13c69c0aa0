"""Figures are saved whole, equal and undated, whatever the user's settings."""

import io
import re

import pytest

from flocsim.errors import FileError, UsageError
from flocsim.io.plots.collision import (
    draw_distance,
)
from flocsim.io.plots.results import figure_4
from flocsim.io.plots.style import save
from tests.helpers.synthetic_results import make_results


@pytest.mark.parametrize(
    ("suffix", "start"), [("png", b"\x89PNG"), ("pdf", b"%PDF"), ("SVG", b"<?xml")]
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
