"""Figures of a shape library."""

import warnings

import numpy as np
import pytest

from flocsim.io.plots.shapes import POPULATION_FIGURES, figure_2, figure_3
from flocsim.io.plots.style import save
from flocsim.io.shapes.library import ShapeEntry, StoredFit


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
