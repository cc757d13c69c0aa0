"""Differences between conditions from the same replicates: common random numbers, used.

Replicate k has the same orientations (and flocs) in all conditions, so that what it does in two of
them is correlated, and the difference is known better than from independent samples.
"""

import numpy as np
from numpy.typing import ArrayLike

from flocsim.io.confidence import wilson
from flocsim.io.results.events import Events, events
from flocsim.io.results.schema import AXES, NOT_APPLICABLE


def joint_counts(outcome: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """How often an event happens in both, here only, there only, in neither.

    ``outcome``, ``inside``: codes (type, vertices, delta, replicate). Returns whole numbers
    (bound, against, event, type, vertices, delta, 4) of `bounded_cells`: each condition and the
    first along each axis, over the replicates that count in both.
    """
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


def paired_differences(joint: np.ndarray) -> dict[str, np.ndarray]:
    """The arrays of DIFFERENCES from bounded_cells; NaN where no replicate counts."""
    joint = np.asarray(joint)
    difference, low, high = bounded_newcombe(joint)
    return {
        "n_pairs": joint[0].sum(axis=-1),
        "difference": difference,
        "difference_low": low,
        "difference_high": high,
    }


def bounded_newcombe(joint: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(difference, low, high) of bounded_cells: whatever the unknown replicates would have come to
    is in the interval."""
    known, least, most = (newcombe(*np.moveaxis(each, -1, 0)) for each in joint)
    return known[0], least[1], most[2]


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
