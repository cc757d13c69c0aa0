"""How the error of one step sets the size of the next."""

import math

from flocsim.layout import PREVIOUS_RATIO, PREVIOUS_STEP

SAFETY = 0.9
"""Aim that far below the step at which the error would meet the tolerance."""

SMALLEST_FACTOR, LARGEST_FACTOR = 0.1, 8.0
"""Bounds of the change from one step to the next."""


def adaptive_factor(clock, step, ratio, order):
    """By how much to change the step after one whose error was ``ratio`` times the tolerance.

    The trend of the last two steps is carried on, and a step behind a rejected one does not grow
    (Gustafsson 1994, as in Hairer & Wanner, Solving Ordinary Differential Equations II, IV.8).
    """
    ratio = max(ratio, 1e-12)
    factor = SAFETY * ratio ** (-1.0 / order)
    before = clock[PREVIOUS_STEP]
    if ratio <= 1.0 and before == 0.0:
        factor = min(factor, 1.0)
    elif ratio <= 1.0 and before < math.inf:
        trend = max(clock[PREVIOUS_RATIO], 1e-2) / (ratio * ratio)
        factor = min(factor, SAFETY * step / before * trend ** (1.0 / order))
    return min(max(factor, SMALLEST_FACTOR), LARGEST_FACTOR)
