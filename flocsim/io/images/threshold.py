"""The level of contrast that parts flocs from background."""

import numpy as np

NOISE_MARGIN = 5.0
"""A floc stands out by this many standard deviations of the noise, or it is not one."""

LEVELS = 48
"""Levels of contrast at which the steepness of edges is looked at."""

STEEPER = 1.25
"""A lower level is taken if edges are steeper there by this factor."""


def find_threshold(contrast, noise, saturated):
    """Otsu's level of the contrast stretched between two thresholds, or the steepest below it.

    The thresholds are the median and the top `saturated` share (paper, section 2.1: imadjust, then
    graythresh).  Where flocs are partly more than one layer thick, Otsu's level parts the layers
    instead; the edge of a single layer then is steeper, and its level is taken.
    """
    from skimage.filters import threshold_otsu

    low = np.median(contrast)
    high = np.quantile(contrast, 1.0 - saturated)
    if high <= low:
        high = contrast.max()
    if high <= low:
        return float(low)
    stretched = np.clip((contrast - low) / (high - low), 0.0, 1.0)
    otsu = low + threshold_otsu(stretched) * (high - low)
    floor = low + NOISE_MARGIN * noise
    return float(steepest_level(contrast, floor, otsu) if otsu > floor else floor)


def steepest_level(contrast, floor, otsu):
    """The level from `floor` to `otsu` with the steepest edges, `otsu` unless clearly so."""
    levels = np.linspace(floor, otsu, LEVELS + 1)
    steepness = mean_gradients(contrast, levels)
    best = int(np.argmax(steepness))
    if steepness[best] < STEEPER * steepness[-1]:
        return otsu
    return 0.5 * (levels[best] + levels[best + 1])


def mean_gradients(contrast, levels):
    """Mean gradient [1/px] of the pixels between each two levels, smoothed over three of them."""
    inner = contrast[1:-1, 1:-1]
    rows, columns = np.nonzero((inner >= levels[0]) & (inner < levels[-1]))
    across = contrast[rows + 1, columns + 2] - contrast[rows + 1, columns]
    down = contrast[rows + 2, columns + 1] - contrast[rows, columns + 1]
    width = (levels[-1] - levels[0]) / LEVELS
    bins = np.minimum(((inner[rows, columns] - levels[0]) / width).astype(int), LEVELS - 1)
    count = np.bincount(bins, minlength=LEVELS)
    total = np.bincount(bins, 0.5 * np.hypot(across, down), minlength=LEVELS)
    three = np.ones(3)
    return np.convolve(total, three, "same") / np.maximum(np.convolve(count, three, "same"), 1)
