"""The numerical error of probabilities: what changes where a share of replicates is run again.

A replicate run again at a tighter tolerance has *flipped*, for one probability, if it is counted
otherwise: as a success, as a failure, or not at all. It has then raised the probability, *gained*,
or lowered it, *lost*. A share of second runs is run a third time, tighter still: an outcome may lie
on a plateau, the same at the first two tolerances and another one at the third.

Where all were run exactly, S of M would be S' of M'. What was run again is known: S' and M' by the
most exact run of each of these alone make the one part of the change. Of the others so many may
gain, and so many lose, as `flocsim.io.confidence.further_flips` says from what did of the same kind
(`io.results.events.KINDS`) between first and second runs; and of all that were not run a third
time, as it says from what changed between second and third ones. What these parts come to together
is said by `flips_together`. Each flip counts at most 1/M: the interval of the change goes from the
first part less what may be lost to the first part and what may be gained.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from flocsim.io.confidence import FurtherFlips, flips_together, further_flips
from flocsim.io.results.events import WITHOUT_OUTCOME, Events, events, events_of, kinds_of
from flocsim.io.results.schema import NOT_APPLICABLE, PROBABILITIES

EACH_SIDE = 0.975
"""Probability of each end of an interval."""

OF_KINDS, SHIFTED = "of kinds", "shifted"
"""Names of what is summed beside the counts of a results file, behind that of a probability; the
counts of kinds stand under KIND_COUNTS."""
KIND_COUNTS = "kinds"

Codes = Sequence[np.ndarray]
"""Outcome, inside and bond of runs as in the results file, (…, replicate); the outcome of what was
not run is NOT_APPLICABLE."""


def run_so(codes: Codes) -> np.ndarray:
    """Which replicates were run, flags."""
    return codes[0] != NOT_APPLICABLE


def most_exact(again: Codes, third: Codes) -> list[np.ndarray]:
    """The codes of third runs that say something of the outcome, of second runs elsewhere."""
    says = run_so(third) & ~np.isin(third[0], WITHOUT_OUTCOME)
    return [np.where(says, *pair) for pair in zip(third, again, strict=True)]


def gains_and_losses(before: Events, after: Events) -> tuple[np.ndarray, np.ndarray]:
    """Which replicates raise a probability, and which lower it, counted as ``after``: flags."""
    fails, fails_after = before.trials & ~before.successes, after.trials & ~after.successes
    return (
        (after.successes & ~before.successes) | (fails & ~after.trials),
        (before.successes & ~after.successes) | (~before.trials & fails_after),
    )


def kind_counts(kinds: np.ndarray, again: Codes, third: Codes) -> np.ndarray:
    """Whole numbers (…, kind, 4): how many of each kind there are, were run a second, and a third
    time, and were run again without an outcome; ``kinds`` as in kinds_of."""
    lost_sight = run_so(again) & np.isin(most_exact(again, third)[0], WITHOUT_OUTCOME)
    parts = True, run_so(again), run_so(third), lost_sight
    return np.stack(
        [np.stack([(kind & each).sum(axis=-1) for each in parts], axis=-1) for kind in kinds],
        axis=-2,
    )


def kind_changes(
    kinds: np.ndarray, runs: Sequence[Codes], counted: Sequence[tuple[np.ndarray, np.ndarray]]
) -> np.ndarray:
    """Whole numbers (…, kind, 4): how many of each kind gain and lose by the second run, and by the
    third one after it.

    ``runs``: second and third ones; ``counted``: gains_and_losses of each. A run without an outcome
    may have come to either.
    """
    flags = [
        (each | along(np.isin(codes[0], WITHOUT_OUTCOME), each)) & along(run_so(codes), each)
        for codes, sides in zip(runs, counted, strict=True) for each in sides
    ]  # fmt: skip
    return np.stack(
        [np.stack([(along(kind, each) & each).sum(axis=-1) for each in flags], axis=-1)
         for kind in kinds], axis=-2,
    )  # fmt: skip


def along(flags: np.ndarray, like: np.ndarray) -> np.ndarray:
    """Return flags (…, replicate), (…, 1, replicate) where those they go with are of each class."""
    return flags[..., np.newaxis, :] if like.ndim > flags.ndim else flags


def count_changes(
    first: Codes, again: Codes, third: Codes | None = None,
    of: Callable[..., dict[str, Events]] = events,
) -> dict[str, np.ndarray]:  # fmt: skip
    """Whole-number counts n_checked, n_flipped, n_third, n_third_flipped and those of CHANGES, over
    the last axis.

    ``first``, ``again``, ``third``: codes of first, second and third runs, none of the last by
    default; ``of`` gives the Events of codes. And what `change_intervals` follows from:
    KIND_COUNTS, see kind_counts; "pr_a of kinds" (…, kind, 4), see kind_changes; "pr_a shifted"
    (…, 2), by how much the most exact runs change trials and successes.
    """
    runs = again, (np.full_like(again[0], NOT_APPLICABLE),) * 3 if third is None else third
    exact, kinds = most_exact(*runs), kinds_of(first[0], first[2])
    checked, thrice = map(run_so, runs)
    differ = [(one[0] != other[0]) | (one[1] != other[1])
              for one, other in ((first, exact), runs)]  # fmt: skip
    flags = {"n_checked": checked, "n_flipped": checked & differ[0], "n_third": thrice,
             "n_third_flipped": thrice & differ[1]}  # fmt: skip
    known = checked & ~np.isin(exact[0], WITHOUT_OUTCOME) & kinds.any(axis=0)
    counts = {KIND_COUNTS: kind_counts(kinds, *runs)}
    tables = [of(*codes) for codes in (first, *runs, exact)]
    for name in tables[0]:
        before, second, last, after = (table[name] for table in tables)
        gained, lost = gains_and_losses(before, after)
        again_of, known_of = along(checked, gained), along(known, gained)
        flags |= {
            f"n_checked_{name}": again_of & (before.trials | after.trials),
            f"n_gained_{name}": again_of & gained, f"n_lost_{name}": again_of & lost,
        }  # fmt: skip
        shifts = [(known_of & now).sum(axis=-1) - (known_of & then).sum(axis=-1)
                  for now, then in zip(after[:2], before[:2], strict=True)]  # fmt: skip
        counts[f"{name} {SHIFTED}"] = np.stack(shifts, axis=-1)
        sides = gains_and_losses(before, second), gains_and_losses(second, last)
        counts[f"{name} {OF_KINDS}"] = kind_changes(kinds, runs, sides)
    return {name: np.sum(each, axis=-1) for name, each in flags.items()} | counts


def further(of_kinds: np.ndarray, counts: np.ndarray) -> list[np.ndarray]:
    """[how many more gain at most, and lose] of kind_changes and kind_counts (…).

    Without any third run second ones are taken for exact. NaN where no replicate was run again.
    """
    if of_kinds.ndim > counts.ndim:  # each class or bond by itself
        of_each = [further(of_kinds[..., k, :, :], counts) for k in range(of_kinds.shape[-3])]
        return [np.stack(side, axis=-1) for side in zip(*of_each, strict=True)]
    changed = np.moveaxis(of_kinds, (-1, -2), (0, 1))
    members, checked, thrice, lost_sight = np.moveaxis(counts, (-1, -2), (0, 1))
    found = []
    for side in range(2):
        parts = further_of_kinds(changed[side], checked, members - checked + lost_sight)
        if thrice.any():
            third = changed[2 + side], thrice, members - thrice
            parts.append(further_of_all(*(each.sum(axis=0) for each in third)))
        found.append(flips_together(parts, EACH_SIDE))
    return found


def change_intervals(
    counts: Mapping[str, np.ndarray], totals: Mapping[str, Events] | None = None
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """{probability: (low, high)}: 95 % interval of its change if all replicates were run exactly.

    ``counts`` of conditions (type, vertices, …), or sums over displacements: see count_changes;
    ``totals``: how many trials and successes there are, by default from the counts of a results
    file. NaN where there are no trials, or nothing was run again.
    """
    found = {}
    for name, (trials, successes, _) in (totals or events_of(counts)).items():
        gained, lost = further(counts[f"{name} {OF_KINDS}"], counts[KIND_COUNTS])
        more_trials, more_successes = np.moveaxis(counts[f"{name} {SHIFTED}"], -1, 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = successes / trials
            again = (successes + more_successes) / (trials + more_trials)
            change = np.where(trials + more_trials > 0, again - share, 0.0)
            low = np.maximum(change - lost / trials, -share)
            high = np.minimum(change + gained / trials, 1.0 - share)
        found[name] = np.where(trials > 0, low, np.nan), np.where(trials > 0, high, np.nan)
    return found


def further_of_kinds(
    flipped: np.ndarray, checked: np.ndarray, exposed: np.ndarray
) -> list[FurtherFlips]:
    """How many more flip of each kind: arrays (kind, type, vertices, …), whose rates are compared
    among the conditions of one N.

    Of a kind of which none was run again at this N all may flip; NaN where no replicate was.
    """
    together: list = [np.s_[:, n] for n in range(checked.shape[2])] if checked.ndim > 2 else [...]
    found = np.zeros((len(flipped), len(FurtherFlips._fields), *flipped.shape[1:]))
    for at in together:
        some = np.any(checked[(slice(None), *np.index_exp[at])])
        for kind in range(len(flipped)):
            f, c, u = (each[kind][at] for each in (flipped, checked, exposed))
            more = further_flips(f, c, u, EACH_SIDE)
            all_of_them = np.ceil(u), u, np.zeros(u.shape)
            found[(kind, slice(None), *np.index_exp[at])] = np.where(
                np.isnan(more.most) & some, all_of_them, more
            )
    return [FurtherFlips(*each) for each in found]


def further_of_all(flipped: np.ndarray, checked: np.ndarray, exposed: np.ndarray) -> FurtherFlips:
    """How many more flip of third runs, which are few: rates are compared among all conditions,
    and with SEEN_BEFORE."""
    f, c, u = (
        np.append(each.ravel(), before)
        for each, before in zip((flipped, checked, exposed), SEEN_BEFORE, strict=True)
    )
    more = further_flips(f, c, u, EACH_SIDE)
    return FurtherFlips(*(each[: flipped.size].reshape(flipped.shape) for each in more))


SEEN_BEFORE = [0, 1], [250, 250], [0, 0]
"""How many third runs ended otherwise than second ones, of how many, where that was looked at
(benchmarks.accuracy.numerical_error), as in two conditions, of which none is left: without them a
study of one condition, of which a few replicates are run a third time, would know next to nothing
of this."""


def numerical_of(
    intervals: Mapping[str, tuple[np.ndarray, np.ndarray]],
) -> dict[str, np.ndarray]:
    """{"pr_…_numerical": array} of every probability: the larger side of its change_intervals."""
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
