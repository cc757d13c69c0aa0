"""Two results files of swarms compared: differences of means over swarms, time by time."""

import warnings

import attrs
import numpy as np

from flocsim.ensembles.comparison import Differences, changes_between, common, labelled_of, starred
from flocsim.io.labelled import Column, Labelled, about_of
from flocsim.io.results.swarm_file import COUNTS, SCALES, SwarmResults
from flocsim.io.terminal import aligned

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


@attrs.frozen(eq=False, repr=False)
class SwarmComparison(Differences):
    """What one file of swarms has more of than another: ``arrays`` {column of the counts: {name:
    (time,)}} at the ``times`` [s] that both have, names as in OF_MEANS; intervals by Student's
    t."""

    times: np.ndarray = attrs.field(kw_only=True)

    noun = "swarms"
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
        _, units, text = COUNTS[quantity]
        rows = [["time [s]", "n", "first", "second", "difference [95 %]"]]
        for place, time in enumerate(self.times):
            each = {name: values[place] for name, values in arrays.items()}
            low, high = each["difference_low"], each["difference_high"]
            star = starred(low, high)
            found = f"{each['difference']:+.4g} [{low:+.4g}, {high:+.4g}]{star}"
            numbers = f"{each['n_first']}/{each['n_second']}"
            firsts = (f"{each[name]:.4g}" for name in ("first", "second"))
            rows.append([f"{time:.4g}", numbers, *firsts, found])
        title = f"{text} [{units}], second minus first: {self.how}"
        return "\n".join([*self.changes, title, "", *aligned(rows)])


def compare(first: SwarmResults, second: SwarmResults) -> SwarmComparison:
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
    return SwarmComparison(paired, pairs if paired else 0, arrays, changes, times=np.array(times))


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
