"""The filter of noise changes neither how many flocs are found nor how large they are."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from flocsim.io.images.pictures import segment


def discs(radii, blur, noise, side=60):
    """A picture of dark discs of these radii [px] in a row of squares, blurred, with noise."""
    y, x = np.mgrid[:side, : side * len(radii)].astype(float)
    covered = np.zeros(x.shape)
    for place, radius in enumerate(radii):
        away = np.hypot(x - (place + 0.5) * side, y - 0.5 * side)
        covered += np.clip(radius + 0.5 - away, 0.0, 1.0)
    noisy = noise * np.random.default_rng(3).standard_normal(x.shape)
    return np.clip(0.8 * (1.0 - 0.3 * gaussian_filter(covered, blur)) + noisy, 0.0, 1.0)


@pytest.mark.parametrize("blur", [1.0, 2.0])
def test_a_coarser_filter_finds_the_same_flocs(blur):
    radii = [8.0, 9.0, 10.0, 12.0, 14.0, 17.0, 20.0]
    grey = discs(radii, blur, noise=0.02)
    for scale in (1.0, 2.0, 3.0, 4.0):
        found = sorted(r.equivalent_radius for r in segment(grey.copy(), noise_scale=scale).regions)
        assert len(found) == len(radii)
        assert np.mean(found) == pytest.approx(np.mean(radii), rel=0.03)
