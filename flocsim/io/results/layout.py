"""How a results file is laid out and written: its groups, their coordinates, and where values go.

HDF5 lays out the large datasets and writes all that describes them, into a SparseImage; their
values go to the disk without it. So memory stays flat, and a full disk is never met inside HDF5,
where it can end the process.

Rows are written by several processes at once, as where each value goes is known before any value.
They are counted through all conditions in the order of the file; ROWS of them are a *block*, and
the part of a block that lies in one column is a piece of the seal (`flocsim.io.seals`): whoever
writes a block seals it as well. What is between the columns, and the tables, come last, from the
process that began the file; until then it starts with a token, by which others know that they see
the same file, and is no HDF5 file.
"""

import contextlib
import io
import os
import secrets
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import attrs
import numpy as np

from flocsim.errors import FileError, UsageError
from flocsim.io.files import Rule, keep, reserve, unfinished
from flocsim.io.groups import write_labelled
from flocsim.io.results.schema import FLOCS, REPLICATES, Results
from flocsim.io.seals import PIECE, digest_of, seal_of_pieces, seal_size

FORMAT = "flocsim results"
SCHEMA_VERSION = 7


PAGE = 16_384

ROWS = 32_768
"""Rows of a block, 3.7 MB."""

NUMBERS = "replicate"
"""The column of replicates' numbers, which is as long as one condition."""

TOKEN_SIZE = 32


class SparseImage(io.RawIOBase):
    """A file in memory of which only what is written takes space, in pages of PAGE bytes; h5py
    takes it for a file."""

    def __init__(self):
        self.pages = {}
        self.length = 0
        self.place = 0

    def readable(self):
        return True

    writable = seekable = readable

    def seek(self, offset, whence=io.SEEK_SET):
        self.place = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self.place}.get(whence, self.length)
        return self.place

    def tell(self):
        return self.place

    def write(self, data):
        data = bytes(data)
        for number, inside, part in self.pieces(self.place, self.place + len(data)):
            self.pages.setdefault(number, bytearray(PAGE))[inside] = data[part]
        self.place += len(data)
        self.length = max(self.length, self.place)
        return len(data)

    def readinto(self, buffer):
        """Bytes at the place, zero where nothing was written."""
        stop = min(self.place + len(buffer), self.length)
        data = self.content(self.place, stop)
        buffer[: len(data)] = data
        self.place += len(data)
        return len(data)

    def truncate(self, size=None):
        self.length = self.place if size is None else size
        return self.length

    def content(self, start, stop):
        """The bytes [start, stop), as the last writes have left them."""
        found = bytearray(max(stop - start, 0))
        for number, inside, part in self.pieces(start, stop):
            if number in self.pages:
                found[part] = self.pages[number][inside]
        return bytes(found)

    @staticmethod
    def pieces(start, stop):
        """(number of a page, slice of it, slice of these bytes) for the bytes [start, stop)."""
        for number in range(start // PAGE, -(-stop // PAGE)):
            low, high = max(start, number * PAGE), min(stop, (number + 1) * PAGE)
            inside = slice(low - number * PAGE, high - number * PAGE)
            yield number, inside, slice(low - start, high - start)


@attrs.define
class Frame:
    """A results file but for the values of its large datasets.

    ``streams``: (offset in the file, length [bytes], name) of each of those.
    """

    image: SparseImage = attrs.Factory(SparseImage)
    streams: list[tuple[int, int, str]] = attrs.Factory(list)


def frame_of(results: Results) -> Frame:
    """The Frame of Results, the same bytes whenever the results are."""
    frame = Frame()
    frame.streams = write_groups(frame.image, results, empty_dataset)
    return frame


def write_groups(image, results, create):
    """Write a file of Results into an image; of the table of replicates, whose datasets are made by
    ``create``, [(offset, length [bytes], name)]."""
    import h5py

    streamed = ("replicate", *REPLICATES)
    with h5py.File(image, "w") as file:
        file.attrs.update({"format": FORMAT, "schema_version": SCHEMA_VERSION})
        for name in ("probabilities", "pooled", "differences", "numerics", "outlines"):
            if getattr(results, name):
                write_labelled(file.create_group(name), results.labelled(name))
        if results.kernel is not None:
            write_labelled(file.create_group("kernel"), results.kernel.labelled())
        if results.flocs:
            write_labelled(file.create_group("flocs"), FLOCS.labelled({"floc": results.flocs}))
        group, labelled = file.create_group("replicates"), results.labelled("replicates")
        datasets = write_labelled(group, labelled, create, streamed)
        file.flush()
        # Last, so that its length moves no byte of the groups before it.
        write_run(file, results)
        named = [(each, each.name.rsplit("/", 1)[1]) for each in datasets if each.nbytes]
        return [
            (each.id.get_offset(), each.nbytes, name) for each, name in named if name in streamed
        ]


def write_run(file, results):
    """The group of what the results came from."""
    group = file.create_group("run")
    for name, value in results.run.items():
        value = value.item() if isinstance(value, np.generic) else value
        if not isinstance(value, str | int | float):
            raise UsageError(f"run/{name} must be text or a number, found {value!r}")
        # A bool would become an HDF5 enumeration, which few readers know.
        group[name] = int(value) if isinstance(value, bool) else value


def empty_dataset(group, name, values):
    """A dataset with its place in the file, whose values HDF5 does not write."""
    import h5py

    plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plan.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    plan.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    little = values.dtype.newbyteorder("<")
    return group.create_dataset(name, values.shape, little, dcpl=plan)


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
    with unfinished(path, rule) as (beside, file):
        token, descriptor = secrets.token_bytes(TOKEN_SIZE), file.fileno()
        reserve(descriptor, plan.size + seal_size(len(plan.cuts())))
        write_all(descriptor, memoryview(token), 0)
        yield RowFile(os.fspath(beside), token, plan, descriptor, draft, frame)


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
