"""The numerical error of probabilities: what changes where a share of replicates is run again.

A replicate run again at a tighter tolerance has *flipped*, for one probability, if it is counted
otherwise: as a success, as a failure, or not at all. It has then raised the probability, *gained*,
or lowered it, *lost*. With S of M counted, and what is counted again S' of M',
|S'/M' − S/M| ≤ flips/M, so that the share of flips bounds what numerics do to the probability.
"""

from collections.abc import Mapping

import numpy as np

from flocsim.ensembles.estimates.events import INSIDE_CLASSES, OUTSIDE_CLASSES, events
from flocsim.io.confidence import numerical_error
from flocsim.io.results.schema import NOT_APPLICABLE


def count_changes(
    outcome: np.ndarray, inside: np.ndarray, checked_outcome: np.ndarray, checked_inside: np.ndarray
) -> dict[str, np.ndarray]:
    """Whole-number counts n_checked, n_flipped, and those of CHANGES, over the last axis.

    Codes as in the results file, (…, replicate); what was not run again is NOT_APPLICABLE in
    ``checked_outcome``. Those of classes have the class as last axis.
    """
    checked = checked_outcome != NOT_APPLICABLE
    flipped = checked & ((outcome != checked_outcome) | (inside != checked_inside))
    counts = {"n_checked": np.sum(checked, axis=-1), "n_flipped": np.sum(flipped, axis=-1)}
    first, second = events(outcome, inside), events(checked_outcome, checked_inside)
    for name, (trial, success) in first.items():
        trial_again, success_again = second[name]
        gained = (success_again & ~success) | (trial & ~success & ~trial_again)
        lost = (success & ~success_again) | (~trial & trial_again & ~success_again)
        for kind, flags in (
            ("checked", trial | trial_again), ("gained", gained), ("lost", lost)
        ):  # fmt: skip
            total = np.sum(checked & flags, axis=-1)
            counts[f"n_{kind}_{name}"] = np.moveaxis(total, 0, -1) if "class" in name else total
    return counts


def trials_of(counts: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """{probability: trials in the first runs} from the counts of conditions."""
    classes = np.asarray(counts["n_class"])
    decided = classes.sum(axis=-1)
    return {
        "pr_inside": np.asarray(counts["n_collided"]),
        "pr_a_given_inside": classes[..., list(INSIDE_CLASSES)].sum(axis=-1),
        "pr_a_given_outside": classes[..., list(OUTSIDE_CLASSES)].sum(axis=-1),
        "pr_a": decided,
        "pr_class": np.broadcast_to(decided[..., np.newaxis], classes.shape),
    }


def numerical_errors(counts: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """{"pr_…_numerical": array} of every probability, from counts (type, …), of classes (…, 4).

    `flocsim.io.confidence.numerical_error` says how. Counts may be sums over conditions.
    """
    found = {}
    for name, trials in trials_of(counts).items():
        checked = counts[f"n_checked_{name}"]
        flipped = counts[f"n_gained_{name}"] + counts[f"n_lost_{name}"]
        arrays = (flipped, checked, trials)
        if "class" in name:
            parts = zip(*(np.moveaxis(each, -1, 0) for each in arrays), strict=True)
            found[f"{name}_numerical"] = np.stack([numerical_error(*p) for p in parts], axis=-1)
        else:
            found[f"{name}_numerical"] = numerical_error(*arrays)
    return found
