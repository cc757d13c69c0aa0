"""Two results files of pairs compared: differences of probabilities, condition by condition."""

from collections.abc import Sequence

import attrs
import numpy as np

from flocsim.ensembles.contents import Differences, changes_between, common, labelled_of, starred
from flocsim.ensembles.estimates.numerical import Codes, change_intervals, count_changes
from flocsim.ensembles.estimates.statistics import (
    EXACT_RUNS,
    between,
    bounded_cells,
    bounded_difference,
    by_runs,
    change_of_differences,
    joined,
    of_each_scramble,
    sums_of_scrambles,
)
from flocsim.ensembles.kind import ORDER
from flocsim.ensembles.pairs.opened import StudyResults
from flocsim.ensembles.report import SCRAMBLES
from flocsim.io.confidence import proportion, scrambled_proportion
from flocsim.io.labelled import Column, Labelled, about_of
from flocsim.io.results.events import Events, approaches, events
from flocsim.io.results.schema import AXES, COMPARED, COORDINATES, PER_APPROACH

MEANINGS = {
    "first": "the probability in the first file",
    "second": "the probability in the second file",
    "difference": "second minus first",
    "difference_low": "difference, lower 95 % bound",
    "difference_high": "difference, upper 95 % bound",
    "change_low": "change of the difference if all runs were exact: lower 95 % bound",
    "change_high": "change of the difference if all runs were exact: upper 95 % bound",
    "n_first": "replicates that count in the first file",
    "n_second": "replicates that count in the second file",
}
"""The arrays of a comparison of one probability."""


@attrs.frozen(eq=False, repr=False)
class Comparison(Differences):
    """What one results file has more of than another: `flocsim.compare` makes it.

    ``types``, ``vertices`` and ``delta`` are the conditions that both have; ``arrays``
    {probability: {name: (type, vertices, delta)}}, names as in MEANINGS. Where they are ``paired``
    intervals are Newcombe's.
    """

    types: tuple[str, ...] = attrs.field(kw_only=True)
    vertices: np.ndarray = attrs.field(kw_only=True)
    delta: np.ndarray = attrs.field(kw_only=True)

    indices = {"pr_a": AXES} | dict.fromkeys(COMPARED, AXES)
    word = "probability"

    def labelled(self, probability: str) -> Labelled:
        """The arrays of one probability with their axes; UsageError for an unknown one."""
        values = np.array(self.types, dtype=object), self.vertices, self.delta
        axes = {
            name: Column((name,), each, about_of(COORDINATES[name]))
            for name, each in zip(AXES, values, strict=True)
        }
        facts = {"probability": COMPARED[self.known(probability)], "paired": int(self.paired)}
        return labelled_of(axes, self.arrays[probability], MEANINGS, facts)

    def table(self, probability: str = "pr_a") -> str:
        """The same as text; a star marks intervals, numerics included, without 0."""
        arrays = self.labelled(probability).columns
        lines = [*self.changes, f"{COMPARED[probability]}, second minus first: {self.how}", ""]
        lines.append(
            f"{'type':>10} {'N':>5} {'delta':>6} {'n':>13} {'first':>6} {'second':>6}  "
            "difference [95 %] numerics"
        )
        for place in np.ndindex(*(len(each) for each in (self.types, self.vertices, self.delta))):
            each = {name: column.values[place] for name, column in arrays.items()}
            ends = [float(each[f"{name}{end}"]) for name in ("difference", "change")
                    for end in ENDS]  # fmt: skip
            numbers = f"{each['n_first']}/{each['n_second']}"
            found = "-" if np.isnan(each["difference"]) else (
                f"{each['difference']:+.3f} {with_change(*ends)}"
            )  # fmt: skip
            lines.append(
                f"{self.types[place[0]]:>10} {self.vertices[place[1]]:>5} "
                f"{self.delta[place[2]]:>6g} {numbers:>13} {each['first']:>6.3f} "
                f"{each['second']:>6.3f}  {found}"
            )
        return "\n".join(lines)


ENDS = ("_low", "_high")


def with_change(low: float, high: float, change_low: float, change_high: float) -> str:
    """ "[+0.010, +0.050] -0.004 +0.010 *": an interval and what numerics may change, a star where
    0 is outside both together."""
    added = np.nan_to_num([change_low, change_high])
    star = starred(low + added[0], high + added[1])
    return f"[{low:+.3f}, {high:+.3f}] {change_low:+.3f} {change_high:+.3f}{star}"


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
    changes = (
        change_of_differences(codes[0], codes[1], compared_events)
        if paired
        else changes_apart(codes)
    )
    arrays = {}
    for name in COMPARED:
        both = trials[0][name], trials[1][name]
        found = paired_of(*both, scrambles[0]) if paired else apart_of(both, scrambles)
        arrays[name] = found | dict(zip(("change_low", "change_high"), changes[name], strict=True))
    return Comparison(
        paired, pairs if paired else 0, arrays, changes_between(first, second),
        types=tuple(wanted[0]), vertices=np.array(wanted[1]), delta=np.array(wanted[2]),
    )  # fmt: skip


def places(results, wanted):
    """The places of the wanted values in a file, for np.ix_."""
    axes = (np.asarray(getattr(results, axis)).tolist() for axis in ORDER)
    return [
        [each.index(value) for value in values] for each, values in zip(axes, wanted, strict=True)
    ]


def picked(results, wanted):
    """The columns that are compared, at the wanted conditions."""
    at = np.ix_(*places(results, wanted))
    return {name: results.replicates[name][at] for name in ("angle_i", "angle_j", *EXACT_RUNS)}


def compared_events(outcome: np.ndarray, inside: np.ndarray, bond: np.ndarray) -> dict[str, Events]:
    """The Events of COMPARED."""
    found = events(outcome, inside, bond) | {PER_APPROACH: approaches(outcome)}
    return {name: found[name] for name in COMPARED}


def changes_apart(files: Sequence[Sequence[Codes]]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """{probability: (low, high)} of by how much its difference would change, run exactly, where
    the replicates of two files are independent."""
    changes = [
        change_intervals(count_changes(runs[0], runs[1], runs[2], compared_events), {
            name: Events(*(flags.sum(axis=-1) for flags in each))
            for name, each in compared_events(*runs[0]).items()
        }) for runs in files
    ]  # fmt: skip
    return {
        name: (changes[1][name][0] - changes[0][name][1], changes[1][name][1] - changes[0][name][0])
        for name in COMPARED
    }


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
    return told(both + there, n, both + here, n, ends)


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
    return told(s, n, t, m, (difference, *ends))


def interval_of(each: Events, scrambles: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(share, low, high) of the flags of one file's replicates."""
    trials, successes, unknown = (flags.sum(axis=-1) for flags in each)
    found = proportion(successes, trials, unknown=unknown)
    if not scrambles:
        return found
    tried, came, left = sums_of_scrambles(np.stack(each), 0, scrambles)
    return found[0], *scrambled_proportion(came, tried, left)[:2]


def told(s, n, t, m, ends):
    difference, low, high = ends
    with np.errstate(divide="ignore", invalid="ignore"):
        return {
            "first": s / n, "second": t / m, "difference": difference, "difference_low": low,
            "difference_high": high, "n_first": n, "n_second": m,
        }  # fmt: skip
