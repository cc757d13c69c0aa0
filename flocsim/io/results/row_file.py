"""A results file while its rows are written, by several processes at once.

Where each value goes is known before any value (`layout`). Rows are counted through all
conditions in the order of the file; ROWS of them are a *block*, and the part of a block that lies
in one column is a piece of the seal (`flocsim.io.seals`): whoever writes a block seals it as well.
What is between the columns, and the tables, come last, from the process that began the file; until
then it starts with a token, by which others know that they see the same file, and is no HDF5 file.
"""

import contextlib
import os
import secrets
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import attrs
import numpy as np

from flocsim.errors import FileError
from flocsim.io.files import Rule, keep, reserve, unfinished
from flocsim.io.results.layout import Frame, frame_of
from flocsim.io.results.schema import REPLICATES, Results
from flocsim.io.seals import PIECE, digest_of, seal_of_pieces, seal_size

ROWS = 32_768
"""Rows of a block, 3.7 MB."""

NUMBERS = "replicate"
"""The column of replicates' numbers, which is as long as one condition."""

TOKEN_SIZE = 32


@attrs.frozen(eq=False)
class Plan:
    """Where everything goes: ``columns`` {name: (offset, bytes of a value, values)}.

    ``size``: bytes of the file without its seal; ``rows``: of all conditions together.
    """

    size: int
    rows: int
    columns: dict[str, tuple[int, int, int]]

    @property
    def blocks(self) -> int:
        return -(-self.rows // ROWS)

    def pieces_of(self, block: int) -> list[tuple[str, int, int]]:
        """(column, first value, values) of a block: which pieces it is made of."""
        start = block * ROWS
        ends = ((name, min(start + ROWS, count)) for name, (_, _, count) in self.columns.items())
        return [(name, start, end - start) for name, end in ends if start < end]

    def cuts(self) -> np.ndarray:
        """The table (PIECE) of the whole file, without digests; frame and columns in order."""
        lengths, place = [], 0
        for offset, size, count in self.in_order():
            lengths += [offset - place] if offset > place else []
            lengths += [size * min(ROWS, count - first) for first in range(0, count, ROWS)]
            place = offset + size * count
        lengths += [self.size - place] if self.size > place else []
        table = np.zeros(len(lengths), PIECE)
        table["length"] = lengths
        return table

    def in_order(self) -> list[tuple[int, int, int]]:
        return sorted(self.columns.values())

    def gaps(self) -> Iterator[tuple[int, int]]:
        """[start, stop) of all that is not in a column."""
        place = 0
        for offset, size, count in self.in_order():
            if offset > place:
                yield place, offset
            place = offset + size * count
        if self.size > place:
            yield place, self.size


def plan_of(frame, rows):
    """The Plan of a Frame."""
    kinds = {name: np.dtype(about[0]).itemsize for name, about in REPLICATES.items()}
    kinds[NUMBERS] = 8
    # The shorter one last, so that the others have the same place in every block.
    streams = sorted(frame.streams, key=lambda stream: stream[2] == NUMBERS)
    columns = {
        name: (offset, kinds[name], length // kinds[name]) for offset, length, name in streams
    }
    return Plan(frame.image.length, rows, columns)


@attrs.define(eq=False)
class RowFile:
    """An open file to which rows go, by any process that sees it; who has begun it has the
    ``draft`` and its ``frame``."""

    path: str
    token: bytes
    plan: Plan
    descriptor: int
    draft: Results | None = None
    frame: Frame | None = None

    def write_block(self, block: int, columns: Mapping[str, np.ndarray]) -> list[bytes]:
        """Write a block's rows, the values of each column; the digests of its pieces in order."""
        digests = []
        for name, first, count in self.plan.pieces_of(block):
            offset, size, _ = self.plan.columns[name]
            if name == NUMBERS:
                values = np.arange(first, first + count, dtype="<i8")
            else:
                values = np.ascontiguousarray(columns[name])
            data = values.reshape(-1).view("u1").data
            if len(data) != size * count:
                raise ValueError(f"{name} of block {block} has {len(data)} bytes")
            write_all(self.descriptor, data, offset + first * size)
            digests.append(digest_of(data))
        return digests

    def is_whole(
        self, block: int, digests: Sequence[bytes], columns: Sequence[str] | None = None
    ) -> bool:
        """Whether a block, or its part in some columns, stands in the file as it was written."""
        pieces = {name: (first, count) for name, first, count in self.plan.pieces_of(block)}
        return all(
            digest_of(self.bytes_of(name, *pieces[name])) == digest
            for name, digest in zip(columns or pieces, digests, strict=True)
        )

    def values(self, column: str, first: int, count: int) -> np.ndarray:
        """Values of a column of the table of replicates, from the file."""
        return np.frombuffer(self.bytes_of(column, first, count), f"<{REPLICATES[column][0]}")

    def bytes_of(self, column, first, count):
        offset, size, _ = self.plan.columns[column]
        return os.pread(self.descriptor, size * count, offset + first * size)

    def sync(self) -> None:
        os.fsync(self.descriptor)

    def complete(self, results: Results, digests: Mapping[int, list[bytes]]) -> None:
        """Write all that is not in a column, and the seal; ``digests`` are those of each block."""
        frame = self.frame if results is self.draft and self.frame else frame_of(results)
        plan = plan_of(frame, self.plan.rows)
        if (plan.size, plan.columns) != (self.plan.size, self.plan.columns):
            raise ValueError("the tables have displaced the columns")
        table = plan.cuts()
        starts = np.concatenate([[0], np.cumsum(table["length"][:-1], dtype=np.int64)])
        number = {int(start): place for place, start in enumerate(starts)}
        for column, (offset, _, count) in enumerate(plan.columns.values()):
            first, blocks = number[offset], -(-count // ROWS)
            found = b"".join(digests[block][column] for block in range(blocks))
            table["digest"][first : first + blocks] = np.frombuffer(found, "V32")
        for start, stop in plan.gaps():
            data = frame.image.content(start, stop)
            table["digest"][number[start]] = digest_of(data)
            write_all(self.descriptor, memoryview(data), start)
        write_all(self.descriptor, memoryview(seal_of_pieces(table)), plan.size)


def write_all(descriptor: int, data: memoryview, place: int) -> None:
    while data:
        written = os.pwrite(descriptor, data, place)
        data, place = data[written:], place + written


@contextlib.contextmanager
def new_row_file(path: str | Path, draft: Results, rule: Rule = keep) -> Iterator[RowFile]:
    """A RowFile that takes its place at ``path`` when it is left, or never; FileError.

    ``draft``: Results as they will be, but for the values in tables and columns. The space is
    taken at once, so that a full disk is found before anything is computed. ``rule`` says what
    becomes of a file that is there.
    """
    frame = frame_of(draft)
    plan = plan_of(frame, int(np.prod(draft.shape)) * draft.count)
    with unfinished(path, rule) as new:
        token = secrets.token_bytes(TOKEN_SIZE)
        reserve(new.file.fileno(), plan.size + seal_size(len(plan.cuts())))
        write_all(new.file.fileno(), memoryview(token), 0)
        yield RowFile(os.fspath(new.path), token, plan, new.file.fileno(), draft, frame)


@contextlib.contextmanager
def shared_row_file(path: str, token: bytes, plan: Plan) -> Iterator[RowFile]:
    """The RowFile that another process has begun; FileError where this one does not see it."""
    try:
        descriptor = os.open(path, os.O_RDWR | getattr(os, "O_NOFOLLOW", 0))
    except OSError as error:
        raise FileError(f"{path} cannot be seen here: {error.strerror}") from error
    try:
        if os.pread(descriptor, TOKEN_SIZE, 0) != token:
            raise FileError(f"{path} is a different file here: the ranks share no file system")
        yield RowFile(path, token, plan, descriptor)
    finally:
        os.close(descriptor)
