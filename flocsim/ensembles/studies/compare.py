"""Two results files compared: differences of probabilities, condition by condition."""

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from flocsim.ensembles.estimates.numerical import Codes, change_intervals, count_changes
from flocsim.ensembles.estimates.paired import (
    between,
    bounded_cells,
    bounded_difference,
    change_of_differences,
    joined,
    of_each_scramble,
)
from flocsim.ensembles.estimates.statistics import COUNTED, by_runs
from flocsim.ensembles.report import SCRAMBLES
from flocsim.ensembles.storage.identity import differences
from flocsim.ensembles.studies.opened import StudyResults, identity_in
from flocsim.errors import UsageError
from flocsim.io.confidence import proportion, scrambled_proportion
from flocsim.io.labelled import Column, Labelled, Tables, about_of
from flocsim.io.results.events import Events, approaches, events
from flocsim.io.results.schema import (
    AXES,
    COMPARED,
    COORDINATES,
    PER_APPROACH,
)
from flocsim.io.results.swarm_file import COUNTS, SCALES, SwarmResults
from flocsim.io.terminal import aligned

MEANINGS = {
    "first": "the probability in the first file",
    "second": "the probability in the second file",
    "difference": "second minus first",
    "difference_low": "difference, lower 95 % bound",
    "difference_high": "difference, upper 95 % bound",
    "change_low": "by how much the difference would change, run exactly: lower 95 % bound",
    "change_high": "by how much the difference would change, run exactly: upper 95 % bound",
    "n_first": "replicates that count in the first file",
    "n_second": "replicates that count in the second file",
}
"""The arrays of a comparison of one probability."""


@attrs.frozen(eq=False)
class Comparison(Tables):
    """What one results file has more of than another: `flocsim.compare` makes it.

    ``types``, ``vertices`` and ``delta`` are the conditions that both have. ``paired``: whether
    replicate k is the same draw in both, so that the difference is that of the ``pairs`` that both
    have, by Newcombe's paired interval; else samples are independent. ``arrays``
    {probability: {name: (type, vertices, delta)}}, names as in MEANINGS; ``changes``, lines on what
    the studies differ in.
    """

    types: tuple[str, ...]
    vertices: np.ndarray
    delta: np.ndarray
    paired: bool
    pairs: int
    arrays: dict[str, dict[str, np.ndarray]]
    changes: tuple[str, ...] = ()

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
        how = f"the {self.pairs} replicates that both have, paired" if self.paired else (
            "independent samples"
        )  # fmt: skip
        lines = [*self.changes, f"{COMPARED[probability]}, second minus first: {how}", ""]
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

    def __repr__(self) -> str:
        how = f"{self.pairs} pairs" if self.paired else "independent"
        shape = f"{len(self.types)} × {len(self.vertices)} × {len(self.delta)}"
        return f"Comparison({shape} conditions, {how})"


ENDS = ("_low", "_high")


def with_change(low: float, high: float, change_low: float, change_high: float) -> str:
    """ "[+0.010, +0.050] -0.004 +0.010 *": an interval and what numerics may change, a star where
    0 is outside both together."""
    added = np.nan_to_num([change_low, change_high])
    star = " *" if low + added[0] > 0.0 or high + added[1] < 0.0 else ""
    return f"[{low:+.3f}, {high:+.3f}] {change_low:+.3f} {change_high:+.3f}{star}"


def labelled_of(
    axes: dict[str, Column], arrays: Mapping[str, np.ndarray], meanings: Mapping[str, str],
    facts: dict[str, Any], units: str = "1",
) -> Labelled:  # fmt: skip
    """Arrays of a comparison along all axes."""
    return Labelled(
        axes,
        {
            name: Column(tuple(axes), values, {
                "units": "1" if name.startswith("n_") else units, "long_name": meanings[name],
            }) for name, values in arrays.items()
        },
        facts,
    )  # fmt: skip


OF_MEANS = {
    "first": "mean over the swarms of the first file",
    "second": "mean over the swarms of the second file",
    "difference": "second minus first",
    "difference_low": "difference, lower 95 % bound",
    "difference_high": "difference, upper 95 % bound",
    "n_first": "swarms that count in the first file",
    "n_second": "swarms that count in the second file",
}
"""The arrays of a comparison of one quantity of swarms."""


@attrs.frozen(eq=False)
class SwarmComparison(Tables):
    """The same of swarms: ``arrays`` {column of the counts: {name: (time,)}} at the ``times`` [s]
    that both have, names as in OF_MEANS; intervals by Student's t."""

    times: np.ndarray
    paired: bool
    pairs: int
    arrays: dict[str, dict[str, np.ndarray]]
    changes: tuple[str, ...] = ()

    indices = {"mean_size": ("time",)} | dict.fromkeys(COUNTS, ("time",))
    word = "quantity"

    def labelled(self, quantity: str) -> Labelled:
        """The arrays of one quantity with their axis; UsageError for an unknown one."""
        axes = {"time": Column(("time",), self.times, about_of(SCALES["time"]))}
        _, units, text = COUNTS[self.known(quantity)]
        facts = {"quantity": text, "paired": int(self.paired)}
        return labelled_of(axes, self.arrays[quantity], OF_MEANS, facts, units)

    def table(self, quantity: str = "mean_size") -> str:
        """The same as text; a star marks intervals without 0."""
        arrays = {name: each.values for name, each in self.labelled(quantity).columns.items()}
        how = f"the {self.pairs} swarms that both have, paired" if self.paired else (
            "independent samples"
        )  # fmt: skip
        _, units, text = COUNTS[quantity]
        rows = [["time [s]", "n", "first", "second", "difference [95 %]"]]
        for place, time in enumerate(self.times):
            each = {name: values[place] for name, values in arrays.items()}
            low, high = each["difference_low"], each["difference_high"]
            star = " *" if low > 0.0 or high < 0.0 else ""
            found = f"{each['difference']:+.4g} [{low:+.4g}, {high:+.4g}]{star}"
            numbers = f"{each['n_first']}/{each['n_second']}"
            firsts = (f"{each[name]:.4g}" for name in ("first", "second"))
            rows.append([f"{time:.4g}", numbers, *firsts, found])
        title = f"{text} [{units}], second minus first: {how}"
        return "\n".join([*self.changes, title, "", *aligned(rows)])

    def __repr__(self) -> str:
        how = f"{self.pairs} pairs" if self.paired else "independent"
        return f"SwarmComparison({len(self.times)} times, {how})"


def compare(
    first: StudyResults | SwarmResults | Any, second: StudyResults | SwarmResults | Any
) -> Comparison | SwarmComparison:
    """The Comparison of two results files, over the conditions that both have; of swarms over the
    times that both have.

    They are paired where both have drawn the same replicates, one by one: studies of one seed.
    UsageError where they have no condition in common, or are of two kinds.
    """
    if isinstance(first, SwarmResults) and isinstance(second, SwarmResults):
        return compare_swarms(first, second)
    if not isinstance(first, StudyResults) or not isinstance(second, StudyResults):
        words = [type(each).__name__ for each in (first, second)]
        raise UsageError(
            f"two results of pairs, or two of swarms, can be compared: found {' and '.join(words)}"
        )
    wanted = [common(getattr(first, axis), getattr(second, axis), axis) for axis in ORDER]
    rows = [picked(each, wanted) for each in (first, second)]
    pairs = min(first.count, second.count)
    paired = all(
        np.array_equal(rows[0][name][..., :pairs], rows[1][name][..., :pairs], equal_nan=True)
        for name in ("angle_i", "angle_j")
    )
    scrambles = [int(each.run.get(SCRAMBLES, 0)) for each in (first, second)]
    kept = pairs if paired else None
    codes = [by_runs([each[name][..., :kept] for name in COUNTED]) for each in rows]
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
        tuple(wanted[0]), np.array(wanted[1]), np.array(wanted[2]), paired,
        pairs if paired else 0, arrays, changes_between(first, second),
    )  # fmt: skip


ORDER = ("types", "vertices", "delta")


def changes_between(first, second):
    """Lines on what the studies of two files differ in."""
    lines = differences(*map(identity_in, (first, second)))
    return tuple(
        line.replace(" in the file, ", " in the first, ").replace(" now", " in the second")
        for line in lines
    )


def common(ours: Any, theirs: Any, axis: str) -> list:
    """The values of an axis that both have, in the order of the first; UsageError for none."""
    ours, theirs = (np.asarray(each).tolist() for each in (ours, theirs))
    both = [value for value in ours if value in theirs]
    if not both:
        raise UsageError(
            f"the two files have no {axis} in common: {', '.join(map(str, ours))} and "
            f"{', '.join(map(str, theirs))}"
        )
    return both


def places(results, wanted):
    """The places of the wanted values in a file, for np.ix_."""
    axes = (np.asarray(getattr(results, axis)).tolist() for axis in ORDER)
    return [
        [each.index(value) for value in values] for each, values in zip(axes, wanted, strict=True)
    ]


def picked(results, wanted):
    """The columns that are compared, at the wanted conditions."""
    at = np.ix_(*places(results, wanted))
    return {name: results.replicates[name][at] for name in ("angle_i", "angle_j", *COUNTED)}


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
    sums = [
        np.stack(
            [
                flags[..., part].sum(axis=-1, dtype=np.int64)
                for part in of_each_scramble(0, scrambles)
            ],
            axis=-1,
        )
        for flags in each
    ]
    return found[0], *scrambled_proportion(sums[1], sums[0], sums[2])[:2]


def told(s, n, t, m, ends):
    difference, low, high = ends
    with np.errstate(divide="ignore", invalid="ignore"):
        return {
            "first": s / n, "second": t / m, "difference": difference, "difference_low": low,
            "difference_high": high, "n_first": n, "n_second": m,
        }  # fmt: skip


def compare_swarms(first: SwarmResults, second: SwarmResults) -> SwarmComparison:
    """The SwarmComparison of two files: of replicates of one number, paired where their bodies
    begin alike."""
    times = common(first.scales["time"], second.scales["time"], "time")
    mine, yours = first.groups, second.groups
    begun, also = (each["snapshots"]["position"][:, 0] for each in (mine, yours))
    pairs = min(len(begun), len(also))
    paired = np.array_equal(begun[:pairs], also[:pairs], equal_nan=True)
    at = [np.flatnonzero(np.isin(each["time"], times)) for each in (first.scales, second.scales)]
    arrays = {
        name: mean_differences(
            mine["counts"][name][:, at[0]], yours["counts"][name][:, at[1]],
            pairs if paired else None,
        ) for name in COUNTS
    }  # fmt: skip
    changes = changes_between(first, second)
    return SwarmComparison(np.array(times), paired, pairs if paired else 0, arrays, changes)


def mean_differences(
    first: np.ndarray, second: np.ndarray, pairs: int | None
) -> dict[str, np.ndarray]:
    """The arrays of OF_MEANS of values (replicate, time), NaN where a swarm did not get so far.

    Paired differences of the first ``pairs``, or Welch's interval of independent samples.
    """
    from scipy.special import stdtrit

    if pairs is not None:
        first, second = first[:pairs], second[:pairs]
        known = np.isfinite(first) & np.isfinite(second)
        first, second = np.where(known, first, np.nan), np.where(known, second, np.nan)
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # none got so far
        counts = [np.isfinite(each).sum(axis=0) for each in (first, second)]
        means = [np.nanmean(each, axis=0) for each in (first, second)]
        if pairs is None:
            parts = [np.nanvar(each, axis=0, ddof=1) / n
                     for each, n in zip((first, second), counts, strict=True)]  # fmt: skip
            square = parts[0] + parts[1]
            shares = [part**2 / (n - 1) for part, n in zip(parts, counts, strict=True)]
            freedom = square**2 / (shares[0] + shares[1])
        else:
            square = np.nanvar(second - first, axis=0, ddof=1) / counts[0]
            freedom = counts[0] - 1.0
        half = stdtrit(freedom, 0.975) * np.sqrt(square)
        difference = means[1] - means[0]
        # Two that happen to be alike say nothing of their spread, unless nothing differs.
        half = np.where(square > 0.0, half, np.where(difference == 0.0, 0.0, np.nan))
    return {
        "first": means[0], "second": means[1], "difference": difference,
        "difference_low": difference - half, "difference_high": difference + half,
        "n_first": counts[0], "n_second": counts[1],
    }  # fmt: skip
