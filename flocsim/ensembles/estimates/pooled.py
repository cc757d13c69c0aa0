"""Probabilities over all displacements together.

A replicate has the same orientations at every displacement, so that its collisions are not
independent: the interval is Wilson's at the number of independent events which the spread between
replicates shows (a ratio of cluster totals; W. G. Cochran, Sampling Techniques, 1977, ch. 6).
"""

import numpy as np

from flocsim.ensembles.estimates.paired import AGGREGATED, DECIDED
from flocsim.io.confidence import clustered_proportion
from flocsim.io.results.schema import NOT_APPLICABLE

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
        share, low, high, effective = clustered_proportion(*each.astype(float))
        table |= {name: share, f"{name}_low": low, f"{name}_high": high}
        table[f"n_effective_{name}"] = effective
    return table
