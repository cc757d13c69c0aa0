"""What becomes of the parts and rows of a study of swarms: results, so far or for good, and what
commands show of a file and of two.
"""

import io
import warnings
import zipfile
from collections.abc import Container, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ClassVar

import attrs
import numpy as np

from flocsim.ensembles.contents import (
    MEANINGS,
    Contents,
    Differences,
    Example,
    Facts,
    Figures,
    Row,
    Summary,
    changes_between,
    common,
    later,
    study_summary,
)
from flocsim.ensembles.kind import Condition, OldResults
from flocsim.errors import FileError, FlocsimError, UsageError, plural
from flocsim.io.groups import UNREADABLE
from flocsim.io.labelled import Column, Labelled, about_of
from flocsim.io.results import swarm_file
from flocsim.io.results.run_group import stored
from flocsim.io.results.swarm_file import SwarmResults
from flocsim.io.terminal import in_words
from flocsim.io.trajectory import Motion

# What is saved of a replicate while it runs.

Arrays = Mapping[str, np.ndarray]

BODIES, STATE = "bodies", "state"


def moment_name(place: int) -> str:
    """Return the name of the part that has a snapshot."""
    return f"moment {place}"


def has(parts: Container[str], moments: int) -> bool:
    """Return True if the bodies of a replicate and its first snapshots are there."""
    return BODIES in parts and all(moment_name(place) in parts for place in range(moments))


def encoded(arrays: Arrays) -> bytes:
    """Return arrays by name as the bytes of a part."""
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)  # type: ignore[arg-type]
    return buffer.getvalue()


def decoded(data: bytes) -> dict[str, np.ndarray]:
    """Return the arrays of a part; FileError where the bytes are none."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as found:
            return dict(found)
    except (*UNREADABLE, zipfile.BadZipFile) as error:
        raise FileError(
            "a saved part of a swarm cannot be read: start over with --restart"
        ) from error


# Results of the parts.


def results_from(
    swarms: Mapping[int, Any], times: int, rows: np.ndarray, asked: Mapping[str, Any],
    run: Mapping[str, Any], old: SwarmResults | None = None,
) -> SwarmResults:  # fmt: skip
    """Return the results of swarms up to so many times.

    First come those of an ``old`` file, then ``swarms``, {number of the replicate: its Parts};
    ``rows`` say how each of them ended.
    """
    begun = 0 if old is None else len(old.scales["replicate"])
    # Arrays by column, for a place along the first axes: all of the old ones have no such axis.
    saved: dict[tuple, dict[str, np.ndarray]] = {}
    if old is not None:
        saved[()] = {name: each for group in old.groups.values() for name, each in group.items()}
    for k, parts in enumerate(swarms.values(), begun):
        saved[k,] = decoded(parts.read(BODIES)[1])
        for time in filter(lambda time: moment_name(time) in parts, range(times)):
            moment = saved[k, time] = decoded(parts.read(moment_name(time))[1])
            # Lists of pairs and clusters say of which replicate and time they are.
            for kind, last in (("bond", "kind"), ("cluster", "number")):
                shape = moment[f"{kind}_{last}"].shape
                moment[f"{kind}_replicate"] = np.full(shape, k)
                moment[f"{kind}_time"] = np.full(shape, time)

    def most(name: str, axis: int) -> int:
        return max(each[name].shape[axis] for each in saved.values() if name in each)

    lengths: dict[Any, int] = {
        "replicate": begun + len(swarms), "time": times, "class": 1 + len(asked["bounds"]),
        "body": most("r_eq", -1), "component": 3, "point": most("points", -2), "axis": 2,
    }  # fmt: skip
    groups: dict[str, dict[str, np.ndarray]] = {}
    for group in ("counts", "snapshots", "bodies", "bonds", "clusters"):
        groups[group] = {}
        for name, column in swarm_file.GROUPS[group].columns.items():
            # An empty swarm has no means of clusters.
            there = {place: each[name] for place, each in saved.items() if name in each}
            if "replicate" not in column.axes:
                groups[group][name] = np.concatenate([[], *there.values()]).astype(column.type)
                continue
            # NaN, or no cluster, at times that were not reached; zeros after a body's last point.
            blank = 0 if group == "bodies" else -1 if name == "cluster" else np.nan
            values = np.full([lengths[axis] for axis in column.axes], blank, column.type)
            for place, each in there.items():
                values[place + tuple(map(slice, each.shape))] = each
            groups[group][name] = values
    groups["events"] = swarm_file.events_of(groups["snapshots"]["cluster"])
    groups["ends"] = {name: rows[name] for name in swarm_file.ENDS}
    axes = {
        "replicate": [*range(begun), *swarms], "time": asked["times"][:times],
        "class": [0.0, *asked["bounds"]], "component": swarm_file.COMPONENTS,
        "axis": swarm_file.AXES,
    }  # fmt: skip
    found: SwarmResults = swarm_file.SWARMS.stored(groups, axes, run)
    return found


# What commands show.


def facts_of(results: SwarmResults) -> Facts:
    """Return facts of swarms, also of those that still run."""
    bodies, ends = results.groups["bodies"], results.groups["ends"]
    free = bodies["floc"][0] != swarm_file.WALL
    radii = 1e6 * bodies["r_eq"][:, free]
    width, height = 1e6 * bodies["box"].mean(axis=0)
    events = results.groups["events"]
    before, after = events["event_before"], events["event_after"]
    return [
        ("swarms", f"{len(radii)} of {plural(int(free.sum()), 'body', 'bodies')}, "
         f"{int(ends['finished'].sum())} completed"),
        ("r_eq [um]", f"{radii.min():.4g} to {radii.max():.4g}, median {np.median(radii):.4g}"),
        ("box [um]", f"{width:.5g} x {height:.5g}"),
        ("mergers", f"{np.sum(after < before)} of clusters between snapshots"),
        ("break-ups", f"{np.sum(after > before)}"),
        ("steps", f"{ends['steps'].sum()} of islands, {ends['body_steps'].sum()} of bodies, "
         f"{ends['rejected'].sum()} rejected"),
    ]  # fmt: skip


def note_words(note: dict) -> str:
    """Return a swarm that ended early in words."""
    return f"swarm {note['replicate']}: {note['why']}"


def swept_table(table: Labelled) -> tuple[Sequence[str], Row]:
    """Return clusters at the end, means over swarms: heads, and the cells at swept values."""

    def row(place: tuple[int, ...]) -> Sequence[str]:
        last = (table.columns[name].values[place][:, -1] for name in names)
        clusters, size, settling = (float(swarm_file.mean(each)) for each in last)
        return many, time, f"{clusters:.1f}", f"{size:.2f}", f"{1e3 * settling:.4g}"

    names = ("clusters", "mean_size", "settling")
    many = str(len(table.axes["replicate"].values))
    time = in_words(float(table.axes["time"].values[-1]))
    return ("swarms", "time [s]", "clusters", "mean size", "settling [mm/s]"), row


@attrs.frozen(eq=False, repr=False)
class SwarmComparison(Differences):
    """Differences between two results of swarms, as `flocsim.compare` returns them.

    Attributes
    ----------
    arrays : dict of str to dict of str to (time,) array
        {column of counts: {name: values}}.

    Notes
    -----
    Intervals are those of Student's t. For the other attributes see Differences.
    """

    noun = "swarms"
    quantities: ClassVar[Mapping[str, tuple[str, str]]] = {
        name: swarm_file.COUNTS[name][1:] for name in ("mean_size", *swarm_file.COUNTS)
    }
    word = "quantity"


def mean_differences(
    first: np.ndarray, second: np.ndarray, pairs: int | None
) -> dict[str, np.ndarray]:
    """Return the arrays of MEANINGS of values (replicate, time), NaN where a swarm did not get so
    far.

    Student's interval of paired differences of the first ``pairs``, or Welch's of independent
    samples.
    """
    from scipy.stats import ttest_ind, ttest_rel

    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of times to which few swarms got
        if pairs is not None:
            first, second = first[:pairs], second[:pairs]
            known = np.isfinite(first) & np.isfinite(second)
            first, second = np.where(known, first, np.nan), np.where(known, second, np.nan)
            test = ttest_rel(second, first, nan_policy="omit")
        else:
            test = ttest_ind(second, first, equal_var=False, nan_policy="omit")
        low, high = test.confidence_interval(0.95)
        means = [np.nanmean(each, axis=0) for each in (first, second)]
    difference = means[1] - means[0]
    # Samples that happen to be alike say nothing of their spread, unless nothing differs.
    spread = high > low
    low, high = (np.where(spread, end, np.where(difference == 0.0, 0.0, np.nan))
                 for end in (low, high))  # fmt: skip
    counts = [np.isfinite(each).sum(axis=0) for each in (first, second)]
    return dict(zip(MEANINGS, (*means, difference, low, high, *counts), strict=False))


class SwarmFiles(Contents):
    """What becomes of the rows of a study of swarms, and what commands show of its files."""

    title = "results of a swarm study"
    file = swarm_file.SWARMS
    rows = staticmethod(swarm_file.rows_of)
    table = staticmethod(swarm_file.table_of)
    compared = {name: words for name, (_, _, words) in swarm_file.COUNTS.items()}  # noqa: RUF012
    on_examples = (
        "Each cluster of two or more flocs has a colour; single flocs are grey. "
        "Between snapshots, positions are interpolated. Along the sides on which the box repeats "
        "itself, the view moves with the flocs."
    )
    first = ("snapshots", "clusters", "sizes")
    swept = ("counts",)
    swept_table = staticmethod(swept_table)
    dry_run = later("ensembles.swarms.study", "dry_run")
    animate = later("io.plots.swarm", "write_swarm_animation")

    def results(
        self, study: Any, start: Any, count: int, run: dict, output: str | Path
    ) -> SwarmResults:
        """Write the results of so many replicates to ``output``, and return them."""
        old = start.old
        new = {k: start.store.parts[0, k] for k in range(old.count if old else 0, count)}
        rows, found = start.store.rows(0, 0, count), old.found if old else None
        made = results_from(new, study.pieces, rows, study.asked(), run, found)
        made.write(output, start.replacing)
        return made

    @contextmanager
    def old_rows(self, output: str | Path) -> Iterator[OldResults]:
        """Open a results file that is to be extended."""
        found = self.read(output)
        ends = [found.groups["ends"][name] for name in swarm_file.ENDS]
        rows = np.rec.fromarrays(ends, dtype=swarm_file.ROW)
        condition = Condition("swarm", int(found.run.get("vertices", 0)), 0.0)
        yield OldResults([condition], len(rows), [(condition, 0, rows)], found.run, found)

    def so_far(self, store: Any, asked: dict[str, Any]) -> tuple[SwarmResults, int, int]:
        """Make results of the swarms that have begun."""
        swarms = {
            replicate: parts for (_, replicate), parts in sorted(store.parts.items())
            if has(parts, 1) and replicate < asked["replicates"]
        }  # fmt: skip
        if not swarms:
            raise FileError(f"{store.journal.path} has no snapshot yet: try again later")
        planned = len(asked["times"])
        there = [k for parts in swarms.values() for k in range(planned) if moment_name(k) in parts]
        rows, run = np.zeros(len(swarms), swarm_file.ROW), {"periodic": asked["periodic"]}
        made = results_from(swarms, 1 + max(there), rows, asked, run)
        return made, len(there), asked["replicates"] * planned

    def facts(self, study: Any) -> dict[str, Any]:
        """Return what the results say of a study besides their groups."""
        return {"periodic": study.scene.periodic, "vertices": study.vertices}

    def verdict(self, found: SwarmResults) -> tuple[int, str]:
        """Return 0, or the code of an error where no swarm has come to its end, and what to say of
        those that have not."""
        finished = found.groups["ends"]["finished"]
        missed = int(np.count_nonzero(finished == 0))
        if not missed:
            return 0, ""
        notes = stored(found.run, "failed")
        first = note_words(notes[0]) if notes else "see `flocsim info`"
        line = f"{missed} of {len(finished)} swarms ended early; the first: {first}"
        return (
            (FlocsimError.exit_code, line) if missed == len(finished) else (0, f"warning: {line}")
        )

    def summary(self, results: SwarmResults) -> Summary:
        """Return what a results file of swarms says of its study."""
        return study_summary(facts_of(results), results.run, note_words)

    def answer(self, found: SwarmResults) -> str:
        """Return what the bodies have become by the end, means over swarms."""
        counts, (many, bodies) = found.groups["counts"], found.groups["bodies"]["floc"].shape
        clusters, size = (swarm_file.mean(counts[name])[-1] for name in ("clusters", "mean_size"))
        over, time = f" (means over {many} swarms)" * (many > 1), found.scales["time"][-1]
        return (
            f"After {time:g} s, {bodies} flocs form {clusters:.3g} clusters; a floc is, on "
            f"average, in a cluster of {size:.2g}{over}."
        )

    def examples(self, opened: Any) -> list[Example]:
        """Return the motion of the first swarm, by its snapshots."""
        from flocsim.io.plots.swarm import motion_data

        return [Example("First swarm", "", motion_data(opened))]

    def running(self, found: Any) -> Facts:
        """Return facts of swarms that still run."""
        return facts_of(found.results)[:-1]

    def counts(self, found: SwarmResults) -> Sequence[int]:
        """Return the number of swarms."""
        return (len(found.groups["ends"]["finished"]),)

    def figures(self, found: SwarmResults) -> Figures:
        """Return the figures that swarms have."""
        from flocsim.io.plots.swarm import SWARM_FIGURES

        there = {
            "classes": len(found.scales["class"]) > 1,
            "speed": len(found.groups["clusters"]["cluster_speed"]) > 0,
        }
        return {name: draw for name, draw in SWARM_FIGURES.items() if there.get(name, True)}

    def motion(self, found: SwarmResults) -> Motion:
        """Return (times, positions, velocities, shapes) of the first swarm; UsageError where bodies
        have left it."""
        from flocsim.io.plots.swarm import last_known, shape_of

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

    def compare(self, first: SwarmResults, second: SwarmResults) -> SwarmComparison:
        """Return the SwarmComparison of two files: of replicates of one number, paired where their
        bodies begin alike."""
        times = common(first.scales["time"], second.scales["time"], "time")
        mine, yours = first.groups, second.groups
        begun, also = (each["snapshots"]["position"][:, 0] for each in (mine, yours))
        pairs = min(len(begun), len(also))
        paired = np.array_equal(begun[:pairs], also[:pairs], equal_nan=True)
        at = [
            np.flatnonzero(np.isin(each["time"], times)) for each in (first.scales, second.scales)
        ]
        arrays = {
            name: mean_differences(
                mine["counts"][name][:, at[0]], yours["counts"][name][:, at[1]],
                pairs if paired else None,
            ) for name in swarm_file.COUNTS
        }  # fmt: skip
        axes = {"time": Column(("time",), np.array(times), about_of(swarm_file.SCALES["time"]))}
        changes = changes_between(first, second)
        return SwarmComparison(paired, pairs if paired else 0, axes, arrays, changes)


CONTENTS = SwarmFiles()
