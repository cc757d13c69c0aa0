"""The overlay: everything that was found is outlined, numbered, inside the frame, visible."""

import numpy as np
import pytest

from flocsim.geometry.fit import fit_mask
from flocsim.geometry.fit.fit import Fit
from flocsim.geometry.shapes.synthetic import synthetic_floc
from flocsim.io.images.pictures import segment
from flocsim.io.plots.shapes import (
    FLOC_COLOUR,
    REASON_COLOURS,
    covered_by,
    draw_overlay,
    single_fit,
    stretched,
    swept_rings,
)
from flocsim.io.plots.style import save
from tests.helpers.tiers import rest_slow


@pytest.mark.parametrize(
    "name", rest_slow([r"a$\frac{b.png", "$x^$", "a\x1b[31m\n.png"], lambda name: "frac" in name)
)
def test_a_picture_of_any_name_is_drawn(name, tmp_path):
    save(draw_overlay(np.zeros((20, 30)), [], f"{name}: 0 flocs", []), tmp_path / "o.png")


def corners(*places, shape=(120, 160)):
    """A bright-on-black picture of disks (x, y, radius)."""
    y, x = np.mgrid[: shape[0], : shape[1]]
    return sum((np.hypot(x - cx, y - cy) <= r) * 0.05 for cx, cy, r in places)


def test_what_was_left_out_is_outlined_and_named_inside_the_frame(tmp_path):
    grey = corners((60, 60, 15), (0, 0, 12), (159, 119, 12), (0, 119, 9), (150, 5, 2.5))
    found = segment(grey)
    (region,) = found.regions
    fit = fit_mask(region.mask, vertices=8)
    assert isinstance(fit, Fit)
    figure = draw_overlay(grey, [(region, fit)], "title", found.rejected)
    figure.canvas.draw()
    picture, *_ = figure.axes
    texts = {text.get_text(): text for text in picture.texts}
    assert sorted(texts) == [
        "1",
        "2 at the border",
        "3 too small",
        "4 at the border",
        "5 at the border",
    ]
    frame = picture.get_window_extent()
    for text in texts.values():
        box = text.get_window_extent()
        assert frame.x0 - 1 <= box.x0 and box.x1 <= frame.x1 + 1
        assert frame.y0 - 1 <= box.y0 and box.y1 <= frame.y1 + 1
    assert len(picture.collections) == len(found.rejected) + 2  # and the two of its band
    assert texts["3 too small"].get_color() == REASON_COLOURS["too small"]
    key = [entry.get_text() for entry in figure.legends[0].get_texts()]
    assert key == ["1 fitted", "3 at the border", "1 too small"]
    outline = picture.lines[0]
    assert outline.get_color() == FLOC_COLOUR
    assert np.allclose(outline.get_xydata().mean(axis=0), (60, 60), atol=2)


def test_a_dim_picture_becomes_visible():
    shown = stretched(corners((60, 60, 15)))
    assert shown.max() == 1.0 and shown.min() == 0.0
    light = np.linspace(0.01, 0.5, 100)[None] * np.ones((50, 1))
    assert np.percentile(stretched(light**3), 20) > 0.12
    assert np.percentile(stretched(light), 20) == pytest.approx(0.35, abs=0.01)
    for flat in (np.zeros((5, 5)), np.ones((5, 5)), np.full((5, 5), 0.3)):
        assert np.isfinite(stretched(flat)).all()


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
