"""From a journal of swarms to their results: what is there of each replicate, put together."""

from typing import Any

import attrs
import numpy as np

from flocsim.ensembles.suspension.checks import Form, check_part
from flocsim.ensembles.suspension.records import (
    BODIES,
    MOMENT,
    STATE,
    Part,
    part_of,
)
from flocsim.ensembles.suspension.replicate import Left
from flocsim.ensembles.suspension.study import SwarmStudy
from flocsim.integrators.base import Status
from flocsim.io.journal.journal import Journal
from flocsim.io.journal.records import SNAPSHOT, Record
from flocsim.io.results.swarm_file import (
    AXES,
    BONDS,
    COMPONENTS,
    COUNTS,
    ENDS,
    GONE,
    POINTS,
    RINGS,
    SwarmResults,
    mean,
)
from flocsim.io.terminal import aligned


@attrs.define(eq=False)
class Found:
    """What a journal has of a replicate: records of its bodies, of its snapshots by place, of its
    last state, and how it ended."""

    bodies: Record | None = None
    moments: dict[int, Record] = attrs.Factory(dict)
    state: Part | None = None
    ended: dict[str, Any] | None = None

    @property
    def left(self) -> Left | None:
        """Where it goes on; None where it begins anew."""
        if self.state is None or self.bodies is None:
            return None
        count = self.state.facts["moments"]
        if not all(place in self.moments for place in range(count)):
            return None
        return Left(count, self.state.arrays)


def found_in(journal: Journal, replicates: int, form: Form) -> tuple[dict[int, Found], list[str]]:
    """({replicate: Found}, remarks) of a journal's records: those that can be of this study."""
    found = {each: Found() for each in range(replicates)}
    remarks = [
        f"{journal.path}: damaged from byte {each.start} to {each.stop}: what is missing is "
        "computed again" for each in journal.damage
    ]  # fmt: skip
    for record in journal.records:
        if record.kind != SNAPSHOT:
            continue
        try:
            part = part_of(record, journal.read(record.offset, record.length))
            check_part(part, form)
        except ValueError as error:
            remarks.append(f"{journal.path}: {error}: it is left out")
            continue
        if part.replicate not in found:
            continue
        own = found[part.replicate]
        if part.of == BODIES:
            own.bodies = record
        elif part.of == MOMENT:
            own.moments[part.facts["place"]] = record
        elif part.of == STATE:
            own.state = part
        else:
            own.ended = part.facts
    for own in found.values():
        ended = own.ended is not None and own.bodies is not None
        if ended and own.ended["status"] == Status.FINISHED.name:  # type: ignore[index]
            ended = all(place in own.moments for place in range(form.moments))
        own.ended = own.ended if ended else None
    return found, remarks


def results_of(
    study: SwarmStudy, found: dict[int, Found], journal: Journal, run: dict[str, Any]
) -> tuple[SwarmResults, list[str]]:
    """(the SwarmResults of finished replicates, a line for each that ended early)."""
    stops, replicates = study.stops, len(found)
    failed = []
    arrays: dict[str, dict[str, np.ndarray]] = {}
    per_body = [read(journal, own.bodies).arrays for own in found.values()]
    n = len(per_body[0]["r_eq"])
    points = max(len(each["points"]) for each in per_body)
    counts = np.array([each["count"] for each in per_body])
    ends = np.cumsum(counts, axis=1)
    arrays["bodies"] = {
        name: np.array([each[name] for each in per_body])
        for name in ("r_eq", "spheroradius", "mass", "floc", "box")
    } | {
        "first_point": ends - counts, "point_count": counts,
    }  # fmt: skip
    for name in (*POINTS, *RINGS):
        arrays["bodies"][name] = np.array([filled_up(each[name], points) for each in per_body])
    shape = replicates, len(stops)
    classes = np.array([0.0, *study.scene.bounds])
    numbers = {name: np.full(shape, np.nan) for name in COUNTS}
    by_class = np.full((*shape, len(classes)), np.nan)
    motion = np.full((*shape, n, 6), np.nan)
    labels = np.full((*shape, n), -1, dtype=np.int32)
    bonds = [np.zeros((0, len(BONDS)), dtype=np.int32)]
    tallies = {name: np.zeros(replicates, ENDS[name][0]) for name in ENDS}
    for replicate, own in found.items():
        ended = own.ended or {}
        status = ended.get("status", "")
        tallies["finished"][replicate] = status == "FINISHED"
        tallies["end_time"][replicate] = ended.get("time") or 0.0
        for name in ("steps", "rejected", "body_steps", "windows"):
            tallies[name][replicate] = ended.get(name, 0)
        if status != "FINISHED":
            failed.append(
                f"swarm {replicate} ended at {ended.get('time') or 0.0:.4g} s: {status.lower()}, "
                f"in an island of bodies {', '.join(map(str, ended.get('failed', [])[:6]))}"
            )
        for place, record in own.moments.items():
            part = read(journal, record)
            for name, values in numbers.items():
                value = part.facts.get(name)
                values[replicate, place] = np.nan if value is None else value
            labels[replicate, place] = part.arrays["cluster"]
            left = labels[replicate, place] == GONE
            motion[replicate, place] = np.where(left[:, None], np.nan, part.arrays["motion"])
            by_class[replicate, place] = part.arrays["counts"]
            pairs = part.arrays["bonds"]
            at = np.broadcast_to(np.array([replicate, place], np.int32), (len(pairs), 2))
            bonds.append(np.concatenate([at, pairs], axis=1))
    arrays["counts"] = numbers | {"n_class": by_class}
    arrays["snapshots"] = {
        "position": motion[..., :3], "velocity": motion[..., 3:], "cluster": labels,
    }  # fmt: skip
    together = np.concatenate(bonds)
    together = together[np.lexsort(together.T[::-1])]
    arrays["bonds"] = dict(zip(BONDS, together.T.copy(), strict=True))
    arrays["ends"] = tallies
    scales = {
        "replicate": np.arange(replicates), "time": np.array(stops), "class": classes,
        "body": np.arange(n), "component": np.array(COMPONENTS), "axis": np.array(AXES),
        "point": np.arange(points), "bond": np.arange(len(together)),
    }  # fmt: skip
    return SwarmResults(scales, arrays, run), failed


def filled_up(column: np.ndarray, rows: int) -> np.ndarray:
    """A column of core points with zeros behind them, so many rows in all."""
    return np.pad(column, ((0, rows - len(column)), *[(0, 0)] * (column.ndim - 1)))


def read(journal: Journal, record: Record | None) -> Part:
    """A record's Part."""
    assert record is not None, "a finished replicate has its bodies"
    return part_of(record, journal.read(record.offset, record.length))


def table_of(results: SwarmResults) -> str:
    """Numbers on the clusters over time, means over replicates, as text."""
    counts = results.groups["counts"]
    columns = {
        "time [s]": (results.scales["time"], "{:.4g}"),
        "clusters": (mean(counts["clusters"]), "{:.1f}"),
        "largest": (mean(counts["largest"]), "{:.1f}"),
        "mean size": (mean(counts["mean_size"]), "{:.2f}"),
        "percolating": (mean(counts["percolating"]), "{:.1f}"),
        "R_g [um]": (1e6 * mean(counts["gyration"]), "{:.3g}"),
        "porosity": (mean(counts["porosity"]), "{:.3f}"),
        "held": (mean(counts["bonds_certificate"]), "{:.1f}"),
        "hooks": (mean(counts["bonds_hook"]), "{:.1f}"),
        "settling [mm/s]": (1e3 * mean(counts["settling"]), "{:.4g}"),
        "error of half [m]": (mean(counts["median_error"]), "{:.1e}"),
        "largest [m]": (mean(counts["error"]), "{:.1e}"),
    }
    if not np.any(counts["percolating"] > 0.0):
        del columns["percolating"]
    rows = [list(columns)]
    for place in range(len(results.scales["time"])):
        rows.append([form.format(values[place]) for values, form in columns.values()])
    many = len(results.scales["replicate"])
    return "\n".join(aligned(rows) + ([f"means over {many} swarms"] if many > 1 else []))
