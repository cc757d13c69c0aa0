"""What of a replicate goes into the journal: its bodies, its snapshots, its last state.

A part is a description and arrays, one after another, whose names, types and shapes the
description lists. A replicate goes on from its state.
A journal may have been written by anyone: `check_part` refuses what no swarm can have left. Results
are replicates put together, old ones first.
"""

import math
from collections.abc import Callable, Container, Iterable, Mapping
from typing import Any

import attrs
import numpy as np

import flocsim.arrays as at
import flocsim.swarms.arrays as sw
from flocsim.ensembles.storage.row_store import Parts
from flocsim.fields import is_number, is_whole
from flocsim.io.json_text import matches
from flocsim.io.results import swarm_file
from flocsim.swarms.progress import Effort

BODIES, MOMENT, STATE = "bodies", "moment", "state"
"""What a replicate's records are of."""

LISTED = {"of": str, "arrays": [[object]]}
KINDS = {"f8": np.float64, "i8": np.int64, "i4": np.int32}


@attrs.frozen(eq=False)
class Part:
    """One record of a replicate: what it is ``of``, further ``facts``, and its ``arrays``."""

    of: str
    arrays: dict[str, np.ndarray]
    facts: dict[str, Any] = attrs.Factory(dict)

    @property
    def name(self) -> str:
        """By which a later part takes the place of an earlier one."""
        return moment_name(self.facts["place"]) if self.of == MOMENT else self.of

    def described(self) -> tuple[str, dict[str, Any], bytes]:
        """(name, description, data), as they are saved."""
        listed = [
            [name, array.dtype.str[1:], list(array.shape)] for name, array in self.arrays.items()
        ]
        data = b"".join(np.ascontiguousarray(each).tobytes() for each in self.arrays.values())
        # What is not a number is None, as JSON has it.
        facts = {
            name: None if isinstance(value, float) and not math.isfinite(value) else value
            for name, value in self.facts.items()
        }
        return self.name, {"of": self.of, "arrays": listed, "facts": facts}, data


@attrs.frozen(eq=False)
class Left:
    """Where a replicate was left: how many snapshots it has, and the state of its Progress."""

    moments: int
    state: dict[str, np.ndarray]


def moment_name(place: int) -> str:
    """The name of the part that has a snapshot."""
    return f"{MOMENT} {place}"


def has(parts: Container[str], moments: int) -> bool:
    """Whether the bodies of a replicate and its first snapshots are there."""
    return BODIES in parts and all(moment_name(place) in parts for place in range(moments))


def left_of(parts: Parts) -> Left | None:
    """Where a replicate goes on; None where it begins anew."""
    if STATE not in parts:
        return None
    state = part_of(*parts.read(STATE))
    count = state.facts["moments"]
    return Left(count, state.arrays) if has(parts, count) else None


def part_of(about: dict[str, Any], data: bytes) -> Part:
    """The Part of a record of the journal, by its description; ValueError where it is none."""
    if not matches(about, LISTED):
        raise ValueError("a record has an unknown form")
    arrays, place = {}, 0
    for listed in about["arrays"]:
        form = matches(listed[:2], [str]) and matches(listed[2:], [[int]])
        if not form or len(listed) != 3 or listed[1] not in KINDS:
            raise ValueError("a record lists no arrays")
        name, kind, shape = listed
        if len(shape) > 3 or not all(0 <= each < 2**32 for each in shape):
            raise ValueError("a record lists no arrays")
        count = math.prod(shape)
        size = count * np.dtype(KINDS[kind]).itemsize
        if place + size > len(data):
            raise ValueError(f"the array {name} of a record is truncated")
        values = np.frombuffer(data, KINDS[kind], count, place)
        arrays[name] = values.reshape(shape).copy()
        place += size
    if place != len(data):
        raise ValueError("a record has more arrays than it lists")
    facts = about.get("facts", {})
    if not isinstance(facts, dict):
        raise ValueError("a record has an unknown form")
    return Part(about["of"], arrays, facts)


EFFORTS = len(attrs.fields(Effort))


def floats(numbers: Iterable[float]) -> tuple[float, ...]:
    return tuple(map(float, numbers))


@attrs.frozen
class Form:
    """What a study's records look like: how many bodies; radii [m] between the size classes; times
    [s] of the snapshots; axes along which its box repeats itself."""

    bodies: int
    bounds: tuple[float, ...] = attrs.field(converter=floats)
    times: tuple[float, ...] = attrs.field(converter=floats)
    periodic: str

    @property
    def moments(self) -> int:
        """Number of snapshots."""
        return len(self.times)

    def asked(self) -> dict[str, Any]:
        """As JSON has it."""
        return {
            "bodies": self.bodies, "bounds": list(self.bounds), "times": list(self.times),
            "periodic": self.periodic,
        }  # fmt: skip


FORM = {"bodies": int, "bounds": [float], "times": [float], "periodic": str}
"""Form.asked, as a pattern of `flocsim.io.json_text`."""


def check_part(name: str, part: Part, form: Form) -> None:
    """ValueError where a Part is none of a study of this Form, or has not this name."""
    checks = {BODIES: check_bodies, MOMENT: check_moment, STATE: check_state}
    if part.of not in checks:
        raise ValueError("a record is of an unknown kind")
    checks[part.of](part, form)
    demand(name == part.name, "name")


def check_shapes(part: Part, shapes: Mapping[str, tuple[Any, ...]]) -> None:
    """ValueError unless a Part has these arrays, {name: (kind, *shape)}, all numbers finite; a
    length given by a letter may be any, the same for all arrays."""
    if part.arrays.keys() != shapes.keys():
        raise ValueError("a record has other arrays")
    lengths: dict[str, int] = {}
    for name, (kind, *shape) in shapes.items():
        array = part.arrays[name]
        found = [
            lengths.setdefault(each, size) if isinstance(each, str) else each
            for each, size in zip(shape, array.shape, strict=False)
        ]
        if array.dtype.str[1:] != kind or array.ndim != len(shape) or list(array.shape) != found:
            raise ValueError(f"the array {name} of a record has an unknown form")
        if kind == "f8" and not np.isfinite(array).all():
            raise ValueError(f"the array {name} of a record has values that are not numbers")


def demand(condition: Any, name: str) -> None:
    if not condition:
        raise ValueError(f"{name} of a record is impossible")


def check_bodies(part: Part, form: Form) -> None:
    n = form.bodies
    check_shapes(part, {
        "r_eq": ("f8", n), "spheroradius": ("f8", n), "mass": ("f8", n), "floc": ("i4", n),
        "count": ("i8", n), "points": ("f8", "p", 2), "point_part": ("i4", "p"),
        "point_ring": ("i4", "p"), "point_radius": ("f8", "p"), "box": ("f8", 2),
    })  # fmt: skip
    for name in ("r_eq", "spheroradius", "mass", "point_radius", "box"):
        demand(np.all(part.arrays[name] > 0.0), name)
    counts, points = part.arrays["count"], len(part.arrays["points"])
    demand(np.all((counts >= 1) & (counts <= points)) and counts.sum() == points, "count")


def check_moment(part: Part, form: Form) -> None:
    n = form.bodies
    check_shapes(part, {
        "motion": ("f8", n, 6), "cluster": ("i4", n), "counts": ("i8", len(form.bounds) + 1),
        "bonds": ("i4", "b", 3), "clusters": ("f8", "c", len(swarm_file.OF_CLUSTERS)),
    })  # fmt: skip
    bonds, labels, counts = (part.arrays[name] for name in ("bonds", "cluster", "counts"))
    demand(np.all((bonds >= 0) & (bonds < [n, n, swarm_file.KIND_COUNT])), "bonds")
    demand(np.all((labels >= swarm_file.GONE) & (labels < n)), "cluster")
    demand(len(part.arrays["clusters"]) == labels.max(initial=-1) + 1, "clusters")
    demand(np.all((counts >= 0) & (counts <= n)), "counts")
    place: Any = part.facts.get("place")
    demand(is_whole(place) and 0 <= place < form.moments, "place")
    for name in swarm_file.COUNTS:
        value = part.facts.get(name)
        demand(value is None or is_number(value), name)


def check_state(part: Part, form: Form) -> None:
    n = form.bodies
    check_shapes(part, {
        "seen": ("f8", n, 6), "motion": ("f8", n, 6), "carried": ("f8", n, 6),
        "errors": ("f8", n, sw.ERROR_COLUMNS), "steps": ("f8", n), "wander": ("f8", n),
        "methods": ("f8", n), "links": ("i8", "k", sw.LINK_COLUMNS),
        "slips": ("f8", "k", sw.SLIP_COLUMNS), "time": ("f8",), "span": ("f8",),
        "stated": ("f8", n), "effort": ("i8", EFFORTS), "gone": ("i8", n), "returns": ("i8", n),
    })  # fmt: skip
    for name in ("steps", "wander"):
        demand(np.all(part.arrays[name] > 0.0), name)
    demand(np.all(np.isin(part.arrays["methods"], (0.0, 1.0))), "methods")
    demand(0.0 <= part.arrays["time"] <= form.times[-1] and part.arrays["span"] > 0.0, "time")
    gone, returns, links = (part.arrays[name] for name in ("gone", "returns", "links"))
    demand(np.all(np.isin(gone, (0, 1))) and np.all(returns >= 0), "gone")
    bodies = links[:, [sw.LATER_BODY, sw.EARLIER_BODY]]
    points = links[:, [sw.AT_VERTEX, sw.AT_EDGE]]
    demand(np.all((bodies >= 0) & (bodies < n)) and np.all(points >= 0), "links")
    demand(np.all(np.diff(links[:, sw.LATER_BODY]) >= 0), "links")
    demand(np.all((links[:, sw.MODE] >= at.OPEN) & (links[:, sw.MODE] <= at.GRAZES)), "links")
    moments: Any = part.facts.get("moments")
    demand(is_whole(moments) and 1 <= moments <= form.moments, "moments")


def check_ends(column: Callable[[str], np.ndarray]) -> None:
    """ValueError for rows of replicates that no run can have given; ``column(name)`` of ENDS."""
    demand(np.all((column("finished") >= 0) & (column("finished") <= 1)), "finished")
    demand(np.all(np.isfinite(column("end_time")) & (column("end_time") >= 0.0)), "end_time")
    for name in ("steps", "rejected", "body_steps", "windows"):
        demand(np.all(column(name) >= 0), name)


PLACED = ("bond_replicate", "cluster_replicate", "event_replicate")
"""Columns that count replicates."""

Groups = dict[str, dict[str, np.ndarray]]


def groups_of(form: Form, found: list[Parts]) -> Groups:
    """{group: {column: array}} of replicates, one after another, but for their ends."""
    per_body = [part_of(*own.read(BODIES)).arrays for own in found]
    points = max(len(each["points"]) for each in per_body)
    counts = np.array([each["count"] for each in per_body])
    groups: Groups = {}
    groups["bodies"] = {
        name: np.array([each[name] for each in per_body])
        for name in ("r_eq", "spheroradius", "mass", "floc", "box")
    } | {
        "first_point": np.cumsum(counts, axis=1) - counts, "point_count": counts,
    }  # fmt: skip
    for name in (*swarm_file.POINTS, *swarm_file.RINGS):
        groups["bodies"][name] = np.array([at.grown(each[name], 0, points) for each in per_body])
    shape = len(found), form.moments
    numbers = {name: np.full(shape, np.nan) for name in swarm_file.COUNTS}
    by_class = np.full((*shape, len(form.bounds) + 1), np.nan)
    motion = np.full((*shape, form.bodies, 6), np.nan)
    labels = np.full((*shape, form.bodies), -1, dtype=np.int32)
    bonds = [np.zeros((0, len(swarm_file.BONDS)), dtype=np.int32)]
    rows = [np.zeros((0, len(swarm_file.CLUSTERS)))]
    for row, own in enumerate(found):
        for place in range(form.moments):
            if moment_name(place) not in own:
                continue
            part = part_of(*own.read(moment_name(place)))
            for name, values in numbers.items():
                value = part.facts.get(name)
                values[row, place] = np.nan if value is None else value
            labels[row, place] = part.arrays["cluster"]
            left = labels[row, place] == swarm_file.GONE
            motion[row, place] = np.where(left[:, None], np.nan, part.arrays["motion"])
            by_class[row, place] = part.arrays["counts"]
            pairs = part.arrays["bonds"]
            where = np.broadcast_to(np.array([row, place], np.int32), (len(pairs), 2))
            bonds.append(np.concatenate([where, pairs], axis=1))
            known = part.arrays["clusters"]
            size = np.bincount(labels[row, place][labels[row, place] >= 0], minlength=len(known))
            where = np.broadcast_to(np.array([row, place]), (len(known), 2))
            rows.append(np.column_stack([where, np.arange(len(known)), size, known]))
    groups["counts"] = numbers | {"n_class": by_class}
    groups["snapshots"] = {
        "position": motion[..., :3], "velocity": motion[..., 3:], "cluster": labels,
    }  # fmt: skip
    groups["events"] = swarm_file.events_of(labels)
    together = np.concatenate(bonds)
    together = together[np.lexsort(together.T[::-1])]
    groups["bonds"] = dict(zip(swarm_file.BONDS, together.T.copy(), strict=True))
    groups["clusters"] = {
        name: column.astype(kind)
        for (name, (kind, _, _)), column in zip(
            swarm_file.CLUSTERS.items(), np.concatenate(rows).T, strict=True
        )
    }
    for name in swarm_file.ENDLESS:
        column = groups["clusters"][name]
        column[column < 0.0] = np.nan
    return groups


def appended(old: Groups, new: Groups) -> Groups:
    """The groups of some replicates, and of others behind them."""
    many = len(old["bodies"]["r_eq"])
    points = max(each["bodies"]["points"].shape[1] for each in (old, new))
    groups: Groups = {}
    for group, columns in new.items():
        groups[group] = {}
        for name, column in columns.items():
            parts = [old[group][name], column + many if name in PLACED else column]
            if name in swarm_file.POINTS | swarm_file.RINGS:
                parts = [at.grown(part, 1, points) for part in parts]
            groups[group][name] = np.concatenate(parts).astype(column.dtype)
    return groups


def results_from(
    form: Form, groups: Groups, run: Mapping[str, Any], replicates: np.ndarray | None = None
) -> swarm_file.SwarmResults:
    """The results of whole groups; ``replicates``: their numbers, 0, 1, … unless given."""
    count, points = groups["bodies"]["points"].shape[:2]
    scales = {
        "replicate": np.arange(count) if replicates is None else replicates,
        "time": np.array(form.times), "class": np.array([0.0, *form.bounds]),
        "body": np.arange(form.bodies), "component": np.array(swarm_file.COMPONENTS),
        "axis": np.array(swarm_file.AXES), "point": np.arange(points),
        "bond": np.arange(len(groups["bonds"]["bond_kind"])),
        "row": np.arange(len(groups["clusters"]["cluster_bodies"])),
        "event": np.arange(len(groups["events"]["event_time"])),
    }  # fmt: skip
    return swarm_file.SwarmResults(scales, groups, dict(run))
