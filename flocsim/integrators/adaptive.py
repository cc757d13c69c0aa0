"""How the error of one step sets the size of the next."""

import math

from flocsim.layout import PREVIOUS_RATIO, PREVIOUS_STEP, REJECTED_RATIO, REJECTED_STEP

SAFETY = 0.9
"""Aim that far below the step at which the error would meet the tolerance."""

SMALLEST_FACTOR, LARGEST_FACTOR = 0.1, 8.0
"""Bounds of the change from one step to the next."""


LOWEST_ORDER = 0.5
"""Least power of the step that an error is taken to go with."""


def seen_order(clock, step, ratio, order):
    """The power of the step that the errors of two rejected trials in a row go with.

    Behind a switch stiff forces settle, and the error falls far more slowly than the order says
    (Gustafsson 1994).
    """
    if clock[REJECTED_STEP] <= step:
        return order
    decay = math.log(clock[REJECTED_RATIO] / ratio) / math.log(clock[REJECTED_STEP] / step)
    return min(max(decay, LOWEST_ORDER), order)


def adaptive_factor(clock, step, ratio, order):
    """By how much to change the step after one whose error was ``ratio`` times the tolerance.

    The trend of the last two steps is carried on, and a step behind a rejected one does not grow
    (Gustafsson 1994, as in Hairer & Wanner, Solving Ordinary Differential Equations II, IV.8).
    """
    ratio = max(ratio, 1e-12)
    if ratio > 1.0:
        order = seen_order(clock, step, ratio, order)
    factor = SAFETY * ratio ** (-1.0 / order)
    before = clock[PREVIOUS_STEP]
    if ratio <= 1.0 and before == 0.0:
        factor = min(factor, 1.0)
    elif ratio <= 1.0 and before < math.inf:
        trend = max(clock[PREVIOUS_RATIO], 1e-2) / (ratio * ratio)
        factor = min(factor, SAFETY * step / before * trend ** (1.0 / order))
    return min(max(factor, SMALLEST_FACTOR), LARGEST_FACTOR)
