"""Sizes of blurred flocs hold from twice the least size on, whatever lies below it."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from flocsim.io.images.pictures import segment
from tests.helpers.tiers import rest_slow

FINE = 4


def ellipses(seed, side=900, cell=60):
    """(cover of each pixel, [(x, y, r_eq)]) of ellipses from 2 px up, one in each square."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[: cell * FINE, : cell * FINE] / FINE
    cover, known = np.zeros((side, side)), []
    for top in range(0, side, cell):
        for left in range(0, side, cell):
            radius, stretch, turn = (
                2.0 * rng.random() ** -0.7,
                rng.uniform(1.0, 1.5),
                rng.random() * 3,
            )
            radius = min(radius, 16.0)
            at_x, at_y = 30 + rng.random(2) - 0.5
            along = (x - at_x) * np.cos(turn) + (y - at_y) * np.sin(turn)
            across = (y - at_y) * np.cos(turn) - (x - at_x) * np.sin(turn)
            inside = np.hypot(along / stretch, across * stretch) < radius
            cover[top : top + cell, left : left + cell] = zoomed(inside)
            known.append((left + at_x, top + at_y, np.sqrt(inside.sum() / np.pi) / FINE))
    return cover, np.array(known)


def zoomed(inside):
    height, width = (size // FINE for size in inside.shape)
    return inside.reshape(height, FINE, width, FINE).mean(axis=(1, 3))


@pytest.mark.parametrize(
    ("blur", "noise"),
    rest_slow([(1.0, 0.01), (2.0, 0.01), (2.0, 0.05), (3.0, 0.01), (3.0, 0.05)],
              lambda blur, noise: (blur, noise) == (3.0, 0.05)),
)  # fmt: skip
def test_sizes_and_bands_hold_from_twice_the_least_size_on(blur, noise):
    cover, known = ellipses(int(10 * blur))
    down, across = np.mgrid[-1:1:900j, -1:1:900j]
    light = 0.8 * (1.0 - 0.3 * (down**2 + across**2))
    grey = light * (1.0 - 0.6 * gaussian_filter(cover, blur))
    grey += noise * np.random.default_rng(2).standard_normal(grey.shape)
    ratios, within = [], []
    for region in segment(np.clip(grey, 0.0, 1.0)).regions:
        away = np.hypot(*(known[:, :2] - region.centroid).T)
        radius = known[away.argmin(), 2]
        if away.min() < 10.0 and region.equivalent_radius >= 8.0:
            ratios.append(region.equivalent_radius / radius)
            within.append(region.radius_band[0] <= radius <= region.radius_band[1])
    assert len(ratios) > 10
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.03)
    assert np.mean(within) >= 0.94
