"""Noise and light of a picture, which are told strip by strip and from samples."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from flocsim.io.images.background import robust_deviation, sampled
from flocsim.io.images.outlines import background_noise


@pytest.mark.parametrize("shape", [(200, 130), (65, 1100), (1, 50), (1500, 2)])
def test_the_noise_is_that_of_the_whole_contrast(shape):
    rng = np.random.default_rng(4)
    contrast = gaussian_filter(rng.standard_normal(shape), 1.0) + (rng.random(shape) < 0.01)
    noise, slope = background_noise(contrast, 0.0, 1.0)
    whole = robust_deviation(sampled(contrast - gaussian_filter(contrast, 3.0)))
    assert noise == pytest.approx(whole, rel=1e-9)
    if min(shape) < 2:
        assert slope == 0.0
    else:
        down, across = np.gradient(contrast)
        square = (down**2 + across**2)[np.abs(contrast) < 3.0 * noise]
        assert slope == pytest.approx(np.median(square) / np.log(2.0), rel=1e-6)
