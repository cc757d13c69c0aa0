"""Where the rows of finished replicates lie: in the journal, or in an older results file.

Nothing is believed of a journal but what the digest says that this run wrote or found there.

Rank 0 opens, locks and checks both. Other ranks read them by path (`SharedRows`): they take from it
where everything lies; what they read from the journal is checked chunk by chunk, and an older file
is known by its seal.
"""

import contextlib
import os
from collections import OrderedDict, defaultdict
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

import attrs
import numpy as np

from flocsim.ensembles.kind import (
    COLUMNS,
    ROW,
    Condition,
    Interval,
    merged,
    missing,
    rows_of,
    starts,
    total,
)
from flocsim.errors import FileError
from flocsim.io.records import Record
from flocsim.io.seals import digest_of

ENTRY = np.dtype([("first", "<i8"), ("stop", "<i8"), ("offset", "<i8"), ("digest", "V16")])
"""A run of rows: its replicates, where its data begin in the journal (−1: it is in the old file),
and their checksum."""


MOST_HELD = 2**25
"""Bytes of checked chunks that are kept for the next column."""


@attrs.frozen(eq=False)
class OldTable:
    """Rows of an older results file.

    ``columns`` {name: array}, each of which ends in the replicates; ``places``: Condition → its
    place in them; ``count``: replicates of each; ``run``: scalars of the file; ``more``: what else
    its kind of study takes from it; ``there``: which replicates there are of each condition, where
    these are not all; ``path``: of the file; ``before``: what `stamp` said of it before its
    checksum was found right.
    """

    columns: Mapping[str, Any]
    places: Mapping[Condition, tuple[int, ...]]
    count: int
    run: Mapping[str, Any] = attrs.Factory(dict)
    more: Any = None
    there: Mapping[Condition, list[Interval]] | None = None
    path: str = ""
    before: tuple | None = None

    def read(self, condition: Condition, first: int, stop: int, name: str) -> np.ndarray:
        """Values of a column; FileError where the open file has been written to meanwhile."""
        values = self.columns[name][(*self.places[condition], slice(first, stop))]
        now = stamp(self.path) if self.before else None
        # Another file of that name is none of ours: this one is open and cannot be reached.
        if self.before and now and now[0] == self.before[0] and now != self.before:
            raise FileError(
                f"{self.path} was changed by another program while it was extended: put the "
                "original back, and continue with --resume"
            )
        return values


def stamp(path: str) -> tuple | None:
    """What tells that a file is another one, or was written to; None where there is none."""
    try:
        about = os.stat(path)
    except OSError:
        return None
    return (about.st_dev, about.st_ino), about.st_size, about.st_mtime_ns


@attrs.define(eq=False)
class RowStore:
    """Finds rows by condition and replicate. Few bytes per chunk, none per row.

    ``journal``: a Journal, a MemoryJournal or a ReadOnlyJournal; ``row``: the type of a row;
    ``parts``: {(place of the condition, replicate): records of what was kept of it unfinished}.
    """

    journal: Any
    conditions: tuple[Condition, ...]
    row: np.dtype = ROW
    old: OldTable | None = None
    parts: dict[tuple[int, int], list[Record]] = attrs.Factory(lambda: defaultdict(list))
    starts: dict[str, int] = attrs.field(init=False)
    places: dict[Condition, int] = attrs.field(init=False)
    entries: list[np.ndarray] = attrs.field(init=False)
    counts: list[int] = attrs.field(init=False)
    held: "OrderedDict[int, bytes]" = attrs.field(init=False, factory=OrderedDict)
    """The chunks that were checked last: where one lies, and its data."""
    held_size: int = 0

    def __attrs_post_init__(self):
        self.starts = starts(self.row)
        self.places = {condition: place for place, condition in enumerate(self.conditions)}
        self.entries = [np.empty(4, ENTRY) for _ in self.conditions]
        self.counts = [0] * len(self.conditions)

    def add(self, place: int, first: int, stop: int, offset: int, digest: bytes = b"") -> None:
        """Note where rows of the condition at a place of the list lie."""
        count = self.counts[place]
        if count == len(self.entries[place]):
            self.entries[place] = np.concatenate([self.entries[place]] * 2)
        self.entries[place][count] = (first, stop, offset, digest)
        self.counts[place] = count + 1

    def add_chunk(
        self, record: Record, place: int, check: Callable[[dict[str, np.ndarray]], object]
    ) -> None:
        """Note where the rows of a chunk in the journal lie, which ``check`` may refuse."""
        about, data = record.description, self.journal.read(record.offset, record.length)
        check(rows_of(data, self.row))
        first = about["first"]
        self.add(place, first, first + about["count"], record.offset, record.digest)

    def known(self, place: int) -> np.ndarray:
        """The entries of a condition, in order of the replicates."""
        found = self.entries[place][: self.counts[place]]
        return found[np.lexsort((found["stop"], found["first"]))]

    def intervals(self, place: int, in_journal: bool = False) -> list[Interval]:
        """The replicates of a condition that exist, or those of them that the journal has."""
        known = self.known(place)
        known = known[known["offset"] >= 0] if in_journal else known
        return merged([(int(e["first"]), int(e["stop"])) for e in known])

    def there(self, in_journal: bool = False) -> int:
        """How many replicates exist, or how many of them the journal has."""
        places = range(len(self.conditions))
        return sum(total(self.intervals(place, in_journal)) for place in places)

    def read(
        self, place: int, name: str, first: int, stop: int, known: np.ndarray | None = None
    ) -> np.ndarray:
        """The values of a column for replicates [first, stop), all of which exist.

        FileError where a chunk is not what was written.
        """
        values = np.empty(stop - first, self.row[name])
        known = self.known(place) if known is None else known
        for low, high, part in self.pieces(place, first, stop, known):
            values[low - first : high - first] = part(name)
        return values

    def rows(
        self, place: int, first: int, stop: int, known: np.ndarray
    ) -> Iterator[tuple[int, dict[str, np.ndarray]]]:
        """(first replicate, {column: values}) of runs of rows that make up [first, stop).

        Every chunk's checksum is held against what is read: FileError where it is wrong, or
        where rows are missing.
        """
        reached = []
        for low, high, part in self.pieces(place, first, stop, known):
            reached.append((low, high))
            yield low, {name: part(name) for name in self.starts}
        if missing(merged(reached), first, stop):
            raise FileError(
                f"{self.journal.path} does not have all rows: run it again with --resume"
            )

    def pieces(
        self, place: int, first: int, stop: int, known: np.ndarray
    ) -> Iterator[tuple[int, int, Callable[[str], np.ndarray]]]:
        """(first, stop, the values of a column) of the runs of rows that lie in [first, stop)."""
        for start, end, offset, digest in near(known, first, stop).tolist():
            low, high = max(start, first), min(end, stop)
            if low < high and offset < 0:
                assert self.old is not None, "rows of an older file, which is open"
                condition = self.conditions[place]
                yield low, high, partial(self.old.read, condition, low, high)
            elif low < high:
                yield low, high, partial(self.column, (start, end), offset, digest, (low, high))

    def column(self, chunk, offset, digest, wanted, name):
        """The values of a column that a chunk in the journal has of the wanted replicates."""
        (start, end), (low, high), kind = chunk, wanted, self.row[name]
        data = self.checked(offset, (end - start) * self.row.itemsize, digest)
        begin = (end - start) * self.starts[name] + (low - start) * kind.itemsize
        return np.frombuffer(data, kind, high - low, begin)

    def checked(self, offset, length, digest):
        """The data of a chunk, as they were written; the last ones are held."""
        if offset not in self.held:
            data = self.journal.read(offset, length)
            if len(data) != length or digest_of(data, len(digest)) != digest:
                raise FileError(
                    f"{self.journal.path} is damaged from byte {offset} to {offset + length}, or "
                    "was changed after it was written: run it again with --resume, which computes "
                    "what is missing"
                )
            self.held[offset] = data
            self.held_size += length
            while self.held_size > MOST_HELD and len(self.held) > 1:
                self.held_size -= len(self.held.popitem(last=False)[1])
        self.held.move_to_end(offset)
        return self.held[offset]


def longest(known: np.ndarray) -> int:
    """Replicates of the longest of the entries of a condition."""
    return int(np.max(known["stop"] - known["first"], initial=0))


def near(known: np.ndarray, first: int, stop: int, length: int | None = None) -> np.ndarray:
    """Those of the entries of a condition, in order, that may hold some of [first, stop).

    ``length``: that of the longest, where it is known.
    """
    length = longest(known) if length is None else length
    return known[slice(*known["first"].searchsorted((first - length, stop)))]


SEAL_END = 64
"""Bytes at the end of a sealed file that tell it from any other."""


def open_to_read(path: str) -> int:
    """A descriptor of a file; FileError where this machine does not have it."""
    try:
        return os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0))
    except OSError as error:
        raise FileError(f"{path} cannot be read here: {error.strerror}") from error


class ReadOnlyJournal:
    """The journal of a finished run, to read from; ``resources`` are closed with it."""

    def __init__(self, path: str) -> None:
        self.path = path
        self.resources = contextlib.ExitStack()
        self.descriptor = open_to_read(path)
        self.resources.callback(os.close, self.descriptor)

    def __enter__(self) -> "ReadOnlyJournal":
        return self

    def __exit__(self, *_: object) -> None:
        self.resources.close()

    def read(self, offset: int, length: int) -> bytes:
        return os.pread(self.descriptor, length, offset)


@attrs.frozen(eq=False)
class Column:
    """The values of a dataset as they lie in an open file, one after the other."""

    descriptor: int
    name: str
    offset: int
    shape: tuple[int, ...]

    def __getitem__(self, at: tuple) -> np.ndarray:
        *place, part = at
        start = int(np.ravel_multi_index(place, self.shape[:-1])) * self.shape[-1]
        kind, count = ROW[self.name], part.stop - part.start
        offset = self.offset + (start + part.start) * kind.itemsize
        data = os.pread(self.descriptor, count * kind.itemsize, offset)
        return np.frombuffer(data, kind)


@attrs.frozen(eq=False)
class OldColumns:
    """Where the columns of an older results file lie, and how it ends.

    ``written``: its size and time as rank 0 saw them before it checked the seal.
    """

    path: str
    ending: bytes
    offsets: Mapping[str, int]
    shape: tuple[int, ...]
    places: Mapping[Condition, tuple[int, ...]]
    written: tuple | None

    def opened(self, resources: contextlib.ExitStack) -> OldTable:
        """The table in that file, open until the resources are closed; FileError if it is not
        the same file here."""
        descriptor = open_to_read(self.path)
        resources.callback(os.close, descriptor)
        now = stamp(self.path)
        changed = self.written is not None and (now is None or now[1:] != self.written)
        if changed or ending_of(descriptor) != self.ending:
            raise FileError(f"{self.path} is a different file here")
        columns = {
            name: Column(descriptor, name, offset, self.shape)
            for name, offset in self.offsets.items()
        }
        return OldTable(columns, self.places, self.shape[-1], path=self.path, before=now)


def ending_of(descriptor):
    size = os.fstat(descriptor).st_size
    return os.pread(descriptor, SEAL_END, max(size - SEAL_END, 0))


def old_columns(table: OldTable) -> OldColumns | None:
    """Where others find the rows of an open table; None where these do not lie in a row."""
    offsets, shape = {}, table.columns[COLUMNS[0]].shape
    for name in COLUMNS:
        dataset = table.columns[name]
        if dataset.offset is None or dataset.dtype != ROW[name] or dataset.shape != shape:
            return None
        offsets[name] = dataset.offset
    path = os.path.realpath(table.path)
    try:
        descriptor = open_to_read(path)
    except FileError:
        return None
    with contextlib.ExitStack() as resources:
        resources.callback(os.close, descriptor)
        written = table.before[1:] if table.before else None
        return OldColumns(path, ending_of(descriptor), offsets, shape, table.places, written)
