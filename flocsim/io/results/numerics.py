"""Does the numerical error of a study matter beside its sampling interval?"""

import numpy as np

from flocsim.io.results.schema import Results
from flocsim.io.results.sweep_file import SweepResults

JUDGED = ("pr_a", "pr_inside")
"""Probabilities whose errors are compared: all others are of fewer replicates."""

JUDGED_OF_RATES = ("alpha",)
"""The same of a study of rates."""

LARGEST_RATIO = 0.5
"""Numerical error over the width of the sampling interval up to which it is stated once for the
study."""


def numerics_matter(results: Results | SweepResults) -> bool:
    """Return True if the numerical error exceeds half of the sampling interval in any condition.

    That is, if the larger side of the change that exact runs could make of Pr[A] or Pr[inside] is
    more than LARGEST_RATIO of the width of its 95 % interval. Conditions without trials, or
    without re-runs, do not count. ``results`` must have the group `probabilities`.
    """
    kernel = getattr(results, "kernel", None)
    table = results.labelled("probabilities").columns if kernel is None else {}
    arrays = (
        {name: each.values for name, each in table.items()} if kernel is None else kernel.arrays
    )
    for name in JUDGED if kernel is None else JUDGED_OF_RATES:
        low, high, error = (arrays[name + end] for end in ("_low", "_high", "_numerical"))
        if np.any(error > LARGEST_RATIO * (high - low)):  # False where one is NaN
            return True
    return False
