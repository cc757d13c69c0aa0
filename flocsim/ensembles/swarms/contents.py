"""What a results file of swarms holds, for the commands; two of them compared."""

import warnings
from functools import partial
from typing import Any

import attrs
import numpy as np

from flocsim.ensembles.contents import (
    Contents,
    Differences,
    Facts,
    Figures,
    Joined,
    Summary,
    Table,
    changes_between,
    common,
    in_words,
    labelled_of,
    later,
    origin,
    starred,
)
from flocsim.errors import UsageError, visible
from flocsim.io.labelled import Column, Labelled, about_of
from flocsim.io.plots.curves import SWARM_SWEEP_FIGURES
from flocsim.io.plots.swarm import SWARM_FIGURES, last_known, shape_of, write_swarm_animation
from flocsim.io.results import swarm_file
from flocsim.io.results.run_group import stored
from flocsim.io.terminal import aligned


def summary(results: swarm_file.SwarmResults) -> Summary:
    """What a results file of swarms says of its study; ValueError where that cannot be read."""
    failed = [f"swarm {note['replicate']}: {note['why']}" for note in stored(results.run, "failed")]
    warnings = [str(line) for line in stored(results.run, "warnings")]
    return Summary(facts_of(results), origin(results.run), warnings, failed)


def facts_of(results: swarm_file.SwarmResults) -> Facts:
    """[(name, value)] of swarms, also of those that still run."""
    bodies, ends = results.groups["bodies"], results.groups["ends"]
    free = bodies["floc"][0] != swarm_file.WALL
    radii = 1e6 * bodies["r_eq"][:, free]
    width, height = 1e6 * bodies["box"].mean(axis=0)
    events = results.groups["events"]
    before, after = events["event_before"], events["event_after"]
    return [
        ("swarms", f"{len(radii)} of {np.count_nonzero(free)} bodies, "
         f"{int(ends['finished'].sum())} were completed"),
        ("r_eq [um]", f"{radii.min():.4g} to {radii.max():.4g}, median {np.median(radii):.4g}"),
        ("box [um]", f"{width:.5g} x {height:.5g}"),
        ("mergers", f"{np.sum(after < before)} of clusters, between snapshots"),
        ("break-ups", f"{np.sum(after > before)}"),
        ("steps", f"{ends['steps'].sum()} of islands, {ends['body_steps'].sum()} of bodies, "
         f"{ends['rejected'].sum()} rejected"),
    ]  # fmt: skip


def sweep_rows(found: Any) -> list[tuple[str, ...]]:
    """Clusters at the end at every value, means over swarms, heads first."""
    table = found.labelled("counts")
    rows = [(*found.swept, "swarms", "time [s]", "clusters", "mean size", "settling [mm/s]")]
    axes = [table.axes[name].values.tolist() for name in found.swept]
    names = ("clusters", "mean_size", "settling")
    for place in np.ndindex(*map(len, axes)):
        last = {name: table.columns[name].values[place][:, -1] for name in names}
        clusters, size, settling = (float(swarm_file.mean(last[name])) for name in names)
        keys = (visible(in_words(axis[k]), "") for axis, k in zip(axes, place, strict=True))
        time = in_words(float(table.axes["time"].values[-1]))
        rows.append((*keys, str(len(last["clusters"])), time,
                     f"{clusters:.1f}", f"{size:.2f}", f"{1e3 * settling:.4g}"))  # fmt: skip
    return rows


def figures(found: swarm_file.SwarmResults) -> Figures:
    """{name: function} of the figures that swarms have."""
    there = {
        "classes": len(found.scales["class"]) > 1,
        "speed": len(found.groups["clusters"]["cluster_speed"]) > 0,
    }
    return {name: draw for name, draw in SWARM_FIGURES.items() if there.get(name, True)}


def first_swarm(found: swarm_file.SwarmResults) -> tuple:
    """(times, positions, velocities, shapes) of the first swarm; UsageError where bodies have left
    it."""
    moments = found.groups["snapshots"]
    known = slice(last_known(found) + 1)
    position, velocity = (moments[name][0, known] for name in ("position", "velocity"))
    if not np.isfinite(position).all():
        raise UsageError(
            "bodies have left the first swarm, and exported motion has the same bodies at all "
            "times: flocsim plot --animation shows it"
        )
    shapes = [shape_of(found, 0, body) for body in range(position.shape[1])]
    return found.scales["time"][known], position, velocity, shapes


def tables(results: swarm_file.SwarmResults) -> list[Table | str]:
    """Clusters over time."""
    heads, *rows = swarm_file.table_rows(results)
    return [Table("Clusters over time, means over swarms", heads, rows)]


def asked(results: swarm_file.SwarmResults) -> dict[str, Any]:
    """The axes of results, and how many replicates there are."""
    return {"types": ["swarm"], "vertices": [int(results.run.get("vertices", 0))], "delta": [0.0],
            "replicates": len(results.scales["replicate"])}  # fmt: skip


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
    indices = {"mean_size": ("time",)} | dict.fromkeys(swarm_file.COUNTS, ("time",))
    word = "quantity"

    def labelled(self, quantity: str) -> Labelled:
        """The arrays of one quantity with their axis; UsageError for an unknown one."""
        axes = {"time": Column(("time",), self.times, about_of(swarm_file.SCALES["time"]))}
        _, units, text = swarm_file.COUNTS[self.known(quantity)]
        facts = {"quantity": text, "paired": int(self.paired)}
        return labelled_of(axes, self.arrays[quantity], OF_MEANS, facts, units)

    def table(self, quantity: str = "mean_size") -> str:
        """The same as text; a star marks intervals without 0."""
        arrays = {name: each.values for name, each in self.labelled(quantity).columns.items()}
        _, units, text = swarm_file.COUNTS[quantity]
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


def compare(first: swarm_file.SwarmResults, second: swarm_file.SwarmResults) -> SwarmComparison:
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
        ) for name in swarm_file.COUNTS
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


OF_KIND = partial(later, "ensembles.swarms.kind")

CONTENTS = Contents(
    title="results of a swarm study", read=swarm_file.read_swarm, summary=summary,
    table=swarm_file.table_of, tables=tables,
    figures=figures, drawn={"a swarm study": SWARM_FIGURES},
    running=lambda found: facts_of(found.results)[:-1], run=lambda found: found.run,
    opened=lambda path, allowed=None: swarm_file.read_swarm(path),
    compare=compare,
    compared={name: words for name, (_, _, words) in swarm_file.COUNTS.items()},
    joined=Joined({"counts": swarm_file.GROUPS["counts"]}, sweep_rows, SWARM_SWEEP_FIGURES, asked),
    results=OF_KIND("results"), old_rows=OF_KIND("old_rows"), so_far=OF_KIND("so_far"),
    facts=OF_KIND("facts"), verdict=OF_KIND("verdict"), dry_run=OF_KIND("dry_run"),
    animate=write_swarm_animation, motion=first_swarm,
)  # fmt: skip
