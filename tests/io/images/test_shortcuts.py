"""What is decided early about islands and necks is what the whole work would decide."""

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt, label
from skimage.segmentation import watershed

from flocsim.io.images.outlines import EIGHT
from flocsim.io.images.regions import bodies, has_neck, joined, peaks_of


def blob(seed, shape=(60, 70)):
    """An 8-connected mask of overlapping discs."""
    rng = np.random.default_rng(seed)
    row, column = np.mgrid[: shape[0], : shape[1]]
    mask = np.zeros(shape, bool)
    y, x = rng.uniform(15, 45, 2)
    for _ in range(int(rng.integers(1, 7))):
        radius = rng.uniform(1.5, 9.0)
        mask |= np.hypot(row - y, column - x) < radius
        angle = rng.uniform(0.0, 2.0 * np.pi)
        away = rng.uniform(1.0, 2.2) * radius
        y, x = y + away * np.cos(angle), x + away * np.sin(angle)
    parts = label(mask, EIGHT)[0]
    return parts == parts[mask][0]


def depth_of(mask):
    return distance_transform_edt(np.pad(mask, 1))[1:-1, 1:-1]


@pytest.mark.parametrize("neck", [0.3, 0.5, 0.8, 1.0])
def test_where_no_peak_is_cut_off_all_basins_would_be_joined(neck):
    joins, cuts = 0, 0
    for seed in range(150):
        mask = blob(seed)
        depth = depth_of(mask)
        peaks = peaks_of(depth, 2)
        markers = np.zeros(mask.shape, int)
        markers[tuple(peaks.T)] = np.arange(1, len(peaks) + 1)
        basins = watershed(-depth, markers, connectivity=2, mask=mask)
        parts = joined(basins, depth, neck, 0.0)[0]
        assert np.array_equal(bodies(mask, neck, 4.0)[0] > 0, mask)
        if has_neck(depth, peaks, neck):
            cuts += parts.max() > 1
        else:
            joins += len(peaks) > 1
            assert parts.max() == 1
    assert cuts > 5
    assert joins > 5 or neck == 1.0
