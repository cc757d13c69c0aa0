"""Figures of a shape library."""

import warnings

import numpy as np
import pytest

from flocsim.geometry.shapes.cores import Part
from flocsim.io.plots.shapes import POPULATION_FIGURES, figure_2, figure_3, shape, sizes
from flocsim.io.plots.style import save
from flocsim.io.shape_library import ShapeEntry, StoredFit
from tests.helpers.tiers import rest_slow


def ring(count, radius):
    """Corners [m] on a circle [px of a µm]; the centre for one."""
    turn = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    return (count > 1) * 1e-6 * radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)


def entry(radius, errors, spheroradius=1.0):
    """A floc of a library with fits at the N of `errors` {N: RE}."""
    fits = {n: StoredFit((Part((ring(n, radius),), 1e-6),), error) for n, error in errors.items()}
    return ShapeEntry(f"a#{radius}", "a", 1e-6, (0.0, 0.0), 50, radius, spheroradius, fits)


@pytest.mark.parametrize(
    "entries",
    rest_slow(
        [
            [entry(4.0, {1: 30.0, 4: 10.0})],
            [entry(9.0, {1: 30.0})],
            [entry(r, {1: 35.0, 4: 9.0, 64: 1.0}, s) for r in (4.0, 8.0, 20.0) for s in (1.0, 2.0)],
        ],
        lambda entries: entries[0].equivalent_radius == 9.0,
    ),
)
def test_populations_of_any_size_are_drawn(entries, tmp_path):
    for name, draw in POPULATION_FIGURES.items():
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            save(draw(entries), tmp_path / f"{name}.png")


def test_both_ways_to_count_add_up_to_1():
    entries = [entry(r, {1: 35.0, 4: 9.0}) for r in (4.0, 8.0, 20.0, 21.0)]
    for axes in sizes(entries).axes:
        assert sum(bar.get_height() for bar in axes.patches) == pytest.approx(1.0)
    number, volume = (axes.get_legend().get_texts()[1].get_text() for axes in sizes(entries).axes)
    assert (number, volume) == ("D50 = 28 µm", "D50 = 41 µm")


def test_scaled_copies_of_one_outline_have_the_dimension_1():
    entries = [entry(r, {1: 35.0, 8: 9.0}) for r in np.geomspace(500.0, 5000.0, 6)]
    title = shape(entries).axes[3].get_title(loc="left")
    assert title.startswith("$D_{f2}$ = 1.00 ± 0.0")


def test_a_floc_counts_once_whatever_its_spheroradii():
    entries = [entry(r, {1: 35.0, 4: 9.0}, s) for r in (4.0, 8.0, 20.0) for s in (1.0, 2.0)]
    (axes,) = figure_2(entries).axes
    assert sum(bar.get_height() for bar in axes.patches) == 3
    assert [panel.get_title(loc="left") for panel in figure_3(entries).axes] == [
        "spheroradius r = 1 px", "spheroradius r = 2 px"
    ]  # fmt: skip
