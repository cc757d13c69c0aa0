"""Measures of masks: those of regionprops, and near what was drawn."""

import numpy as np
import pytest
from skimage.measure import regionprops

from flocsim.geometry.shapes.synthetic import synthetic_floc
from flocsim.io.images.regions import mask_measures


def disc(radius, margin=4):
    y, x = np.mgrid[: 2 * radius + 2 * margin, : 2 * radius + 2 * margin]
    return np.hypot(x - radius - margin, y - radius - margin) < radius


def ellipse(a, b, angle):
    y, x = np.mgrid[-a - 4 : a + 5, -a - 4 : a + 5]
    c, s = np.cos(angle), np.sin(angle)
    return ((c * x + s * y) / a) ** 2 + ((c * y - s * x) / b) ** 2 < 1.0


@pytest.mark.parametrize(
    "mask", [disc(5), disc(30), ellipse(30, 11, 0.7), synthetic_floc((1, 2), 40, 1.8)]
)
def test_they_are_those_of_regionprops(mask):
    found, known = mask_measures(mask), regionprops(mask.astype(int))[0]
    expected = {
        "perimeter": known.perimeter_crofton,
        "aspect_ratio": known.axis_major_length / known.axis_minor_length,
        "circularity": 4 * np.pi * known.area / known.perimeter_crofton**2,
        "solidity": known.solidity,
        "feret_max": known.feret_diameter_max,
    }
    for name, value in expected.items():
        assert getattr(found, name) == pytest.approx(value, rel=1e-9)
    assert found.feret_min < found.feret_max


def test_a_row_of_pixels_is_a_rectangle():
    """Nothing of a floc is infinite, or a library could not be read back."""
    found = mask_measures(np.pad(np.ones((1, 7), bool), 1))
    assert (found.aspect_ratio, found.feret_max, found.feret_min) == pytest.approx((7.0, 7.0, 1.0))
    assert np.isfinite(mask_measures(np.pad(np.ones((1, 1), bool), 1)).aspect_ratio)
