"""From the outcomes of single collisions to counts, probabilities and their intervals.

Of single conditions, and pooled over all displacements. There a replicate has the same orientations
at every displacement, so that its collisions are not independent: the interval is Wilson's at the
number of independent events which the spread between replicates shows (a ratio of cluster totals;
W. G. Cochran, Sampling Techniques, 1977, ch. 6). And the rule that ends a study early, once these
are narrow enough, where the config asks for one.

Then differences between conditions from the same replicates: replicate k has the same orientations
(and flocs) in all of them, so that what it does in two is correlated, and the difference is known
better than from independent samples.
"""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from flocsim.ensembles.config.schema import StopConfig
from flocsim.ensembles.kind import StudyKind
from flocsim.ensembles.storage.row_store import RowStore
from flocsim.io import confidence
from flocsim.io.confidence import cluster_sums, ratio_and_variance, student_quantile, wilson
from flocsim.io.results import schema
from flocsim.io.results.events import (
    HELD,
    MISSED,
    UNDECIDED,
    Events,
    events,
    events_of,
)
from flocsim.io.results.schema import AXES, FURTHER_RUNS, NOT_APPLICABLE

CODES = ("outcome", "inside", "bond")
"""The columns of first runs that are counted."""

COUNTED = tuple(f"{run}{name}" for run in ("", *(f"{each}_" for each in FURTHER_RUNS))
                for name in CODES)  # fmt: skip
"""All columns that are counted: of first runs, of those run again, a third time, and with outlines
cut otherwise."""

EXACT_RUNS = COUNTED[: 3 * len(CODES)]
"""The columns of the first, second and third runs, with outlines as they were cut."""


def by_runs(columns: Sequence[np.ndarray]) -> list[Sequence[np.ndarray]]:
    """Return CODES of each run, from columns in the order of COUNTED, all of them or the first
    ones."""
    return [columns[k : k + len(CODES)] for k in range(0, len(columns), len(CODES))]


def count(outcome: np.ndarray, inside: np.ndarray, bond: np.ndarray) -> dict[str, np.ndarray]:
    """Return whole-number counts over the last axis.

    n_total = n_missed + n_held + n_undecided + n_failed + Σ n_class. n_collided counts every
    replicate whose outlines touched, whatever came later: a collision that ended undecided or
    failed still happened inside or outside the zone, and is in n_collided and n_inside. Σ n_bond is
    the number of aggregated ones, A + C.
    """
    classes = [np.sum(outcome == code, axis=-1) for code in range(len(schema.CLASSES))]
    bonds = [np.sum(bond == 1 + place, axis=-1) for place in range(len(schema.BONDS))]
    return {
        "n_total": np.sum(np.ones(outcome.shape, dtype=np.int64), axis=-1),
        "n_missed": np.sum(outcome == MISSED, axis=-1),
        "n_held": np.sum(outcome == HELD, axis=-1),
        "n_undecided": np.sum(outcome == UNDECIDED, axis=-1),
        "n_failed": np.sum(outcome == schema.FAILED, axis=-1),
        "n_collided": np.sum(inside != schema.NOT_APPLICABLE, axis=-1),
        "n_inside": np.sum(inside == 1, axis=-1),
        "n_class": np.stack(classes, axis=-1),
        "n_bond": np.stack(bonds, axis=-1),
    }


def probabilities(counts: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return probabilities with 95 % intervals (``_low``, ``_high``) from counts, also pooled ones.

    Wilson's, from the low end for none to the high end for all of those that are undecided or have
    failed (`flocsim.io.confidence.proportion`).

    pr_inside = n_inside / n_collided: where the outlines first touched is known for every one.
    pr_a_given_inside = A/(A+B), pr_a_given_outside = C/(C+D), pr_a = (A+C)/(A+B+C+D) and
    pr_class = (A, B, C, D)/(A+B+C+D): over decided collisions, as an undecided or failed one has
    no class. pr_a = pr_sticks + pr_hangs, by their bonds: a hook hangs, the others stick; pr_bond =
    n_bond/(A+C). NaN where the denominator is 0. pr_inside equals A + B of pr_class, the paper's
    identity, exactly when every collision was decided.
    """
    table: dict[str, np.ndarray] = {}
    for name, (trials, successes, unknown) in events_of(counts).items():
        values = confidence.proportion(successes, trials, unknown=unknown)
        table |= zip((name, f"{name}_low", f"{name}_high"), values, strict=True)
    return table


def pooled_sums(outcome: np.ndarray, inside: np.ndarray, bond: np.ndarray) -> dict[str, np.ndarray]:
    """Return {estimate: bounded_sums (3, 6, type, vertices)}: a replicate over all displacements is
    a cluster. Codes are (type, vertices, delta, replicate)."""
    sums, counted = {}, events(outcome, inside, bond)
    for name in schema.POOLED_PROBABILITIES:
        each = Events(*(flags.sum(axis=2, dtype=np.int64) for flags in counted[name]))
        sums[name] = confidence.bounded_sums(each.successes, each.trials, each.unknown)
    return sums


def clustered_probabilities(
    sums: Mapping[str, np.ndarray], scrambles: int = 0
) -> dict[str, np.ndarray]:
    """Return probabilities, the ends of their intervals and n_effective_… of clusters; NaN where
    there was no event.

    ``sums``: those of pooled_sums, or of scrambled_sums where clusters are ``scrambles``.
    """
    table: dict[str, np.ndarray] = {}
    for name, each in sums.items():
        if scrambles:
            trials, successes, unknown = each
            each = confidence.bounded_sums(successes, trials, unknown)
        names = name, f"{name}_low", f"{name}_high", f"n_effective_{name}"
        table |= zip(names, confidence.clustered_proportion(each, scrambles), strict=True)
    return table


def scrambled_sums(
    codes: Sequence[np.ndarray], first: int, scrambles: int
) -> dict[str, np.ndarray]:
    """Return {probability: whole numbers (3, type, …, scramble)} of trials, successes and unknown.

    ``codes``: outcome, inside, bond of replicates from the ``first`` on, replicate k of scramble k
    mod ``scrambles``; nothing for none.
    """
    if not scrambles:
        return {}
    return {
        name: sums_of_scrambles(np.stack(each), first, scrambles)
        for name, each in events(*codes).items()
    }


GROWTH = 1.25
"""Each look is at so many times the replicates of the one before."""


def borders(stop: StopConfig, replicates: int) -> list[int]:
    """Return the numbers of replicates at which the rule looks; the last is ``replicates``."""
    # Geometric, so that few looks are wasted, and each has new replicates enough to differ.
    looks = []
    look = stop.least
    while stop.half_width is not None and look < replicates:
        looks.append(look)
        look = math.ceil(GROWTH * look)
    return [*looks, replicates]


def stop_rule(study: StudyKind, store: RowStore) -> Callable[[int], bool]:
    """Return the rule that may end a study: whether so many replicates of each condition, all of
    which exist, are enough."""
    stop: StopConfig = study.config.stop
    wanted = stop.half_width
    if wanted is None:
        return lambda replicates: False

    def is_narrow(place: int, replicates: int) -> bool:
        rows = store.rows(place, 0, replicates)
        table = probabilities(count(*(rows[name] for name in CODES)))
        widths = [table[f"{name}_high"] - table[f"{name}_low"] for name in stop.of]
        return not np.any(0.5 * np.array(widths) > wanted)

    places = range(len(store.conditions))
    return lambda replicates: all(is_narrow(place, replicates) for place in places)


def of_each_scramble(first: int, scrambles: int) -> list[slice]:
    """Return where the replicates of every scramble stand among those from the ``first`` on."""
    return [slice((s - first) % scrambles, None, scrambles) for s in range(scrambles)]


def sums_of_scrambles(flags: np.ndarray, first: int, scrambles: int) -> np.ndarray:
    """Return whole numbers (…, scramble): how many flags (…, replicate) are set in each
    scramble."""
    parts = [flags[..., part].sum(axis=-1, dtype=np.int64)
             for part in of_each_scramble(first, scrambles)]  # fmt: skip
    return np.stack(parts, axis=-1)


def joint_counts(
    outcome: np.ndarray, inside: np.ndarray, first: int = 0, scrambles: int = 0
) -> np.ndarray:
    """Return how often an event happens in both, here only, there only, in neither.

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
    """Return whole numbers (3, …, 4) of replicates, the last axis of the flags: in both, here only,
    there only, in neither.

    First over those that count both times; then with the unknown ones, none of which is a success
    here, all of them there; then the other way round. ``itself``: flags along an ``axis``, where
    here and there are one condition, and what is unknown is so in both.
    """
    # Against itself nothing is unknown: whatever it comes to, it comes to it both times.
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
    """Return the arrays of DIFFERENCES from joint_counts; NaN where no replicate counts."""
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
    """Return (difference, low, high) of bounded_cells: whatever the unknown replicates would have
    come to is in the interval. ``scrambled``: the last axis but one is that of scrambles."""
    known, least, most = (
        scrambled_difference(each) if scrambled else newcombe(*np.moveaxis(each, -1, 0))
        for each in joint
    )
    return known[0], least[1], most[2]


def scrambled_difference(cells: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (difference, low, high) of two paired proportions, here minus there, over independent
    scrambles.

    ``cells``: whole numbers (…, scramble, 4) of replicates in both, here only, there only, in
    neither. D = Σ d/Σ m, d the difference of a scramble's two counts and m its replicates; the
    interval is Student's of the scrambles.
    """
    _, here, there, _ = np.moveaxis(cells, -1, 0)
    count = cells.shape[-2]
    sums = cluster_sums(here - there, cells.sum(axis=-1))
    difference, variance = ratio_and_variance(sums, count)
    half = student_quantile(count) * np.sqrt(variance)
    return difference, np.maximum(difference - half, -1.0), np.minimum(difference + half, 1.0)


def newcombe(
    both: ArrayLike, here: ArrayLike, there: ArrayLike, neither: ArrayLike
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (difference, low, high) of two paired proportions: here minus there, 95 %.

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
    """Return (difference, low, high) of successes/trials − others/of, 95 %, of a correlation
    ``phi``.

    0 for independent samples: Newcombe, Stat. Med. 17 (1998) 873–890, method 10. NaN where either
    has no trials.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = np.true_divide(successes, trials), np.true_divide(others, of)
        one_low, one_high = wilson(successes, trials)
        other_low, other_high = wilson(others, of)
        # Each limit is as far from the difference as the two ends that it takes are from theirs.
        down = joined(one - one_low, other_high - other, phi)
        up = joined(one_high - one, other - other_low, phi)
        return one - other, one - other - down, one - other + up


def joined(one, other, phi):
    return np.sqrt(np.maximum(one * one - 2.0 * phi * one * other + other * other, 0.0))


def correlation(both, here, there, neither):
    """Return φ of a table of four cells with Newcombe's continuity correction; 0 for an empty
    margin."""
    n = both + here + there + neither
    excess = both * neither - here * there
    # n/2 is taken off a positive excess: φ from few replicates is too large on average.
    excess = np.where(excess > 0.0, np.maximum(excess - 0.5 * n, 0.0), excess)
    margins = (both + here) * (there + neither) * (both + there) * (here + neither)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(margins > 0.0, excess / np.sqrt(margins), 0.0)
