"""Two results files of pairs compared: differences of probabilities, condition by condition."""

import attrs
import numpy as np

from flocsim.ensembles.comparison import Differences, changes_between, common, labelled_of, starred
from flocsim.ensembles.estimates.numerical import share_that_flips
from flocsim.ensembles.estimates.paired import between, bounded_cells, bounded_newcombe
from flocsim.ensembles.pairs.opened import StudyResults
from flocsim.io.labelled import Column, Labelled, about_of
from flocsim.io.results.events import Events, approaches, events, kinds_of
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
            "difference [95 %] num."
        )
        for place in np.ndindex(*(len(each) for each in (self.types, self.vertices, self.delta))):
            each = {name: column.values[place] for name, column in arrays.items()}
            low, high, added = each["difference_low"], each["difference_high"], each["numerical"]
            widened = 0.0 if np.isnan(added) else added
            star = starred(low - widened, high + widened)
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
        paired, pairs if paired else 0, arrays, changes_between(first, second),
        types=tuple(wanted[0]), vertices=np.array(wanted[1]), delta=np.array(wanted[2]),
    )  # fmt: skip


ORDER = ("types", "vertices", "delta")


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
