"""Two results files compared: differences of probabilities, condition by condition."""

from collections.abc import Sequence

import attrs
import numpy as np

from flocsim.ensembles.estimates.events import AGGREGATED, DECIDED, HELD, MISSED, events
from flocsim.ensembles.estimates.paired import between, newcombe
from flocsim.ensembles.storage.identity import differences
from flocsim.ensembles.studies.opened import StudyResults
from flocsim.errors import UsageError
from flocsim.io.confidence import numerical_error
from flocsim.io.labelled import Column, DataFrame, Dataset, Labelled, about_of
from flocsim.io.results.schema import (
    AXES,
    COMPARED,
    COORDINATES,
    NOT_APPLICABLE,
    PER_APPROACH,
)

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
class Comparison:
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

    def labelled(self, probability: str) -> Labelled:
        """The arrays of one probability with their axes; UsageError for an unknown one."""
        if probability not in self.arrays:
            raise UsageError(
                f"probability must be one of {', '.join(self.arrays)}, found {probability!r}"
            )
        axes = {
            "type": np.array(self.types, dtype=object), "vertices": self.vertices,
            "delta": self.delta,
        }  # fmt: skip
        return Labelled(
            {
                axis: Column((axis,), values, about_of(COORDINATES[axis]))
                for axis, values in axes.items()
            },
            {
                name: Column(AXES, values, {"units": "1", "long_name": MEANINGS[name]})
                for name, values in self.arrays[probability].items()
            },
            {"probability": COMPARED[probability], "paired": int(self.paired)},
        )

    def to_xarray(self, probability: str = "pr_a") -> Dataset:
        """The differences of one probability as an xarray Dataset."""
        return self.labelled(probability).to_xarray()

    def to_pandas(self, probability: str = "pr_a") -> DataFrame:
        """The differences of one probability as a pandas DataFrame, a row for each condition."""
        return self.labelled(probability).to_pandas(AXES)

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


def compare(first: StudyResults, second: StudyResults) -> Comparison:
    """The Comparison of two results files, over the conditions that both have.

    They are paired where both have drawn the same orientations, replicate by replicate: studies of
    one seed. UsageError where they have no condition in common.
    """
    wanted = [common(getattr(first, axis), getattr(second, axis), axis) for axis in ORDER]
    rows = [picked(each, wanted) for each in (first, second)]
    pairs = min(first.count, second.count)
    paired = all(
        np.array_equal(rows[0][name][..., :pairs], rows[1][name][..., :pairs], equal_nan=True)
        for name in ("angle_i", "angle_j")
    )
    trials = [trials_in(each) for each in rows]
    arrays = {}
    for name in COMPARED:
        found = differences_of(trials[0][name], trials[1][name], pairs if paired else None)
        added = (
            [numerical_per_approach(each) for each in rows]
            if name == PER_APPROACH
            else [numerical(each, name, wanted) for each in (first, second)]
        )
        arrays[name] = found | {"numerical": np.sum(added, axis=0)}
    changes = differences(first.stored("identity"), second.stored("identity"))
    return Comparison(
        tuple(wanted[0]), np.array(wanted[1]), np.array(wanted[2]), paired,
        pairs if paired else 0, arrays, tuple(in_two_files(line) for line in changes),
    )  # fmt: skip


ORDER = ("types", "vertices", "delta")


def in_two_files(line):
    """A line of `identity.differences` for two files."""
    return line.replace(" in the file, ", " in the first, ").replace(" now", " in the second")


def common(ours: Sequence, theirs: Sequence, axis: str) -> list:
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


def numerical(results, name, wanted):
    return results.probabilities[f"{name}_numerical"][np.ix_(*places(results, wanted))]


def trials_in(rows):
    """{probability: (whether a replicate counts in it, whether as a success)}, all of COMPARED."""
    found = events(rows["outcome"], rows["inside"], rows["bond"])
    return found | {PER_APPROACH: approaches(rows["outcome"])}


def approaches(outcome):
    """(which replicates were decided, which ended aggregated)."""
    return np.isin(outcome, [*range(DECIDED), MISSED, HELD]), np.isin(outcome, AGGREGATED)


def numerical_per_approach(rows):
    """What numerics add to Pr[aggregation | decided approach]: flips of what was run again."""
    again = rows["checked_outcome"]
    checked = again != NOT_APPLICABLE
    (trial, success), (trial_again, success_again) = map(approaches, (rows["outcome"], again))
    flipped = checked & ((trial != trial_again) | (success != success_again))
    counted = checked & (trial | trial_again)
    return numerical_error(*(np.sum(each, axis=-1) for each in (flipped, counted, trial)))


def differences_of(first, second, pairs):
    """The arrays of MEANINGS but ``numerical``, of (counts, successes) of two files.

    Over the replicates that count in both, among the first ``pairs``; of independent samples where
    that is None.
    """
    if pairs is None:
        (n, s), (m, t) = ([each.sum(axis=-1) for each in one] for one in (first, second))
        difference, low, high = between(t, m, s, n)
    else:
        counts = first[0][..., :pairs] & second[0][..., :pairs]
        mine, yours = (one[1][..., :pairs] & counts for one in (first, second))
        cells = (mine & yours, yours & ~mine, mine & ~yours, ~mine & ~yours)
        both, here, there, neither = (np.sum(counts & cell, axis=-1) for cell in cells)
        n = m = counts.sum(axis=-1)
        s, t = both + there, both + here
        difference, low, high = newcombe(both, here, there, neither)
    with np.errstate(divide="ignore", invalid="ignore"):
        return {
            "first": s / n, "second": t / m, "difference": difference, "difference_low": low,
            "difference_high": high, "n_first": n, "n_second": m,
        }  # fmt: skip
