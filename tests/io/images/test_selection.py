"""Weights of flocs: drawn populations whose sizes are known, thinned by the filters."""

import attrs
import numpy as np
import pytest

from flocsim.io.images.pictures import border_weight, focus_weights, segment, weighed


def mean(values, weights):
    return float(np.sum(values * weights) / np.sum(weights))


def test_weights_undo_a_depth_of_field_that_grows_with_size():
    """Softness as of depths drawn evenly; each is kept up to a limit that grows with its size."""
    rng = np.random.default_rng(5)
    radius = rng.lognormal(2.6, 0.5, 6000)
    blur = rng.uniform(0.0, 20.0, 6000)
    limit = np.maximum(3.5, 0.25 * radius)
    kept = blur <= limit
    weights = focus_weights(blur[kept], limit[kept])
    assert mean(radius[kept], np.ones(kept.sum())) > 1.15 * radius.mean()
    assert mean(radius[kept], weights) == pytest.approx(radius.mean(), rel=0.06)


def test_flocs_in_one_plane_are_all_alike():
    radius = np.linspace(5, 40, 60)
    blur, limit = np.full(60, 2.5), np.maximum(3.5, 0.25 * radius)
    assert np.allclose(focus_weights(blur, limit), 1.0)
    assert np.allclose(focus_weights(blur, np.full(60, np.inf)), 1.0)
    assert focus_weights(np.array([np.nan, 2.0]), np.array([3.5, 3.5])).tolist() == [1.0, 1.0]


def test_weights_undo_the_border():
    """Squares of two sizes anywhere in a frame: those that touch its border are not counted."""
    rng = np.random.default_rng(1)
    height, width, sizes = 200, 300, (10, 80)
    estimates = []
    for size in sizes:
        tops, lefts = rng.uniform(-size / 2, (height, width) - np.array(size / 2), (40000, 2)).T
        inside = (tops >= 1) & (lefts >= 1)
        inside &= (tops + size <= height - 1) & (lefts + size <= width - 1)
        weight = border_weight((20, 20, 20 + size, 20 + size), (height, width))
        estimates.append(inside.sum() * weight)
    assert estimates == pytest.approx([40000, 40000], rel=0.03)
    assert border_weight((0, 5, 10, 15), (100, 100)) == 1.0
    assert border_weight((1, 1, 99, 99), (100, 100)) > 1.0


def test_segmentations_are_weighed_together():
    row, column = np.mgrid[:120, :160]
    large, small = np.hypot(row - 60, column - 60) < 20, np.hypot(row - 60, column - 120) < 8
    grey = 0.8 - 0.5 * (large | small)
    found = segment(grey)
    one, two = weighed([found, attrs.evolve(found, regions=())], 0.25)
    assert two.regions == () and len(one.regions) == 2
    assert one.regions[0].weight > one.regions[1].weight > 1.0
