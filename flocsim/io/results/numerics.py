"""Does the numerical error of a study matter beside its sampling interval?"""

import numpy as np

from flocsim.io.results.schema import Results
from flocsim.io.results.sweep_file import SweepResults

JUDGED = ("pr_a", "pr_inside")
"""Probabilities whose errors are compared: all others are of fewer replicates."""

LARGEST_RATIO = 0.5
"""Numerical error over the half-width of the sampling interval up to which it is told once for the
study: both added in quadrature are 1.12 times the half-width then."""


def numerics_matter(results: Results | SweepResults) -> bool:
    """Return True if the numerical error exceeds half of the sampling error in any condition.

    That is, if the larger side of the change that exact runs could make of Pr[A] or Pr[inside] is
    more than LARGEST_RATIO of the half-width of its 95 % interval. Conditions without trials, or
    without re-runs, do not count. ``results`` must have the group `probabilities`.
    """
    table = results.labelled("probabilities").columns
    for name in JUDGED:
        low, high, error = (table[name + end].values for end in ("_low", "_high", "_numerical"))
        if np.any(error > LARGEST_RATIO * 0.5 * (high - low)):  # False where one is NaN
            return True
    return False
