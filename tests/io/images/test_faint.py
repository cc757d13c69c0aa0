"""Faint flocs: grain does not decide whether they are dark, and what is too faint is listed."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from flocsim.io.images.pictures import segment


def discs(shape, places, blur=1.5):
    """The blurred cover of discs (x, y, radius) [px]."""
    y, x = np.mgrid[: shape[0], : shape[1]]
    covered = np.zeros(shape)
    for at_x, at_y, radius in places:
        covered += np.clip(radius + 0.5 - np.hypot(x - at_x, y - at_y), 0.0, 1.0)
    return gaussian_filter(covered, blur)


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("flocs", ["dark", "bright"])
@pytest.mark.parametrize("coarse", [0.0, 1.0])
def test_skewed_grain_does_not_turn_faint_flocs_over(side, flocs, coarse):
    places = [(90 + 110 * (k % 7), 90 + 120 * (k // 7), 10 + 2 * (k % 5)) for k in range(28)]
    grain = np.random.default_rng(7).exponential(size=(560, 880)) - 1.0
    grain = gaussian_filter(grain, coarse) if coarse else grain
    change = 0.045 if flocs == "bright" else -0.045
    grey = 0.6 + change * discs(grain.shape, places) + side * 0.02 * grain / grain.std()
    assert segment(np.round(255 * grey) / 255).flocs == flocs


@pytest.mark.parametrize("contrast", [0.05, 0.09])
def test_a_large_faint_disc_is_listed_with_the_reason(contrast):
    places = [(60 + 90 * k, 60, 12) for k in range(5)]
    cover = 0.6 * discs((300, 500), places) + contrast * discs((300, 500), [(250, 200, 18)])
    noise = 0.01 * np.random.default_rng(1).standard_normal(cover.shape)
    found = segment(np.clip(0.8 * (1.0 - cover) + noise, 0.0, 1.0))
    assert len(found.regions) == 5
    near = [r for r in found.rejected if np.hypot(r.centroid[0] - 250, r.centroid[1] - 200) < 5]
    assert [each.reason for each in near] == ["too faint"]
    assert not found.alarms
