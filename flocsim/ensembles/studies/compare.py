"""Two results files compared: differences of probabilities, condition by condition."""

import warnings
from collections.abc import Mapping
from typing import Any

import attrs
import numpy as np

from flocsim.ensembles.estimates.numerical import share_that_flips
from flocsim.ensembles.estimates.paired import between, bounded_cells, bounded_newcombe
from flocsim.ensembles.storage.identity import differences
from flocsim.ensembles.studies.opened import StudyResults, identity_in
from flocsim.errors import UsageError
from flocsim.io.labelled import Column, Labelled, Tables, about_of
from flocsim.io.results.events import Events, approaches, events, kinds_of
from flocsim.io.results.schema import (
    AXES,
    COMPARED,
    COORDINATES,
    NOT_APPLICABLE,
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
    "numerical": "what numerics add on either side, of both files together",
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
            "difference [95 %] num."
        )
        for place in np.ndindex(*(len(each) for each in (self.types, self.vertices, self.delta))):
            each = {name: column.values[place] for name, column in arrays.items()}
            low, high, added = each["difference_low"], each["difference_high"], each["numerical"]
            widened = 0.0 if np.isnan(added) else added
            star = " *" if low - widened > 0.0 or high + widened < 0.0 else ""
            numbers = f"{each['n_first']}/{each['n_second']}"
            found = "-" if np.isnan(each["difference"]) else (
                f"{each['difference']:+.3f} [{low:+.3f}, {high:+.3f}] +-{added:.3f}{star}"
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
    trials = [
        events(each["outcome"], each["inside"], each["bond"])
        | {PER_APPROACH: approaches(each["outcome"])}
        for each in rows
    ]
    arrays = {}
    for name in COMPARED:
        found = differences_of(trials[0][name], trials[1][name], pairs if paired else None)
        added = (
            [numerical_per_approach(each) for each in rows]
            if name == PER_APPROACH
            else [
                each.probabilities[f"{name}_numerical"][np.ix_(*places(each, wanted))]
                for each in (first, second)
            ]
        )
        arrays[name] = found | {"numerical": np.sum(added, axis=0)}
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
    names = ("angle_i", "angle_j", "outcome", "inside", "bond", "checked_outcome")
    return {name: results.replicates[name][at] for name in names}


def numerical_per_approach(rows):
    """What numerics add to Pr[aggregation | decided approach]: flips of what was run again."""
    again = rows["checked_outcome"]
    checked = again != NOT_APPLICABLE
    (trial, success, _), (trial_again, success_again, _) = map(approaches, (rows["outcome"], again))
    flipped = checked & ((trial != trial_again) | (success != success_again))
    kinds = kinds_of(rows["outcome"], rows["bond"])
    return share_that_flips(flipped, checked, kinds, trial.sum(axis=-1))


def differences_of(first, second, pairs):
    """The arrays of MEANINGS but ``numerical``, of the Events of two files.

    Over the replicates that count in both, among the first ``pairs``; of independent samples where
    that is None. What is unknown may have come to anything.
    """
    if pairs is None:
        (n, s, u), (m, t, v) = (Events(*(each.sum(axis=-1) for each in one))
                                for one in (first, second))  # fmt: skip
        difference = between(t, m, s, n)[0]
        low, high = between(t, m + v, s + u, n + u)[1], between(t + v, m + v, s, n + u)[2]
    else:
        ours = (Events(*(each[..., :pairs] for each in one)) for one in (second, first))
        joint = bounded_cells(*ours)
        difference, low, high = bounded_newcombe(joint)
        both, here, there, _ = np.moveaxis(joint[0], -1, 0)
        n = m = joint[0].sum(axis=-1)
        s, t = both + there, both + here
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
