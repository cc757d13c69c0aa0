"""Does the numerical error of a study matter beside its sampling interval?"""

import numpy as np

from flocsim.io.confidence import wilson
from flocsim.io.results.schema import Results
from flocsim.io.results.sweep_file import SweepResults

JUDGED = ("pr_a", "pr_inside")
"""Probabilities whose errors are compared: all others are of fewer replicates."""

LARGEST_RATIO = 0.5
"""Numerical error over the width of the sampling interval up to which it is stated once for the
study."""


def numerics_matter(results: Results | SweepResults) -> bool:
    """Return True if the numerical error exceeds half of the sampling interval in any condition.

    That is, if the larger side of the change that exact runs could make of Pr[A] or Pr[inside] is
    more than LARGEST_RATIO of the width that Wilson's 95 % interval of so many collisions has at
    most, which is at a probability of ½. (At 0 and 1 it is as narrow as four replicates, which is
    what the bound of a numerical error comes to where nothing flipped.) Conditions without trials,
    or without re-runs, do not count. ``results`` must have the group `probabilities`. Of a study of
    rates, if that of the efficiency α exceeds half of its widest interval.
    """
    kernel = getattr(results, "kernel", None)
    if kernel is not None:
        arrays = kernel.arrays
        width = np.nanmax(arrays["alpha_high"] - arrays["alpha_low"], initial=0.0)
        return bool(np.any(arrays["alpha_numerical"] > LARGEST_RATIO * width))
    table = {k: each.values for k, each in results.labelled("probabilities").columns.items()}
    low, high = wilson(table["n_collided"] // 2, table["n_collided"])
    errors = [table[f"{name}_numerical"] for name in JUDGED]
    # Comparisons are False where one is NaN.
    return any(bool(np.any(error > LARGEST_RATIO * (high - low))) for error in errors)
