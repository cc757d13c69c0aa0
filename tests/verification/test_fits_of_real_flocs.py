"""The paper's claims 1 to 5 on fits (section 3.2), on real silhouettes, with 95 % intervals.

Means over flocs come with Student's interval; what is compared is compared floc by floc.
"""

import itertools
from functools import cache

import numpy as np
import pytest
from scipy import stats

from flocsim.geometry.fit import fit_mask
from tests.helpers.real_images import silhouettes
from tests.helpers.tiers import rest_slow

COUNTS = (4, 8, 16, 28, 64)
RADII = (1.0, 2.0, 4.0)
GOALS = {4: 16.5, 8: 6.4, 16: 2.9, 28: 1.6, 64: 0.7}
"""Mean RE [%] at r = 1 px, 14 to 26 px radius; the least found for N = 4 by any search is 16.1."""


@cache
def flocs(low, high, every=1):
    """Masks of the silhouettes with low ≤ r_eq ≤ high [px]."""
    return [mask for mask, radius in silhouettes() if low <= radius <= high][::every]


@cache
def errors(low, high, every, vertices, radius=1.0):
    """RE [%] of every floc."""
    masks = flocs(low, high, every)
    return np.array([fit_mask(m, vertices=vertices, radius=radius).relative_error for m in masks])


def interval(values):
    """The 95 % interval of a mean."""
    half = stats.t.ppf(0.975, len(values) - 1) * np.std(values, ddof=1) / np.sqrt(len(values))
    return np.mean(values) - half, np.mean(values) + half


def large(vertices, radius=1.0):
    """RE of a sample of the larger class, r_eq > 8 px: twice the largest spheroradius."""
    return errors(8.0, 60.0, 5, vertices, radius)


def test_claim_1_spheres_miss_by_a_third():
    assert interval(errors(5.0, 60.0, 1, 1))[0] > 32
    assert np.mean(errors(4.0, 5.0, 1, 1)) > 32


def test_claim_2_spheropolygons_beat_spheres():
    for vertices in COUNTS:
        assert interval(large(1) - large(vertices))[0] > 0
    # Floc by floc from eight on; a nearly round one is nearer to its circle than to any quadrangle.
    assert np.all(large(8) < large(1)) and np.mean(large(4) < large(1)) > 0.9


@pytest.mark.slow
@pytest.mark.parametrize("counts", [[64], [28, 64]])
def test_claim_3_errors_rise_with_the_radius_from_28_vertices_on(counts):
    means = [np.mean([large(n, r) for n in counts], axis=0) for r in RADII]
    assert interval(means[1] - means[0])[0] > 0
    assert interval(means[2] - means[1])[0] > 0


@pytest.mark.slow
def test_claim_3_does_not_hold_for_four_vertices():
    """Four sharp corners suit a round floc less than four round ones."""
    assert interval(large(4, 4.0) - large(4, 1.0))[1] < 0


@pytest.mark.parametrize("radius", rest_slow(RADII, lambda radius: radius == 1.0))
def test_claim_4_errors_fall_with_n(radius):
    counts = COUNTS if radius == 1.0 else COUNTS[:4] if radius == 2.0 else COUNTS[:3]
    for fewer, more in itertools.pairwise(counts):
        assert interval(large(fewer, radius) - large(more, radius))[0] > 0


def test_claim_5_the_best_fits_miss_by_less_than_one_percent():
    assert interval(large(64))[1] < 1.0


@pytest.mark.slow
def test_mean_errors_of_the_larger_flocs():
    for vertices, goal in GOALS.items():
        assert np.mean(errors(14.0, 26.0, 1, vertices)) <= goal


def test_mean_errors_of_the_smallest_flocs():
    for vertices, goal in {4: 12.5, 8: 5.1, 16: 1.5}.items():
        assert np.mean(errors(4.0, 5.0, 1, vertices)) <= goal
