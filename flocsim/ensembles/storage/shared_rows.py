"""The journal and an older results file as ranks other than 0 read them, by path.

Rank 0 has opened, locked and checked both. Others take from it where everything lies; what they
read from the journal is checked chunk by chunk, and an older file is known by its seal.
"""

import contextlib
import os
from collections.abc import Mapping

import attrs
import numpy as np

from flocsim.ensembles.chunks import COLUMNS, ROW, Condition
from flocsim.ensembles.storage.row_store import OldTable, stamp
from flocsim.errors import FileError

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
            raise FileError(f"{self.path} is another file here")
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
        offset = dataset.id.get_offset()
        if offset is None or dataset.dtype != ROW[name] or dataset.shape != shape:
            return None
        offsets[name] = offset
    path = os.path.realpath(table.path)
    try:
        descriptor = open_to_read(path)
    except FileError:
        return None
    with contextlib.ExitStack() as resources:
        resources.callback(os.close, descriptor)
        written = table.before[1:] if table.before else None
        return OldColumns(path, ending_of(descriptor), offsets, shape, table.places, written)
