"""What becomes of the parts and rows of a study of swarms: results, so far or for good, and what
commands show of a file and of two.
"""

import io
import json
import warnings
import zipfile
from collections.abc import Container, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ClassVar

import attrs
import numpy as np

from flocsim.ensembles.contents import (
    Contents,
    Differences,
    Facts,
    Figures,
    Joined,
    Summary,
    changes_between,
    common,
    in_words,
    later,
    origin,
)
from flocsim.ensembles.kind import Condition, OldResults
from flocsim.errors import FileError, FlocsimError, UsageError, visible
from flocsim.io.groups import UNREADABLE
from flocsim.io.labelled import Column, about_of
from flocsim.io.results import swarm_file
from flocsim.io.results.run_group import stored
from flocsim.io.results.swarm_file import SwarmResults
from flocsim.state.work import grown

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

Groups = dict[str, dict[str, np.ndarray]]

PLACED = ("bond_replicate", "cluster_replicate", "event_replicate")
"""Columns that count replicates."""


def groups_of(parts: Any, times: int, classes: int) -> Groups:
    """Return {group: {column: array}} of the Parts of one replicate, but for its ends; NaN, or no
    cluster, at times that it has not reached."""
    bodies = decoded(parts.read(BODIES)[1])
    moments = {
        place: decoded(parts.read(moment_name(place))[1])
        for place in range(times) if moment_name(place) in parts
    }  # fmt: skip
    groups: Groups = {"bodies": {name: values[np.newaxis] for name, values in bodies.items()}}
    lengths: dict[Any, int] = {"class": classes, "body": len(bodies["r_eq"]), "component": 3}
    for group in ("counts", "snapshots"):
        groups[group] = {}
        for name, each in swarm_file.GROUPS[group].columns.items():
            shape = 1, times, *(lengths[axis] for axis in each.axes[2:])
            values = np.full(shape, -1 if name == "cluster" else np.nan, each.type)
            for place, moment in moments.items():
                # Empty swarms have no means of clusters.
                values[0, place] = moment.get(name, np.nan)
            groups[group][name] = values
    # Lists of pairs and clusters, after the replicate and the time that they are of.
    for group in ("bonds", "clusters"):
        replicate, time, *names = swarm_file.GROUPS[group].columns
        counts = [len(moment[names[0]]) for moment in moments.values()]
        listed = {replicate: np.zeros(sum(counts)), time: np.repeat([*moments], counts)} | {
            name: np.concatenate([[], *(moment[name] for moment in moments.values())])
            for name in names
        }
        groups[group] = {
            name: values.astype(swarm_file.GROUPS[group].columns[name].type)
            for name, values in listed.items()
        }
    groups["events"] = swarm_file.events_of(groups["snapshots"]["cluster"])
    return groups


def joined(parts: Sequence[Mapping[str, Any]]) -> Groups:
    """Return the groups of replicates after each other, core points filled up with zeros."""
    most = max(each["bodies"]["points"].shape[1] for each in parts)
    begun = np.cumsum([0, *(len(each["bodies"]["box"]) for each in parts)])

    def column(group: str, name: str) -> np.ndarray:
        values = [each[group][name] for each in parts]
        if name in swarm_file.POINTS | swarm_file.RINGS:
            values = [grown(each, 1, most) for each in values]
        if name in PLACED:
            values = [each + first for each, first in zip(values, begun, strict=False)]
        return np.concatenate(values).astype(swarm_file.GROUPS[group].columns[name].type)

    return {
        group: {name: column(group, name) for name in swarm_file.GROUPS[group].columns}
        for group in swarm_file.GROUPS if group != "ends"
    }  # fmt: skip


def results_from(
    groups: Groups, ends: Mapping[str, np.ndarray], asked: Mapping[str, Any],
    run: Mapping[str, Any], replicates: Sequence[int],
) -> SwarmResults:  # fmt: skip
    """Return the results of the replicates of these numbers."""
    times = groups["counts"]["clusters"].shape[1]
    axes = {
        "replicate": replicates, "time": asked["times"][:times], "class": [0.0, *asked["bounds"]],
        "component": swarm_file.COMPONENTS, "axis": swarm_file.AXES,
    }  # fmt: skip
    found: SwarmResults = swarm_file.SWARMS.stored(groups | {"ends": ends}, axes, run)
    return found


def first_of(found: SwarmResults, count: int) -> Groups:
    """Return the groups of the first replicates of results."""
    groups = {}
    for group, columns in found.groups.items():
        listed = [columns[name] for name in PLACED if name in columns]
        chosen = listed[0] < count if listed else slice(count)
        groups[group] = {name: columns[name][chosen] for name in swarm_file.GROUPS[group].columns}
    return groups


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
    """Return clusters at the end at every value, means over swarms, heads first."""
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


def sweep_figures() -> Figures:
    """Return the figures of a sweep of swarms."""
    from flocsim.io.plots.curves import SWARM_SWEEP_FIGURES

    return SWARM_SWEEP_FIGURES


def asked(results: SwarmResults) -> dict[str, Any]:
    """Return the axes of results, and how many replicates there are."""
    return {"types": ["swarm"], "vertices": [int(results.run.get("vertices", 0))], "delta": [0.0],
            "replicates": len(results.scales["replicate"])}  # fmt: skip


@attrs.frozen(eq=False, repr=False)
class SwarmComparison(Differences):
    """What one file of swarms has more of than another: ``arrays`` {column of the counts: {name:
    (time,)}}; intervals by Student's t."""

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
    return {
        "first": means[0], "second": means[1], "difference": difference,
        "difference_low": low, "difference_high": high,
        "n_first": counts[0], "n_second": counts[1],
    }  # fmt: skip


class SwarmFiles(Contents):
    """What becomes of the rows of a study of swarms, and what commands show of its files."""

    title = "results of a swarm study"
    read = staticmethod(swarm_file.read_swarm)
    table = staticmethod(swarm_file.table_of)
    compared = {name: words for name, (_, _, words) in swarm_file.COUNTS.items()}  # noqa: RUF012
    joined = Joined({"counts": swarm_file.GROUPS["counts"]}, sweep_rows, sweep_figures, asked)
    dry_run = later("ensembles.swarms.study", "dry_run")
    animate = later("io.plots.swarm", "write_swarm_animation")

    def results(
        self, study: Any, start: Any, count: int, run: dict, output: str | Path
    ) -> SwarmResults:
        """Write the results of so many replicates to ``output``, and return them."""
        store, asked = start.store, study.asked()
        old = [first_of(start.old.found, count)] if start.old else []
        begun = len(old[0]["bodies"]["box"]) if old else 0
        new = [
            groups_of(store.parts[0, each], study.pieces, 1 + len(asked["bounds"]))
            for each in range(begun, count)
        ]
        rows = store.rows(0, 0, count)
        ends = {name: rows[name].copy() for name in swarm_file.ENDS}
        made = results_from(joined([*old, *new]), ends, asked, run, range(count))
        made.write(output, start.replacing)
        return made

    @contextmanager
    def old_rows(self, output: str | Path) -> Iterator[OldResults]:
        """Open a results file that is to be extended."""
        found = swarm_file.read_swarm(output)
        ends = found.groups["ends"]
        rows = np.zeros(
            len(ends["finished"]), [(name, ends[name].dtype) for name in swarm_file.ENDS]
        )
        for name in swarm_file.ENDS:
            rows[name] = ends[name]
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
        there = [
            [place for place in range(planned) if moment_name(place) in parts]
            for parts in swarms.values()
        ]
        times, classes = 1 + max(each[-1] for each in there), 1 + len(asked["bounds"])
        groups = joined([groups_of(parts, times, classes) for parts in swarms.values()])
        ends = {name: np.zeros(len(swarms), kind) for name, (kind, *_) in swarm_file.ENDS.items()}
        made = results_from(groups, ends, asked, {"periodic": asked["periodic"]}, [*swarms])
        return made, sum(map(len, there)), asked["replicates"] * planned

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
        notes = json.loads(found.run.get("failed", "[]"))
        first = (
            f"swarm {notes[0]['replicate']}: {notes[0]['why']}" if notes else "see `flocsim info`"
        )
        line = f"{missed} of {len(finished)} swarms ended early; the first: {first}"
        return (
            (FlocsimError.exit_code, line) if missed == len(finished) else (0, f"warning: {line}")
        )

    def summary(self, results: SwarmResults) -> Summary:
        """Return what a results file of swarms says of its study."""
        failed = [
            f"swarm {note['replicate']}: {note['why']}" for note in stored(results.run, "failed")
        ]
        warnings = [str(line) for line in stored(results.run, "warnings")]
        return Summary(facts_of(results), origin(results.run), warnings, failed)

    def running(self, found: Any) -> Facts:
        """Return facts of swarms that still run."""
        return facts_of(found.results)[:-1]

    def figures(self, found: SwarmResults) -> Figures:
        """Return the figures that swarms have."""
        from flocsim.io.plots.swarm import SWARM_FIGURES

        there = {
            "classes": len(found.scales["class"]) > 1,
            "speed": len(found.groups["clusters"]["cluster_speed"]) > 0,
        }
        return {name: draw for name, draw in SWARM_FIGURES.items() if there.get(name, True)}

    def motion(self, found: SwarmResults) -> tuple:
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
