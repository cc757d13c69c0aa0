"""From the outcomes of single collisions to counts, probabilities and their intervals."""

import numpy as np

from flocsim.errors import UsageError
from flocsim.io.confidence import proportion, wilson
from flocsim.io.results.file import CLASSES, NOT_APPLICABLE, OUTCOMES

__all__ = ["probabilities", "tabulate", "wilson"]

MISSED = OUTCOMES.index("missed")
UNDECIDED = OUTCOMES.index("undecided")
FAILED = OUTCOMES.index("failed")


def tabulate(outcome, inside):
    """Counts and probabilities of every condition, over the last axis of the arrays.

    ``outcome``, ``inside``: codes as in the results file, (…, replicate), in practice
    (type, vertices, delta, replicate). Returns a dict of arrays (…), and (…, 4) for the classes
    A–D: the counts ``n_*`` (see `count`) and the probabilities of `probabilities`.
    Raises UsageError for unknown codes, and where outcome and inside contradict each other.
    """
    outcome, inside = checked_codes(outcome, inside)
    counts = count(outcome, inside)
    return counts | probabilities(counts)


def count(outcome, inside):
    """Whole-number counts over the last axis.

    n_total = n_missed + n_undecided + n_failed + Σ n_class. n_collided counts every replicate
    whose outlines touched, whatever came later: a collision that ended undecided or failed still
    happened inside or outside the zone, and is in n_collided and n_inside.
    """
    classes = [np.sum(outcome == code, axis=-1) for code in range(len(CLASSES))]
    return {
        "n_total": np.sum(np.ones(outcome.shape, dtype=np.int64), axis=-1),
        "n_missed": np.sum(outcome == MISSED, axis=-1),
        "n_undecided": np.sum(outcome == UNDECIDED, axis=-1),
        "n_failed": np.sum(outcome == FAILED, axis=-1),
        "n_collided": np.sum(inside != NOT_APPLICABLE, axis=-1),
        "n_inside": np.sum(inside == 1, axis=-1),
        "n_class": np.stack(classes, axis=-1),
    }


def probabilities(counts):
    """Probabilities with Wilson 95 % intervals (``_low``, ``_high``) from counts, also pooled ones.

    pr_inside = n_inside / n_collided: where the outlines first touched is known for every one.
    pr_a_given_inside = A/(A+B), pr_a_given_outside = C/(C+D), pr_a = (A+C)/(A+B+C+D) and
    pr_class = (A, B, C, D)/(A+B+C+D): over decided collisions, as an undecided or failed one has
    no class. NaN where the denominator is 0. pr_inside equals A + B of pr_class, the paper's
    identity, exactly when every collision was decided.
    """
    a, b, c, d = np.moveaxis(np.asarray(counts["n_class"]), -1, 0)
    decided = a + b + c + d
    estimates = {
        "pr_inside": (counts["n_inside"], counts["n_collided"]),
        "pr_a_given_inside": (a, a + b),
        "pr_a_given_outside": (c, c + d),
        "pr_a": (a + c, decided),
        "pr_class": (counts["n_class"], decided[..., np.newaxis]),
    }
    table = {}
    for name, (successes, trials) in estimates.items():
        values = proportion(successes, trials)
        table |= zip((name, f"{name}_low", f"{name}_high"), values, strict=True)
    return table


def checked_codes(outcome, inside):
    """Both arrays, after a check that every replicate's outcome and inside agree."""
    outcome, inside = np.asarray(outcome), np.asarray(inside)
    if outcome.shape != inside.shape or outcome.ndim == 0:
        raise UsageError(
            f"outcome and inside must have one shape, found {outcome.shape} and {inside.shape}"
        )
    touched_inside = (inside == 1) & np.isin(outcome, [0, 1, UNDECIDED, FAILED])
    touched_outside = (inside == 0) & np.isin(outcome, [2, 3, UNDECIDED, FAILED])
    apart = (inside == NOT_APPLICABLE) & np.isin(outcome, [MISSED, UNDECIDED, FAILED])
    wrong = np.argwhere(~(touched_inside | touched_outside | apart))
    if len(wrong):
        place = tuple(int(number) for number in wrong[0])
        raise UsageError(
            f"outcome {outcome[place]} with inside {inside[place]} at {place} is impossible "
            f"({len(wrong)} such replicates): check how the outcomes were recorded"
        )
    return outcome, inside
