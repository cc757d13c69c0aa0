"""Probabilities over all displacements together.

A replicate has the same orientations at every displacement, so that its collisions are not
independent: the interval is Wilson's at the number of independent events which the spread between
replicates shows (a ratio of cluster totals; W. G. Cochran, Sampling Techniques, 1977, ch. 6).
"""

import numpy as np

from flocsim.ensembles.paired import AGGREGATED, DECIDED
from flocsim.io.intervals import score_interval
from flocsim.io.results_schema import NOT_APPLICABLE

INSIDE_CLASSES, OUTSIDE_CLASSES = (0, 1), (2, 3)


def trials_of(outcome, inside):
    """{estimate: (trials, successes)}, flags of the codes' shape."""
    aggregated = np.isin(outcome, AGGREGATED)
    within = np.isin(outcome, INSIDE_CLASSES)
    without = np.isin(outcome, OUTSIDE_CLASSES)
    return {
        "pr_inside": (inside != NOT_APPLICABLE, inside == 1),
        "pr_a_given_inside": (within, within & aggregated),
        "pr_a_given_outside": (without, without & aggregated),
        "pr_a": (outcome < DECIDED, aggregated),
    }


def pooled_sums(outcome, inside):
    """{estimate: whole numbers (6, type, vertices)}: Σ S, Σ M, Σ S², Σ S M, Σ M², Σ [M > 0].

    S and M are a replicate's successes and trials over all displacements; sums are over
    replicates. Codes are (type, vertices, delta, replicate).
    """
    sums = {}
    for name, (trials, successes) in trials_of(outcome, inside).items():
        m = np.sum(trials, axis=2, dtype=np.int64)
        s = np.sum(successes, axis=2, dtype=np.int64)
        terms = (s, m, s * s, s * m, m * m, m > 0)
        sums[name] = np.stack([np.sum(term, axis=-1) for term in terms])
    return sums


def pooled_probabilities(sums):
    """The arrays of POOLED; NaN where there was no event."""
    table = {}
    for name, each in sums.items():
        share, effective = effective_number(*each.astype(float))
        with np.errstate(divide="ignore", invalid="ignore"):
            low, high = score_interval(share, effective)
        # At the ends the formula gives 0 and 1, but only up to rounding.
        low = np.where(share == 0.0, 0.0, low)
        high = np.where(share == 1.0, 1.0, high)
        table |= {name: share, f"{name}_low": low, f"{name}_high": high}
        table[f"n_effective_{name}"] = effective
    return table


def effective_number(s, m, ss, sm, mm, clusters):
    """(p, n): p = Σ S/Σ M, and the n at which p (1 − p)/n is the variance between replicates.

    No more than the trials there were; the number of replicates where all agree.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        p = s / m
        spread = np.maximum(ss - 2.0 * p * sm + p * p * mm, 0.0)
        variance = clusters / (clusters - 1.0) * spread / (m * m)
        number = np.minimum(p * (1.0 - p) / variance, m)
    number = np.where(np.isfinite(number) & (number > 0.0), number, clusters)
    return p, np.where(m > 0, number, np.nan)
