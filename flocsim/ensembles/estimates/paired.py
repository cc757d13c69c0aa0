"""Differences between conditions from the same replicates: common random numbers, used.

Replicate k has the same orientations (and flocs) in all conditions, so that what it does in two of
them is correlated, and the difference is known better than from independent samples.
"""

import numpy as np
from numpy.typing import ArrayLike

from flocsim.ensembles.estimates.events import AGGREGATED, DECIDED
from flocsim.io.confidence import wilson
from flocsim.io.results.schema import AXES, NOT_APPLICABLE


def joint_counts(outcome: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """How often an event happens in both, here only, there only, in neither.

    ``outcome``, ``inside``: codes (type, vertices, delta, replicate). Returns whole numbers
    (against, event, type, vertices, delta, 4): each condition and the first along each axis, over
    the replicates that count in both.
    """
    # The two events (2, …): a collision is inside; it aggregates.
    counts = np.stack([inside != NOT_APPLICABLE, outcome < DECIDED])
    happens = counts & np.stack([inside == 1, np.isin(outcome, AGGREGATED)])
    tables = []
    for axis in range(1, 1 + len(AXES)):
        first_counts = np.take(counts, [0], axis)
        first = np.take(happens, [0], axis)
        both = counts & first_counts
        cells = (happens & first, happens & ~first, ~happens & first, ~happens & ~first)
        tables.append(np.stack([np.sum(both & cell, axis=-1) for cell in cells], axis=-1))
    return np.stack(tables)


def paired_differences(joint: np.ndarray) -> dict[str, np.ndarray]:
    """The arrays of DIFFERENCES from joint counts (…, 4); NaN where no replicate counts."""
    joint = np.asarray(joint)
    pairs = joint.sum(axis=-1)
    difference, low, high = newcombe(*np.moveaxis(joint, -1, 0))
    return {
        "n_pairs": pairs,
        "difference": difference,
        "difference_low": low,
        "difference_high": high,
    }


def newcombe(
    both: ArrayLike, here: ArrayLike, there: ArrayLike, neither: ArrayLike
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(difference, low, high) of two paired proportions: here minus there, 95 %.

    ``both``, ``here`` only, ``there`` only, ``neither``: whole-number counts. Wilson's intervals
    of the two, joined by squares with the correlation φ between them. Source: R. G. Newcombe,
    Stat. Med. 17 (1998) 2635–2650, method 10.
    """
    both, here, there, neither = (
        np.asarray(each, dtype=float) for each in (both, here, there, neither)
    )
    n = both + here + there + neither
    phi = correlation(both, here, there, neither)
    return between(both + here, n, both + there, n, phi)


def between(
    successes: ArrayLike, trials: ArrayLike, others: ArrayLike, of: ArrayLike, phi: ArrayLike = 0.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(difference, low, high) of successes/trials − others/of, 95 %, of a correlation ``phi``.

    0 for independent samples: Newcombe, Stat. Med. 17 (1998) 873–890, method 10. NaN where either
    has no trials.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = np.true_divide(successes, trials), np.true_divide(others, of)
        one_low, one_high = wilson(successes, trials)
        other_low, other_high = wilson(others, of)
        down = joined(one - one_low, other_high - other, phi)
        up = joined(one_high - one, other - other_low, phi)
        return one - other, one - other - down, one - other + up


def joined(one, other, phi):
    return np.sqrt(np.maximum(one * one - 2.0 * phi * one * other + other * other, 0.0))


def correlation(both, here, there, neither):
    """φ of a table of four cells with Newcombe's continuity correction; 0 for an empty margin."""
    n = both + here + there + neither
    excess = both * neither - here * there
    excess = np.where(excess > 0.0, np.maximum(excess - 0.5 * n, 0.0), excess)
    margins = (both + here) * (there + neither) * (both + there) * (here + neither)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(margins > 0.0, excess / np.sqrt(margins), 0.0)
