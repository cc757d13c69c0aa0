"""Two results files of pairs compared: differences of probabilities, condition by condition."""

from collections.abc import Mapping, Sequence
from typing import ClassVar

import attrs
import numpy as np

from flocsim.ensembles.contents import MEANINGS, Differences, changes_between, common
from flocsim.ensembles.estimates.numerical import Codes, Intervals, change_intervals, count_changes
from flocsim.ensembles.estimates.statistics import (
    EXACT_RUNS,
    between,
    bounded_cells,
    bounded_difference,
    by_runs,
    joined,
    of_each_scramble,
    sums_of_scrambles,
)
from flocsim.ensembles.kind import ORDER
from flocsim.ensembles.pairs.opened import StudyResults
from flocsim.ensembles.report import SCRAMBLES
from flocsim.io.confidence import bounded_sums, clustered_proportion, proportion
from flocsim.io.labelled import Column, about_of
from flocsim.io.results.events import Events, approaches, events
from flocsim.io.results.schema import AXES, COMPARED, COORDINATES, PER_APPROACH


@attrs.frozen(eq=False, repr=False)
class Comparison(Differences):
    """Differences between two results of pairs, as `flocsim.compare` returns them.

    Attributes
    ----------
    arrays : dict of str to dict of str to (type, vertices, delta) array
        {probability: {name: values}}.

    Notes
    -----
    Intervals of paired replicates are those of Newcombe. For the other attributes see Differences.
    """

    quantities: ClassVar[Mapping[str, tuple[str, str]]] = {"pr_a": ("1", COMPARED["pr_a"])} | {
        name: ("1", text) for name, text in COMPARED.items()
    }
    word = "probability"
    digits = ".3f"


def compare(first: StudyResults, second: StudyResults) -> Comparison:
    """The Comparison of two results files, over the conditions that both have; UsageError for
    none."""
    wanted = [common(getattr(first, axis), getattr(second, axis), axis) for axis in ORDER]
    rows = [picked(each, wanted) for each in (first, second)]
    pairs = min(first.count, second.count)
    paired = all(
        np.array_equal(rows[0][name][..., :pairs], rows[1][name][..., :pairs], equal_nan=True)
        for name in ("angle_i", "angle_j")
    )
    scrambles = [int(each.run.get(SCRAMBLES, 0)) for each in (first, second)]
    kept = pairs if paired else None
    codes = [by_runs([each[name][..., :kept] for name in EXACT_RUNS]) for each in rows]
    trials = [compared_events(*each[0]) for each in codes]
    changes = [changes_of(*each) for each in codes]
    arrays = {}
    for name in COMPARED:
        both = trials[0][name], trials[1][name]
        found = paired_of(*both, scrambles[0]) if paired else apart_of(both, scrambles)
        # Each of the two may be off in either direction.
        (first_low, first_high), (low, high) = (each[name] for each in changes)
        arrays[name] = found | {"change_low": low - first_high, "change_high": high - first_low}
    values = np.array(wanted[0], dtype=object), np.array(wanted[1]), np.array(wanted[2])
    axes = {
        name: Column((name,), each, about_of(COORDINATES[name]))
        for name, each in zip(AXES, values, strict=True)
    }
    return Comparison(paired, pairs if paired else 0, axes, arrays, changes_between(first, second))


def picked(results: StudyResults, wanted: Sequence[Sequence]) -> dict[str, np.ndarray]:
    """Return the columns that are compared, at the wanted types, numbers of vertices and δ."""
    axes = (np.asarray(getattr(results, axis)).tolist() for axis in ORDER)
    at = np.ix_(*([axis.index(value) for value in values]
                  for axis, values in zip(axes, wanted, strict=True)))  # fmt: skip
    return {name: results.replicates[name][at] for name in ("angle_i", "angle_j", *EXACT_RUNS)}


def compared_events(outcome: np.ndarray, inside: np.ndarray, bond: np.ndarray) -> dict[str, Events]:
    """The Events of COMPARED."""
    found = events(outcome, inside, bond) | {PER_APPROACH: approaches(outcome)}
    return {name: found[name] for name in COMPARED}


def changes_of(first: Codes, again: Codes, third: Codes) -> Intervals:
    """Return {probability: (low, high)} of how much each of COMPARED would change, run exactly."""
    totals = {
        name: Events(*(flags.sum(axis=-1) for flags in each))
        for name, each in compared_events(*first).items()
    }
    return change_intervals(count_changes(first, again, third, compared_events), totals)


def paired_of(first: Events, second: Events, scrambles: int) -> dict[str, np.ndarray]:
    """The arrays of MEANINGS but what numerics change, of the Events of the same replicates in two
    files, over those that count in both. What is unknown may have come to anything."""
    parts = of_each_scramble(0, scrambles) or [slice(None)]
    cut = [[Events(*(flags[..., part] for flags in each)) for each in (second, first)]
           for part in parts]  # fmt: skip
    joint = np.stack([bounded_cells(ours, theirs) for ours, theirs in cut], axis=-2)
    cells = joint[0].sum(axis=-2)
    ends = bounded_difference(joint if scrambles else joint[..., 0, :], bool(scrambles))
    both, here, there, _ = np.moveaxis(cells, -1, 0)
    n = cells.sum(axis=-1)
    return arrays_of(both + there, n, both + here, n, ends)


def apart_of(files: Sequence[Events], scrambles: Sequence[int]) -> dict[str, np.ndarray]:
    """The same of independent replicates."""
    (n, s, u), (m, t, v) = (Events(*(each.sum(axis=-1) for each in one)) for one in files)
    difference = between(t, m, s, n)[0]
    if not any(scrambles):
        ends = between(t, m + v, s + u, n + u)[1], between(t + v, m + v, s, n + u)[2]
    else:
        (p, p_low, p_high), (q, q_low, q_high) = map(interval_of, files, scrambles)
        down, up = joined(q - q_low, p_high - p, 0.0), joined(q_high - q, p - p_low, 0.0)
        ends = difference - down, difference + up
    return arrays_of(s, n, t, m, (difference, *ends))


def interval_of(each: Events, scrambles: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(share, low, high) of the flags of one file's replicates."""
    trials, successes, unknown = (flags.sum(axis=-1) for flags in each)
    found = proportion(successes, trials, unknown=unknown)
    if not scrambles:
        return found
    tried, came, left = sums_of_scrambles(np.stack(each), 0, scrambles)
    return clustered_proportion(bounded_sums(came, tried, left), scrambles)[:3]


def arrays_of(s, n, t, m, ends):
    """Return the arrays of MEANINGS of s of n events in the first file, and t of m in the second;
    ``ends``: the difference with its interval."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return dict(zip(MEANINGS, (s / n, t / m, *ends, n, m), strict=False))
