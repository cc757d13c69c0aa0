"""Differences between conditions from the same replicates: common random numbers, used.

Replicate k has the same orientations (and flocs) in all conditions, so that what it does in two of
them is correlated, and the difference is known better than from independent samples.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from flocsim.ensembles.estimates.numerical import (
    Codes,
    further,
    kind_changes,
    kind_counts,
    most_exact,
    run_so,
)
from flocsim.io.confidence import scrambled_difference, wilson
from flocsim.io.results.events import WITHOUT_OUTCOME, Events, events, kinds_of
from flocsim.io.results.schema import AXES, NOT_APPLICABLE


def of_each_scramble(first: int, scrambles: int) -> list[slice]:
    """Where the replicates of every scramble stand among those from the ``first`` on."""
    return [slice((s - first) % scrambles, None, scrambles) for s in range(scrambles)]


def sums_of_scrambles(flags: np.ndarray, first: int, scrambles: int) -> np.ndarray:
    """Whole numbers (…, scramble): how many flags (…, replicate) are set in each scramble."""
    parts = [flags[..., part].sum(axis=-1, dtype=np.int64)
             for part in of_each_scramble(first, scrambles)]  # fmt: skip
    return np.stack(parts, axis=-1)


def joint_counts(
    outcome: np.ndarray, inside: np.ndarray, first: int = 0, scrambles: int = 0
) -> np.ndarray:
    """How often an event happens in both, here only, there only, in neither.

    ``outcome``, ``inside``: codes (type, vertices, delta, replicate) of replicates from the
    ``first`` on, points of ``scrambles``, 0 for independent ones. Returns whole numbers (bound,
    against, event, type, vertices, delta, 4) of `bounded_cells`: each condition and the first along
    each axis, over the replicates that count in both; those of each scramble by themselves, along
    the last axis but one.
    """
    if scrambles:
        parts = of_each_scramble(first, scrambles)
        return np.stack([joint_counts(outcome[..., p], inside[..., p]) for p in parts], axis=-2)
    # The two events (2, …): a collision is inside; it aggregates.
    of_all = events(outcome, inside, np.full_like(outcome, NOT_APPLICABLE))
    here = Events(
        *(np.stack(each) for each in zip(of_all["pr_inside"], of_all["pr_a"], strict=True))
    )
    tables = []
    for axis in range(1, 1 + len(AXES)):
        there = Events(*(np.take(each, [0], axis) for each in here))
        tables.append(bounded_cells(here, there, np.arange(outcome.shape[axis - 1]) == 0, axis))
    return np.stack(tables, axis=1)


def bounded_cells(
    here: Events, there: Events, itself: np.ndarray | None = None, axis: int = 0
) -> np.ndarray:
    """Whole numbers (3, …, 4) of replicates, the last axis of the flags: in both, here only, there
    only, in neither.

    First over those that count both times; then with the unknown ones, none of which is a success
    here, all of them there; then the other way round. ``itself``: flags along an ``axis``, where
    here and there are one condition, and what is unknown is so in both.
    """
    same = np.zeros(1, dtype=bool) if itself is None else itself
    same = same.reshape(tuple(len(same) if k == axis else 1 for k in range(here.trials.ndim)))
    known = here.trials & there.trials
    may = (here.trials | here.unknown) & (there.trials | there.unknown) & ~same
    found = []
    for counted, mine, yours in (
        (known, here.successes, there.successes),
        (known | may, here.successes & ~here.unknown, there.successes | there.unknown),
        (known | may, here.successes | here.unknown, there.successes & ~there.unknown),
    ):
        cells = (mine & yours, mine & ~yours, ~mine & yours, ~mine & ~yours)
        found.append(np.stack([np.sum(counted & cell, axis=-1) for cell in cells], axis=-1))
    return np.stack(found)


def paired_differences(joint: np.ndarray, scrambled: bool = False) -> dict[str, np.ndarray]:
    """The arrays of DIFFERENCES from joint_counts; NaN where no replicate counts."""
    joint = np.asarray(joint)
    difference, low, high = bounded_difference(joint, scrambled)
    return {
        "n_pairs": joint[0].sum(axis=(-1, -2) if scrambled else -1),
        "difference": difference,
        "difference_low": low,
        "difference_high": high,
    }


def bounded_difference(
    joint: np.ndarray, scrambled: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(difference, low, high) of bounded_cells: whatever the unknown replicates would have come to
    is in the interval. ``scrambled``: the last axis but one is that of scrambles."""
    known, least, most = (
        scrambled_difference(each) if scrambled else newcombe(*np.moveaxis(each, -1, 0))
        for each in joint
    )
    return known[0], least[1], most[2]


def change_of_differences(
    first: Sequence[Codes], second: Sequence[Codes], of: Callable[..., dict[str, Events]]
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """{probability: (low, high)}: 95 % interval of by how much its difference, second minus first,
    would change if both studies were run exactly, over the replicates that count in both.

    ``first``, ``second``: codes of first, second and third runs of the same replicates in two
    studies, (type, vertices, delta, replicate); ``of`` gives Events, not of classes. What was run
    again in both counts, where it changes the one otherwise than the other: what errs alike is no
    error of the difference. A replicate is of the kind of the two that flips more easily.
    """
    runs = [joint_outcome(*pair) for pair in zip(first, second, strict=True)]
    easily, surely = ([kinds_of(codes[0][0], codes[0][2])[k] for codes in (first, second)]
                      for k in (0, 1))  # fmt: skip
    decided = ~np.isin(runs[0][0], WITHOUT_OUTCOME)
    kinds = np.stack([easily[0] | easily[1], surely[0] & surely[1]]) & decided
    kinds = np.concatenate([kinds, (decided & ~kinds.any(axis=0))[np.newaxis]])
    exact = [most_exact(*codes[1:]) for codes in (first, second)]
    known = run_so(runs[1]) & ~np.isin(joint_outcome(*exact)[0], WITHOUT_OUTCOME) & decided
    moved = [[np.where(known, *pair) for pair in zip(now, codes[0], strict=True)]
             for now, codes in zip(exact, (first, second), strict=True)]  # fmt: skip
    tables = [[of(*codes) for codes in pair]
              for pair in (*zip(first, second, strict=True), moved)]  # fmt: skip
    counts = kind_counts(kinds, *runs[1:])
    found = {}
    for name in tables[0][0]:
        steps = [differences(*(table[name] for table in pair)) for pair in tables]
        sides = [(after[0] > before[0], after[0] < before[0])
                 for before, after in pairwise(steps[:3])]  # fmt: skip
        gained, lost = further(kind_changes(kinds, runs[1:], sides), counts)
        with np.errstate(divide="ignore", invalid="ignore"):
            value, exactly = (each.sum(axis=-1) / both.sum(axis=-1)
                              for each, both in (steps[0], steps[3]))  # fmt: skip
            trials = steps[0][1].sum(axis=-1)
            change = np.where(np.isnan(exactly), 0.0, exactly - value)
            low = np.maximum(change - lost / trials, -1.0 - value)
            high = np.minimum(change + gained / trials, 1.0 - value)
        found[name] = low, high
    return found


def joint_outcome(one: Codes, other: Codes) -> Codes:
    """Codes of which the first, alone of meaning, says whether both were run so, and both came to
    an outcome."""
    unknown = [np.isin(codes[0], WITHOUT_OUTCOME) for codes in (one, other)]
    outcome = np.where(unknown[0] | unknown[1], WITHOUT_OUTCOME[0], 0)
    return (np.where(run_so(one) & run_so(other), outcome, NOT_APPLICABLE),)


def differences(one: Events, other: Events) -> tuple[np.ndarray, np.ndarray]:
    """(by how much a replicate counts more in the other, whether it counts in both)."""
    both = one.trials & other.trials
    return both * (other.successes.astype("i1") - one.successes), both


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
