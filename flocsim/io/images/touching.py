"""Flocs that touch in the picture: parted where a narrow neck joins them."""

import numpy as np

STEPS = ((0, 1), (1, 0), (1, 1), (1, -1))
"""From a pixel to half of its eight neighbours: every pair of neighbours once."""


def split_touching(labels, boxes, neck, min_radius):
    """Part the regions of `labels`, in place, at their necks; returns the highest label.

    A neck parts two bodies if it is at most `neck` times as wide as the largest circle in the
    smaller of them, and neither would be smaller than `min_radius` [px].
    """
    highest = len(boxes)
    for number, box in enumerate(boxes, start=1):
        mask = labels[box] == number
        if mask.sum() < 2.0 * np.pi * min_radius**2:
            continue
        parts = bodies(mask, neck, min_radius)
        for part in range(2, parts.max() + 1):
            highest += 1
            labels[box][parts == part] = highest
    return highest


def bodies(mask, neck, min_radius):
    """The mask's pixels numbered by body, from 1; 0 outside."""
    from scipy.ndimage import distance_transform_edt
    from skimage.feature import peak_local_max
    from skimage.segmentation import watershed

    depth = distance_transform_edt(np.pad(mask, 1))[1:-1, 1:-1]
    peaks = peak_local_max(
        depth, min_distance=max(1, int(0.5 * min_radius)), labels=mask.astype(int),
        exclude_border=False,
    )  # fmt: skip
    if len(peaks) < 2:
        return mask.astype(int)
    markers = np.zeros(mask.shape, int)
    markers[tuple(peaks.T)] = np.arange(1, len(peaks) + 1)
    basins = watershed(-depth, markers, connectivity=2, mask=mask)
    return joined(basins, depth, neck, min_radius)


def passes(basins, depth):
    """(K + 1, K + 1): depth of the deepest pass between each two basins [px], 0 for none."""
    count = basins.max() + 1
    deepest = np.zeros((count, count))
    height, width = basins.shape
    for down, right in STEPS:
        here = (slice(0, height - down), slice(max(0, -right), width - max(0, right)))
        there = (slice(down, height), slice(max(0, right), width - max(0, -right)))
        a, b = basins[here], basins[there]
        across = (a != b) & (a > 0) & (b > 0)
        level = np.minimum(depth[here], depth[there])[across]
        np.maximum.at(deepest, (a[across], b[across]), level)
    return np.maximum(deepest, deepest.T)


def joined(basins, depth, neck, min_radius):
    """Basins renumbered from 1, those joined that no neck parts: the widest passes first."""
    count = basins.max() + 1
    deepest, least = passes(basins, depth), np.pi * min_radius**2
    peak = np.array([depth[basins == k].max(initial=0.0) for k in range(count)])
    area = np.bincount(basins.ravel(), minlength=count).astype(float)
    owner = np.arange(count)
    while True:
        smaller = np.minimum.outer(peak, peak)
        small = np.minimum.outer(area, area) < least
        wide = np.where((deepest > neck * smaller) | small, deepest, 0.0)
        a, b = np.unravel_index(np.argmax(wide), wide.shape)
        if wide[a, b] == 0.0:
            break
        owner[owner == b] = a
        peak[a], area[a] = max(peak[a], peak[b]), area[a] + area[b]
        deepest[a] = deepest[:, a] = np.maximum(deepest[a], deepest[b])
        deepest[b], deepest[:, b], deepest[a, a] = 0.0, 0.0, 0.0
    numbers = np.unique(owner[1:], return_inverse=True)[1] + 1
    return np.concatenate([[0], numbers])[basins]
