"""Flocs that cover much of their frame: the light is told from the rim, and they stay whole."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from flocsim.io.images.pictures import segment

SHAPE = 180, 240


def picture(share, *, dark, centre=0.5, contrast=0.3, vignette=0.0, blur=1.5):
    """(grey, mask) of a square of even grey on noise, `share` of the frame."""
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    half = 0.5 * np.sqrt(share * SHAPE[0] * SHAPE[1])
    middle = abs(x - centre * SHAPE[1]), abs(y - 0.5 * SHAPE[0])
    mask = (middle[0] < 1.1 * half) & (middle[1] < half / 1.1)
    light = 1.0 - vignette * ((x / SHAPE[1] - 0.5) ** 2 + (y / SHAPE[0] - 0.5) ** 2)
    soft = gaussian_filter(mask.astype(float), blur)
    grey = 0.8 * light * (1.0 - contrast * soft) if dark else 0.2 * light + contrast * soft
    noise = np.random.default_rng(5).standard_normal(SHAPE)
    return np.clip(grey + 0.02 * noise, 0.0, 1.0), mask


@pytest.mark.parametrize("dark", [True, False])
@pytest.mark.parametrize(
    ("share", "options"),
    [(0.15, {"centre": 0.3}), (0.3, {"vignette": 0.5, "blur": 3.0}), (0.55, {})],
)
def test_a_large_floc_stays_whole_and_is_taken_for_the_floc(share, options, dark):
    grey, mask = picture(share, dark=dark, **options)
    found = segment(grey)
    assert found.flocs == ("dark" if dark else "bright") and len(found.regions) == 1
    seen = np.zeros_like(mask)
    top, left, bottom, right = found.regions[0].bbox
    seen[top:bottom, left:right] = found.regions[0].mask[1:-1, 1:-1]
    assert (seen & mask).sum() / (seen | mask).sum() > 0.93
