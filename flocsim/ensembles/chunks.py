"""Chunks: runs of replicates of one condition, the unit of handing out, writing and resuming.

A row is what a finished replicate comes to, of the columns of its kind of study; those of pairs
are ROW. What is kept of an unfinished one goes into records of its own.

Replicates of one condition are kept as intervals: sorted, disjoint pairs [first, stop).
"""

import json
from collections.abc import Iterable
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from flocsim.errors import visible
from flocsim.io.records import CHUNK, SNAPSHOT, encode, matches
from flocsim.io.results.run_group import NOTE
from flocsim.io.results.schema import REPLICATES

MOST_ROWS = 16_384
"""Rows of the longest chunk, 2.3 MB."""

ROW = np.dtype([(name, f"<{kind}") for name, (kind, _, _) in REPLICATES.items()])
"""One replicate: its row of the results file."""

COLUMNS = tuple(REPLICATES)

DESCRIPTION = {
    "type": str, "vertices": int, "delta": float, "first": int, "count": int, "identity": str
}  # fmt: skip
"""A chunk's, as a pattern."""

KEPT = {"type": str, "vertices": int, "delta": float, "replicate": int, "identity": str}
"""Of what is kept of an unfinished replicate, likewise."""

LARGEST_REPLICATE = 2**40

ORDER = ("types", "vertices", "delta")
"""Axes of the conditions of a study, as what was asked for names them."""

Interval = tuple[int, int]


class Condition(NamedTuple):
    """A condition by its name: collision type, number of vertices, share of δ_max."""

    type: str
    vertices: int
    delta: float


def places_in(*axes: Iterable) -> dict[Condition, tuple[int, ...]]:
    """Where each condition stands in arrays along these types, numbers of vertices and δ."""
    found = product(*map(enumerate, axes))
    return {
        Condition(str(name), int(n), float(share)): (t, v, d)
        for (t, name), (v, n), (d, share) in found
    }


class Chunk(NamedTuple):
    """Replicates ``first`` to ``stop`` − 1 of the condition at a place of the study's list; where
    there is one alone, ``left``: where it goes on."""

    condition: int
    first: int
    stop: int
    left: Any = None


def chunk_record(
    condition: Condition, first: int, rows: np.ndarray, identity: str, notes: Iterable[dict] = ()
) -> bytes:
    """The record of finished rows, for the journal: column by column.

    ``identity`` is the digest of all that the rows follow from; ``notes`` tell of failed ones.
    """
    description = {**condition._asdict(), "first": first, "count": len(rows), "identity": identity}
    if notes:
        description["notes"] = list(notes)
    return encode(CHUNK, description, b"".join(rows[name].tobytes() for name in starts(rows.dtype)))


def kept_record(
    condition: Condition, replicate: int, description: dict, data: bytes, identity: str
) -> bytes:
    """The record of what is kept of an unfinished replicate."""
    about = {**condition._asdict(), "replicate": replicate, "identity": identity}
    return encode(SNAPSHOT, about | description, data)


def condition_of(description: dict) -> Condition:
    return Condition(description["type"], description["vertices"], description["delta"])


def is_chunk(description: dict | None) -> bool:
    """Whether a record's description, whoever wrote it, can be that of a chunk."""
    if not matches(description, DESCRIPTION):
        return False
    assert description is not None, "it has keys"
    first, count = description["first"], description["count"]
    return (
        0 <= first < first + count <= LARGEST_REPLICATE
        and matches(description.get("notes", []), [NOTE])
    )  # fmt: skip


def named(description: dict | None) -> str:
    """A chunk for messages: "type I, N = 4, delta 0.5, replicates 0 to 63"."""
    if not is_chunk(description):
        return "what it held is unknown"
    assert description is not None, "it is a chunk's"
    last = description["first"] + description["count"] - 1
    name = visible(description["type"], keep="")
    return (
        f"type {name}, N = {description['vertices']}, delta "
        f"{description['delta']:g}, replicates {description['first']} to {last}"
    )


def fits(description: dict, length: int, row: np.dtype = ROW) -> bool:
    """Whether a description is that of a chunk, and its data are as long as it says."""
    return is_chunk(description) and length == description["count"] * row.itemsize


def rows_of(data: bytes, row: np.dtype = ROW) -> dict[str, np.ndarray]:
    """{column: values} of a chunk's data."""
    count = len(data) // row.itemsize
    return {name: np.frombuffer(data, row[name], count, count * start)
            for name, start in starts(row).items()}  # fmt: skip


def starts(row: np.dtype) -> dict[str, int]:
    """Column → bytes of a row that lie in the columns before it: a chunk holds them one by one."""
    return {name: about[1] for name, about in (row.fields or {}).items()}


def layout(row: np.dtype = ROW) -> str:
    """The columns of a chunk as text, to tell another version's."""
    return json.dumps([[name, row[name].str] for name in starts(row)])


def merged(intervals: Iterable[Interval]) -> list[Interval]:
    """The union of intervals [first, stop), sorted and disjoint."""
    union: list[Interval] = []
    for first, stop in sorted(intervals):
        if union and first <= union[-1][1]:
            union[-1] = (union[-1][0], max(stop, union[-1][1]))
        elif first < stop:
            union.append((first, stop))
    return union


def missing(intervals: Iterable[Interval], first: int, stop: int) -> list[Interval]:
    """What a union leaves out of [first, stop)."""
    gaps, place = [], first
    for start, end in intervals:
        if start >= stop:
            break
        if start > place:
            gaps.append((place, start))
        place = max(place, end)
    if place < stop:
        gaps.append((place, stop))
    return gaps


def total(intervals: Iterable[Interval]) -> int:
    return sum(stop - first for first, stop in intervals)
