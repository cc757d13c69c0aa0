"""The numerical error of probabilities: what changes where a share of replicates is run again.

A replicate run again at a tighter tolerance has *flipped*, for one probability, if it is counted
otherwise: as a success, as a failure, or not at all. It has then raised the probability, *gained*,
or lowered it, *lost*. With S of M counted, and what is counted again S' of M',
|S'/M' − S/M| ≤ flips/M, so that the share of flips bounds what numerics do to the probability.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from flocsim.io.confidence import numerical_error
from flocsim.io.results.events import events, events_of
from flocsim.io.results.schema import NOT_APPLICABLE, last_axis


def count_changes(
    first: Sequence[np.ndarray], again: Sequence[np.ndarray]
) -> dict[str, np.ndarray]:
    """Whole-number counts n_checked, n_flipped, and those of CHANGES, over the last axis.

    ``first``, ``again``: outcome, inside and bond of first and second runs, codes as in the results
    file, (…, replicate); what was not run again has NOT_APPLICABLE for an outcome.
    """
    checked = again[0] != NOT_APPLICABLE
    flipped = checked & ((first[0] != again[0]) | (first[1] != again[1]))
    counts = {"n_checked": np.sum(checked, axis=-1), "n_flipped": np.sum(flipped, axis=-1)}
    second = events(*again)
    for name, (trial, success, _) in events(*first).items():
        trial_again, success_again, _ = second[name]
        gained = (success_again & ~success) | (trial & ~success & ~trial_again)
        lost = (success & ~success_again) | (~trial & trial_again & ~success_again)
        for kind, flags in (
            ("checked", trial | trial_again), ("gained", gained), ("lost", lost)
        ):  # fmt: skip
            total = np.sum(checked & flags, axis=-1)
            last = last_axis(name)
            counts[f"n_{kind}_{name}"] = np.moveaxis(total, 0, -1) if last else total
    return counts


def numerical_errors(counts: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """{"pr_…_numerical": array} of every probability, from counts (type, …).

    `flocsim.io.confidence.numerical_error` says how. Counts may be sums over conditions.
    """
    found = {}
    for name, (trials, _, _) in events_of(counts).items():
        checked = counts[f"n_checked_{name}"]
        flipped = counts[f"n_gained_{name}"] + counts[f"n_lost_{name}"]
        arrays = (flipped, checked, trials)
        if last_axis(name):
            parts = zip(*(np.moveaxis(each, -1, 0) for each in arrays), strict=True)
            found[f"{name}_numerical"] = np.stack([numerical_error(*p) for p in parts], axis=-1)
        else:
            found[f"{name}_numerical"] = numerical_error(*arrays)
    return found
