"""Figures show the numbers of the results, say where there are none, and are saved whole."""

import io
import re
import subprocess
import sys
import warnings

import attrs
import numpy as np
import pytest

from flocsim.ensembles.estimates.statistics import tabulate, wilson
from flocsim.errors import FileError, UsageError
from flocsim.io.plots.collision import draw_distance, draw_strip, rounded_length, time_unit
from flocsim.io.plots.results import FIGURES, figure_4, figure_6, figure_8
from flocsim.io.plots.shapes import POPULATION_FIGURES, figure_2, figure_3
from flocsim.io.plots.style import save
from flocsim.io.shapes.library import ShapeEntry, StoredFit
from tests.helpers.synthetic_results import make_results

SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * 1e-5


def texts(axes):
    """All that is written inside a panel."""
    return " ".join(text.get_text() for text in axes.texts)


def bars(axes):
    """(value, low, high) of every line with interval bars in a panel, as lists."""
    found = []
    for container in axes.containers:
        segments = np.array(container.lines[2][0].get_segments())
        found.append((container.lines[0].get_ydata(), segments[:, 0, 1], segments[:, 1, 1]))
    return found


def with_outcomes(results, outcome, inside):
    """The same conditions with one outcome everywhere."""
    shape = results.replicates["outcome"].shape
    codes = {"outcome": np.full(shape, outcome, "u1"), "inside": np.full(shape, inside, "u1")}
    table = tabulate(**codes)
    return attrs.evolve(results, probabilities=table, replicates=results.replicates | codes)


def test_figure_4_shows_every_probability_and_interval():
    results = make_results()
    panels = figure_4(results).axes
    assert [axes.get_title("left") for axes in panels] == [
        "(a) Type I",
        "(b) Type II",
        "(c) Type III",
    ]
    for number, axes in enumerate(panels):
        lines = bars(axes)
        assert len(lines) == 5
        for index, line in enumerate(lines):
            for end, drawn in zip(("", "_low", "_high"), line, strict=True):
                expected = results.probabilities["pr_inside" + end][number, :, index]
                np.testing.assert_allclose(drawn, expected, atol=1e-12)


def test_figure_8_pools_the_counts_of_all_displacements():
    results = make_results()
    counts = results.probabilities["n_class"].sum(axis=2)
    for number, axes in enumerate(figure_8(results).axes):
        for index, (value, low, high) in enumerate(bars(axes)):
            successes, trials = counts[number, :, index], counts[number].sum(axis=-1)
            np.testing.assert_allclose(value, successes / trials)
            assert (low <= value).all() and (value <= high).all()


def test_replicates_that_agree_at_all_displacements_count_once():
    results = make_results()
    outcome = results.replicates["outcome"].copy()
    outcome[:] = np.arange(outcome.shape[-1]) % 4
    inside = np.where(outcome < 2, 1, 0)
    same = attrs.evolve(
        results, probabilities=tabulate(outcome, inside),
        replicates=results.replicates | {"outcome": outcome, "inside": inside.astype("u1")},
    )  # fmt: skip
    count = outcome.shape[-1]
    for index, (_, low, high) in enumerate(bars(figure_8(same).axes[0])):
        once = wilson(np.sum(np.arange(count) % 4 == index), count)
        np.testing.assert_allclose((low[0], high[0]), once, rtol=0.02)


def test_order_of_vertex_counts_does_not_matter():
    results = make_results(vertices=(1, 4, 16))
    turned = {name: array[:, ::-1] for name, array in results.probabilities.items()}
    rows = {name: array[:, ::-1] for name, array in results.replicates.items()}
    backwards = attrs.evolve(
        results, vertices=results.vertices[::-1], probabilities=turned, replicates=rows
    )
    for one, other in zip(figure_8(results).axes, figure_8(backwards).axes, strict=True):
        for a, b in zip(one.containers, other.containers, strict=True):
            np.testing.assert_array_equal(a.lines[0].get_xydata(), b.lines[0].get_xydata())


def test_a_panel_without_events_says_so():
    panels = figure_6(make_results()).axes
    assert "outside the zone" in texts(panels[2])
    assert texts(panels[0]) == ""


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", FIGURES)
def test_nothing_but_misses_gives_figures_that_say_so(name, tmp_path):
    figure = FIGURES[name](with_outcomes(make_results(), 4, 255))
    assert all("no " in texts(axes) for axes in figure.axes)
    save(figure, tmp_path / "empty.png")


def test_the_sphere_is_called_sphere():
    labels = [text.get_text() for text in figure_4(make_results()).axes[0].get_xticklabels()]
    assert labels == ["sphere", "4", "16", "64"]


def test_many_vertex_counts_are_thinned_but_keep_both_ends():
    results = make_results(vertices=(1, *range(4, 65, 4)), count=4)
    labels = [text.get_text() for text in figure_4(results).axes[0].get_xticklabels()]
    assert (labels[0], labels[-1]) == ("sphere", "64")
    assert sum(map(bool, labels)) <= 9


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", FIGURES)
@pytest.mark.parametrize(
    "conditions",
    [
        {"types": ("I",), "vertices": (1,), "delta": (0.0,)},
        {"types": ("16.4/23 µm", "a$\\b$", "II", "III"), "vertices": (4, 5, 7)},
        {"delta": tuple(np.linspace(0.0, 1.0, 12)), "types": ("I", "II")},
    ],
)
def test_any_number_of_conditions_can_be_drawn(name, conditions, tmp_path):
    results = make_results(**conditions, count=5)
    figure = FIGURES[name](results)
    save(figure, tmp_path / "figure.svg")
    assert len([axes for axes in figure.axes if axes.get_visible()]) in (
        len(results.types),
        3 * len(results.types),
    )


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


def test_a_strip_shows_bodies_contacts_and_distances():
    frames = [[[SQUARE], [SQUARE + [0.0, shift]]] for shift in (4e-5, 2e-5, 2.05e-5)]
    path = np.array([[0.0, 4e-5], [0.0, 2e-5]])
    figure = draw_strip(
        frames,
        [0.0, 0.012, 0.02],
        [np.zeros((2, 2)), path],
        "Trajectory A",
        centre_distance=[4e-5, 2e-5, 2.05e-5],
        zone_distance=3e-5,
        contacts=[[], [[0.0, 1e-5]], []],
    )
    assert [len(axes.patches) for axes in figure.axes] == [2, 2, 2]
    assert [axes.get_title() for axes in figure.axes] == ["0 ms", "12 ms", "20 ms"]
    labels = [axes.get_xlabel() for axes in figure.axes]
    assert "40.0 µm" in labels[0] and "geq" in labels[0]
    assert "20.0 µm" in labels[1] and "<" in labels[1]
    assert "µm" in texts(figure.axes[0])
    rings = [line.get_xydata() for line in figure.axes[1].lines if line.get_marker() == "o"]
    np.testing.assert_array_equal(rings, [[[0.0, 1e-5]]])


def test_frames_share_one_scale_and_hold_their_bodies():
    frames = [[[SQUARE], [SQUARE + [3e-5 * k, -1e-3 * k]]] for k in (1.0, 0.01)]
    figure = draw_strip(frames, [0.0, 1.0], [])
    spans = [(*np.diff(axes.get_xlim()), *np.diff(axes.get_ylim())) for axes in figure.axes]
    np.testing.assert_allclose(spans, spans[0][0])
    for axes, frame in zip(figure.axes, frames, strict=True):
        points = np.concatenate([polygon for body in frame for polygon in body])
        for column, limits in enumerate((axes.get_xlim(), axes.get_ylim())):
            assert limits[0] < points[:, column].min() < points[:, column].max() < limits[1]


def test_lists_of_different_length_are_refused():
    with pytest.raises(UsageError, match="2 times"):
        draw_strip([[[SQUARE]]], [0.0, 1.0], [])
    with pytest.raises(UsageError, match="0 times"):
        draw_strip([], [], [])
    with pytest.raises(UsageError):
        draw_distance([0.0, 1.0], [1e-5])


@pytest.mark.parametrize("zone", [None, np.nan])
def test_distance_without_a_zone_has_one_line(zone):
    assert len(draw_distance([0.0, 1.0], [1e-5, 2e-5], zone).axes[0].lines) == 1


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


def entry(radius, errors, spheroradius=1.0):
    """A floc of a library with fits at the N of `errors` {N: RE}."""
    fits = {n: StoredFit(np.zeros((n, 2)), 1e-6, error) for n, error in errors.items()}
    return ShapeEntry(f"a#{radius}", "a", 1e-6, (0.0, 0.0), 50, radius, spheroradius, fits)


@pytest.mark.parametrize(
    "entries",
    [
        [entry(4.0, {1: 30.0, 4: 10.0})],
        [entry(9.0, {1: 30.0})],
        [entry(r, {1: 35.0, 4: 9.0, 64: 1.0}, s) for r in (4.0, 8.0, 20.0) for s in (1.0, 2.0)],
    ],
)
def test_populations_of_any_size_are_drawn(entries, tmp_path):
    for name, draw in POPULATION_FIGURES.items():
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            save(draw(entries), tmp_path / f"{name}.png")


def test_a_floc_counts_once_whatever_its_spheroradii():
    entries = [entry(r, {1: 35.0, 4: 9.0}, s) for r in (4.0, 8.0, 20.0) for s in (1.0, 2.0)]
    (axes,) = figure_2(entries).axes
    assert sum(bar.get_height() for bar in axes.patches) == 3
    assert [panel.get_title(loc="left") for panel in figure_3(entries).axes] == [
        "spheroradius r = 1 px", "spheroradius r = 2 px"
    ]  # fmt: skip


def test_the_name_of_the_zone_keeps_clear_of_the_curve():
    times = np.linspace(0.0, 1.0, 50)
    for distance, side in ((times, "left"), (1.0 - times, "right")):
        label = draw_distance(times, 50e-6 - 9e-6 * distance**4, 45e-6).axes[0].texts[0]
        assert label.get_ha() == side
