"""A collision as strip, curves of distance and forces, and animation."""

import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from flocsim.io.plots.collision import (
    Frames,
    draw_distance,
    draw_energies,
    draw_forces,
    draw_strip,
    rounded_length,
    time_unit,
    write_animation,
)

SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * 1e-5


def test_a_strip_shows_bodies_contacts_and_distances():
    frames = [[[SQUARE], [SQUARE + [0.0, shift]]] for shift in (4e-5, 2e-5, 2.05e-5)]
    path = np.array([[0.0, 4e-5], [0.0, 2e-5]])
    apart, contacts = [4e-5, 2e-5, 2.05e-5], [[], [[0.0, 1e-5]], []]
    shown = Frames([0.0, 0.012, 0.02], frames, contacts, [np.zeros((2, 2)), path], apart)
    figure = draw_strip(shown, "Trajectory A", 3e-5)
    assert [len(axes.patches) for axes in figure.axes] == [2, 2, 2]
    assert [axes.get_title() for axes in figure.axes] == ["0 ms", "12 ms", "20 ms"]
    labels = [axes.get_xlabel() for axes in figure.axes]
    assert "40.0 µm" in labels[0] and "geq" in labels[0]
    assert "20.0 µm" in labels[1] and "<" in labels[1]
    assert "µm" in " ".join(text.get_text() for text in figure.axes[0].texts)
    rings = [line.get_xydata() for line in figure.axes[1].lines if line.get_marker() == "o"]
    np.testing.assert_array_equal(rings, [[[0.0, 1e-5]]])


def test_frames_share_one_scale_and_hold_their_bodies():
    frames = [[[SQUARE], [SQUARE + [3e-5 * k, -1e-3 * k]]] for k in (1.0, 0.01)]
    figure = draw_strip(Frames([0.0, 1.0], frames, [()] * 2, [], [0.0] * 2))
    spans = [(*np.diff(axes.get_xlim()), *np.diff(axes.get_ylim())) for axes in figure.axes]
    np.testing.assert_allclose(spans, spans[0][0])
    for axes, frame in zip(figure.axes, frames, strict=True):
        points = np.concatenate([polygon for body in frame for polygon in body])
        for column, limits in enumerate((axes.get_xlim(), axes.get_ylim())):
            assert limits[0] < points[:, column].min() < points[:, column].max() < limits[1]


@pytest.mark.parametrize("zone", [1e-6, 1.5e-5, 9e-5])
def test_distance_always_shows_the_zone(zone):
    axes = draw_distance([0.0, 1.0], [1e-5, 2e-5], zone).axes[0]
    low, high = axes.get_ylim()
    assert low < zone * 1e6 < high
    assert low < 10.0 and high > 20.0


@pytest.mark.parametrize(("length", "bar"), [(1e-5, 1e-5), (4.9e-5, 2e-5), (7e-6, 5e-6)])
def test_scale_bars_are_round(length, bar):
    assert rounded_length(length) == pytest.approx(bar)


@pytest.mark.parametrize(
    ("times", "unit"), [([0.0], "s"), ([0, 2.0], "s"), ([0, 0.5], "ms"), ([2e-5], "µs")]
)
def test_time_unit_fits_the_longest_time(times, unit):
    assert time_unit(times)[0] == unit


def test_plotting_loads_no_window_system():
    code = "import flocsim.io.plots.collision as p, sys; print('matplotlib' in sys.modules); "
    code += "p.draw_distance([0, 1], [1e-5, 1e-5]); print('matplotlib.pyplot' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "False"]


def test_what_pushes_is_solid_and_what_pulls_is_dashed():
    times = np.linspace(0.0, 1e-3, 4)
    forces = {"push": np.full(4, 1e-9), "pull": np.full(4, -2e-9)}
    axes = draw_forces(times, forces, 5e-4).axes[0]
    drawn = [np.nan_to_num(line.get_ydata()).max() for line in axes.get_lines()[:4]]
    assert drawn == pytest.approx([1.0, 0.0, 0.0, 2.0])
    assert axes.get_yscale() == "log"


def test_energies_are_drawn_one_by_one():
    times, work = np.linspace(0.0, 1e-3, 4), {"Gravity": np.full(4, 3e-15)}
    axes = draw_energies(times, work, np.full(4, 1e-17)).axes[0]
    assert [line.get_label() for line in axes.get_lines()[:2]] == [
        "work of Gravity", "kinetic energy",
    ]  # fmt: skip
    assert [line.get_ydata()[0] for line in axes.get_lines()[:2]] == pytest.approx([3.0, 1e-2])
    assert axes.get_yscale() == "symlog"
    assert draw_energies([0.0, 1.0], {}, np.zeros(2)).axes[0].get_yscale() == "linear"


SMALL_SQUARE = 1e-6 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def falling(count):
    """Frames of ``count`` instants."""
    heights = np.linspace(6e-6, 2e-6, count)
    outlines = [[[SMALL_SQUARE], [SMALL_SQUARE + [0.0, height]]] for height in heights]
    paths = (np.zeros((count, 2)), np.column_stack([np.zeros(count), heights]))
    return Frames(np.linspace(0.0, 1e-3, count), outlines, [()] * count, paths, heights)


def written(path, count):
    """The GIF of so many frames."""
    frames = falling(count)
    write_animation(path, frames, (frames.times, frames.centre_distance), 3e-6, "falls")
    return path


def test_all_frames_of_an_animation_are_there_and_differ(tmp_path):
    with Image.open(written(tmp_path / "a.gif", 4)) as animation:
        assert (animation.n_frames, animation.info["loop"]) == (4, 0)
        pictures = []
        for place in range(4):
            animation.seek(place)
            pictures.append(animation.convert("RGB").tobytes())
    assert len(set(pictures)) == 4


def test_a_strip_names_bodies_lines_and_contacts():
    frames = [[[SQUARE], [SQUARE + 3e-6]]] * 4
    touching = [np.array([[1e-6, 0.0], [2e-6, 0.0]])] * 4
    paths = [np.zeros((2, 2)), np.ones((2, 2)) * 1e-6]
    figure = draw_strip(Frames([0.0, 1.0, 2.0, 3.0], frames, touching, paths, [0.0] * 4))
    [legend] = figure.legends
    words = [text.get_text() for text in legend.get_texts()]
    assert words[:2] == ["body i", "body j"] and words[-1] == "contact"
    assert words[2] == "path of the centre seen from i"
    assert [text.get_text() for text in figure.axes[0].texts[-2:]] == ["i", "j"]
    rings = [line for line in figure.axes[2].lines if line.get_marker() == "o"]
    assert [len(ring.get_xdata()) for ring in rings] == [2]
