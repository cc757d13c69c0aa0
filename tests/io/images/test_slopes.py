"""Slopes at and around outlines: those of numpy's gradients and scipy's filters."""

import numpy as np
import pytest
from scipy.ndimage import binary_dilation, maximum_filter

from flocsim.io.images.focus import NEAR, along, around, rim

SHAPES = [(30, 40), (1, 9), (9, 1), (2, 2), (40, 3)]


def scene(shape, seed):
    """(picture, its |∇|, mask of a box in it, row and column of the box)."""
    rng = np.random.default_rng(seed)
    picture = rng.random(shape, np.float32)
    axes = [np.gradient(picture, axis=k) if n > 1 else 0.0 * picture for k, n in enumerate(shape)]
    top, left = (int(rng.integers(0, (size + 1) // 2)) for size in shape)
    size = [
        int(rng.integers(1, size - start + 1))
        for size, start in zip(shape, (top, left), strict=True)
    ]
    mask = binary_dilation(rng.random(size) < 0.1, iterations=int(rng.integers(1, 4)))
    return picture, np.hypot(*axes), mask, (top, left)


@pytest.mark.parametrize("shape", SHAPES)
def test_along_an_outline_they_are_the_steepest_within_reach(shape):
    for seed in range(20):
        picture, slope, mask, (top, left) = scene(shape, seed)
        box = slice(top, top + mask.shape[0]), slice(left, left + mask.shape[1])
        for reach in (0, 1):
            steepest = maximum_filter(slope, 2 * reach + 1)[box][rim(mask)]
            assert np.allclose(along(picture, mask, (top, left), reach), steepest, rtol=1e-5)


@pytest.mark.parametrize("shape", SHAPES)
def test_around_a_mask_all_pixels_within_two_steps_are_told(shape):
    for seed in range(20):
        picture, slope, mask, (top, left) = scene(shape, seed)
        near = binary_dilation(mask, iterations=NEAR)
        box = slice(top, top + mask.shape[0]), slice(left, left + mask.shape[1])
        values, squares = around(picture, mask, (top, left))
        assert np.array_equal(values, picture[box][near])
        assert np.allclose(squares, slope[box][near] ** 2, rtol=1e-5, atol=1e-12)
