"""Does the numerical error of a study matter beside its sampling interval?"""

from collections.abc import Mapping

import numpy as np

from flocsim.io.results.schema import Results
from flocsim.io.results.sweep_file import SweepResults

JUDGED = ("pr_a", "pr_inside")
"""Probabilities whose errors are compared: all others are of fewer replicates."""

LARGEST_RATIO = 0.5
"""Numerical error over the width of the sampling interval up to which it is stated once for the
study."""

FEWEST_FLIPS = 2
"""How many replicates of a condition a bound allows to flip where none did: it is never sharper."""


def numerics_matter(results: Results | SweepResults) -> bool:
    """Return True if the numerical error exceeds half of the sampling interval in any condition.

    That is, if the larger side of the change that exact runs could make of Pr[A] or Pr[inside] is
    more than LARGEST_RATIO of the width of its 95 % interval, and more than FEWEST_FLIPS of its
    replicates. Conditions without trials, or without re-runs, do not count. ``results`` must have
    the group `probabilities`. Of a study of rates, that of the efficiency α.
    """
    kernel = getattr(results, "kernel", None)
    if kernel is not None:
        return exceeds(kernel.arrays, "alpha")
    table = {k: each.values for k, each in results.labelled("probabilities").columns.items()}
    return any(exceeds(table, name, FEWEST_FLIPS / table["n_total"]) for name in JUDGED)


def exceeds(arrays: Mapping[str, np.ndarray], name: str, least: np.ndarray | float = 0.0) -> bool:
    """Return True if the numerical error of an estimate is large somewhere, and above ``least``."""
    low, high, error = (arrays[name + end] for end in ("_low", "_high", "_numerical"))
    # Comparisons are False where one is NaN.
    return bool(np.any((error > LARGEST_RATIO * (high - low)) & (error > 1.001 * least)))
