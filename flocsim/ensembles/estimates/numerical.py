"""The numerical error of probabilities: what changes where a share of replicates is run again.

A replicate run again at a tighter tolerance has *flipped*, for one probability, if it is counted
otherwise: as a success, as a failure, or not at all. It has then raised the probability, *gained*,
or lowered it, *lost*.

Where all were run exactly, S of M would be S' of M'. What was run again is known: S' and M' with
these alone make the one part of the change. Of the others, and of the second runs, which are not
exact either, so many may gain, and so many lose, as `flocsim.io.confidence.further_flips` says from
what did of the same kind (`io.results.events.KINDS`), at most 1/M each: the interval of the change
goes from the first part less what may be lost to the first part and what may be gained.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from flocsim.ensembles.collision.checking import TIGHTER
from flocsim.io.confidence import further_flips
from flocsim.io.results.events import WITHOUT_OUTCOME, events, events_of, kinds_of
from flocsim.io.results.schema import NOT_APPLICABLE, PROBABILITIES, last_axis

SECOND_RUNS = TIGHTER**0.5
"""Flips of a second run, run more exactly still, over those of a first: the rate of flips falls
with about the root of the tolerance (`pilot/model.py`; benchmarks.accuracy.numerical_error)."""

EACH_SIDE = 0.975
"""Probability of each end of an interval."""

OF_KINDS, SHIFTED = "of kinds", "shifted"
"""Names of what is summed beside the counts of a results file, behind that of a probability; the
counts of kinds stand under KIND_COUNTS."""
KIND_COUNTS = "kinds"


def count_changes(
    first: Sequence[np.ndarray], again: Sequence[np.ndarray]
) -> dict[str, np.ndarray]:
    """Whole-number counts n_checked, n_flipped, and those of CHANGES, over the last axis.

    ``first``, ``again``: outcome, inside and bond of first and second runs, codes as in the results
    file, (…, replicate); what was not run again has NOT_APPLICABLE for an outcome. And what
    `change_intervals` follows from: KIND_COUNTS (kind, 2, …), of how many so many were run again;
    "pr_a of kinds" (kind, 2, …), how many of these gained and lost; "pr_a shifted" (2, …), by how
    much trials and successes changed.
    """
    checked = again[0] != NOT_APPLICABLE
    flipped = checked & ((first[0] != again[0]) | (first[1] != again[1]))
    counts = {"n_checked": np.sum(checked, axis=-1), "n_flipped": np.sum(flipped, axis=-1)}
    kinds = kinds_of(first[0], first[2])
    lost_sight = checked & np.isin(again[0], WITHOUT_OUTCOME)
    counts[KIND_COUNTS] = np.stack([kinds.sum(axis=-1), (kinds & checked).sum(axis=-1)], axis=1)
    second = events(*again)
    for name, (trial, success, _) in events(*first).items():
        trial_again, success_again, _ = second[name]
        gained = checked & ((success_again & ~success) | (trial & ~success & ~trial_again))
        lost = checked & ((success & ~success_again) | (~trial & trial_again & ~success_again))
        last = bool(last_axis(name))

        def total(flags: np.ndarray, last: bool = last) -> np.ndarray:
            found = np.asarray(np.sum(flags, axis=-1, dtype=np.int64))
            return np.moveaxis(found, 0, -1) if last else found

        flags = {"checked": checked & (trial | trial_again), "gained": gained, "lost": lost}
        counts |= {f"n_{kind}_{name}": total(each) for kind, each in flags.items()}
        # A second run without an outcome may have come to anything.
        known = checked & ~lost_sight & kinds.any(axis=0)
        counts[f"{name} {SHIFTED}"] = np.stack([
            total((known & trial_again).astype("i8") - (known & trial)),
            total((known & success_again).astype("i8") - (known & success)),
        ])  # fmt: skip
        counts[f"{name} {OF_KINDS}"] = np.stack([
            np.stack([total(kind & (each | lost_sight)) for each in (gained, lost)])
            for kind in kinds
        ])  # fmt: skip
    return counts


def change_intervals(
    counts: Mapping[str, np.ndarray],
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """{probability: (low, high)}: 95 % interval of its change if all replicates were run exactly.

    ``counts`` of conditions (type, vertices, …), or sums over displacements: see count_changes.
    NaN where there are no trials, or nothing was run again.
    """
    found = {}
    members, checked = np.moveaxis(counts[KIND_COUNTS], 1, 0)
    exposed = members - (1.0 - SECOND_RUNS) * checked
    for name, (trials, successes, _) in events_of(counts).items():
        kinds, shifted = counts[f"{name} {OF_KINDS}"], counts[f"{name} {SHIFTED}"]
        gained, lost = (further_of_kinds(kinds[:, side], checked, exposed) for side in (0, 1))
        with np.errstate(divide="ignore", invalid="ignore"):
            share = successes / trials
            again = (successes + shifted[1]) / (trials + shifted[0])
            change = np.where(trials + shifted[0] > 0, again - share, 0.0)
            low = np.maximum(change - lost / trials, -share)
            high = np.minimum(change + gained / trials, 1.0 - share)
        found[name] = np.where(trials > 0, low, np.nan), np.where(trials > 0, high, np.nan)
    return found


def leading_axes(name: str) -> int:
    """How many axes an array of count_changes has before those of the conditions."""
    if name == KIND_COUNTS or name.endswith(OF_KINDS):
        return 2
    return 1 if name.endswith(SHIFTED) else 0


def over_displacements(counts: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Sums over delta of counts of conditions (type, vertices, delta)."""
    return {name: values.sum(axis=leading_axes(name) + 2) for name, values in counts.items()}


def further_of_kinds(flipped: np.ndarray, checked: np.ndarray, exposed: np.ndarray) -> np.ndarray:
    """How many more flip at most, of all kinds together: arrays (kind, type, vertices, …), whose
    rates are compared among the conditions of one N, those of each class by themselves.

    Of a kind of which none was run again at this N all may flip; NaN where no replicate was.
    """
    if flipped.ndim > checked.ndim:
        each = [further_of_kinds(flipped[..., k], checked, exposed)
                for k in range(flipped.shape[-1])]  # fmt: skip
        return np.stack(each, axis=-1)
    total = np.zeros(flipped.shape[1:])
    together: list = [...]
    if total.ndim > 1:
        together = [np.s_[:, n] for n in range(len(total[0]))]
    for kind in range(len(flipped)):
        for at in together:
            more = further_flips(flipped[kind][at], checked[kind][at], exposed[kind][at], EACH_SIDE)
            some = np.any(checked[(slice(None), *np.index_exp[at])])
            total[at] += np.where(np.isnan(more) & some, np.ceil(exposed[kind][at]), more)
    return total


def share_that_flips(
    flipped: np.ndarray, checked: np.ndarray, kinds: np.ndarray, trials: np.ndarray
) -> np.ndarray:
    """95 % bound of the flips over ``trials`` of conditions (type, vertices, …), at most 1.

    ``flipped`` and ``checked`` flags of replicates (…, replicate), ``kinds`` those of kinds_of.
    """
    f, c = ((kinds & flags).sum(axis=-1) for flags in (flipped, checked))
    more = further_of_kinds(f, c, kinds.sum(axis=-1) - (1.0 - SECOND_RUNS) * c)
    with np.errstate(divide="ignore", invalid="ignore"):
        bound = np.minimum((f.sum(axis=0) + more) / trials, 1.0)
    return np.where(trials > 0, bound, np.nan)


def numerical_errors(counts: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """{"pr_…_numerical": array} of every probability: the larger side of its change."""
    return numerical_of(change_intervals(counts))


def numerical_of(
    intervals: Mapping[str, tuple[np.ndarray, np.ndarray]],
) -> dict[str, np.ndarray]:
    """The same from change_intervals."""
    return {
        f"{name}_numerical": np.maximum(np.abs(low), np.abs(high))
        for name, (low, high) in intervals.items()
    }


def change_columns(
    intervals: Mapping[str, tuple[np.ndarray, np.ndarray]],
) -> dict[str, np.ndarray]:
    """The arrays of NUMERICS."""
    return {
        f"{name}_change{end}": intervals[name][side]
        for name in PROBABILITIES for side, end in enumerate(("_low", "_high"))
    }  # fmt: skip
