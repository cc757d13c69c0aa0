"""Synthetic flocs: repeatable, connected, and of the fractal dimension that was asked for."""

import numpy as np
import pytest
from scipy import ndimage
from scipy.spatial.distance import pdist

from flocsim.errors import UsageError
from flocsim.geometry.shapes.synthetic import (
    EQUIVALENT_PIXELS,
    PREFACTOR,
    grow_cluster,
    synthetic_floc,
)


@pytest.mark.parametrize("seed", range(5))
def test_a_floc_is_one_piece_without_holes_of_the_stated_size(seed):
    mask = synthetic_floc(seed)
    assert ndimage.label(mask)[1] == 1
    assert np.array_equal(mask, ndimage.binary_fill_holes(mask))
    assert np.sqrt(mask.sum() / np.pi) == pytest.approx(EQUIVALENT_PIXELS, rel=0.05)
    border = np.concatenate([mask[0], mask[-1], mask[:, 0], mask[:, -1]])
    assert not border.any()


def test_the_seed_decides_all():
    assert np.array_equal(synthetic_floc((3, 1)), synthetic_floc((3, 1)))
    assert synthetic_floc((3, 1)).tobytes() != synthetic_floc((3, 2)).tobytes()


@pytest.mark.parametrize("dimension", [1.4, 1.8])
def test_particles_touch_and_fill_the_plane_as_the_dimension_says(dimension):
    for seed in range(3):
        centres = grow_cluster(np.random.default_rng(seed), 120, dimension)
        distances = pdist(centres)
        assert distances.min() > 2.0 - 1e-5
        assert np.count_nonzero(distances < 2.0 + 1e-9) >= len(centres) - 1
        gyration = np.sqrt(((centres - centres.mean(axis=0)) ** 2).sum(axis=1).mean())
        expected = (len(centres) / PREFACTOR) ** (1.0 / dimension)
        assert gyration == pytest.approx(expected, rel=0.15)


@pytest.mark.parametrize("wrong", [{"particles": 1}, {"dimension": 1.0}, {"dimension": 2.0}])
def test_what_is_no_floc_is_refused(wrong):
    with pytest.raises(UsageError, match="at least 2 particles and a fractal dimension between"):
        synthetic_floc(0, **wrong)
