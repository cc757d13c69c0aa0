"""The figure of a single fit: its panels, holes, and the pixels that differ."""

import numpy as np
import pytest

from flocsim.geometry.fit import fit_mask
from flocsim.geometry.shapes.synthetic import synthetic_floc
from flocsim.io.plots.shapes import covered_by, single_fit, swept_rings
from flocsim.io.plots.style import save
from tests.helpers.tiers import rest_slow


@pytest.mark.parametrize("vertices", rest_slow([1, 4, 32], lambda vertices: vertices == 4))
def test_the_pixels_that_differ_are_those_of_the_fit(vertices, tmp_path):
    mask = np.pad(synthetic_floc((1, 3), 40, 1.8), 2)
    fit = fit_mask(mask, vertices=vertices)
    rings = [ring * (1.0, -1.0) for ring in swept_rings(fit.parts, 64)]
    wrong = int((covered_by(rings, mask.shape) != mask).sum())
    # Chords in the place of arcs may miss a pixel that lies on one.
    assert wrong == pytest.approx(fit.wrong_pixels, abs=2)
    figure = single_fit(mask, fit, "a$b#1")
    assert [axes.get_title(loc="left").partition(" ")[0] for axes in figure.axes] == [
        "mask:", "core:", "swept", "V"
    ]  # fmt: skip
    save(figure, tmp_path / "f.png")


def test_holes_are_drawn_as_such():
    y, x = np.mgrid[:50, :50]
    mask = (np.hypot(x - 25, y - 25) < 20) & (np.hypot(x - 25, y - 25) > 8)
    fit = fit_mask(mask, vertices=24, holes=True)
    assert fit.hole_sizes
    rings = [ring * (1.0, -1.0) for ring in swept_rings(fit.parts, 64)]
    assert not covered_by(rings, mask.shape)[25, 25]
    assert len(single_fit(mask, fit).axes[1].patches) == 2
