"""How a results file is written: its groups, their coordinates, and the rows of all replicates.

Rank 0 writes it with h5py, rows a part at a time, so that memory stays flat. h5py writes to a file
object of Python's: a full disk that HDF5 itself meets can end the process.
"""

import io
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, BinaryIO

import numpy as np

from flocsim.errors import UsageError
from flocsim.io.files import Rule, keep, unfinished
from flocsim.io.groups import write_labelled
from flocsim.io.results.schema import FLOCS, REPLICATES, Results
from flocsim.io.seals import seal_file

FORMAT = "flocsim results"
SCHEMA_VERSION = 7

MOST_VALUES = 32_768
"""Rows that are written at a time, 4.6 MB."""

Part = Callable[[Sequence[slice]], Any]
"""Gives the rows of a part of the table (type, vertices, delta, replicate), an array by column."""


class Unfailing(io.RawIOBase):
    """An open file as HDF5 sees it: no write fails, as HDF5 may crash where one does; the first
    error is kept, and nothing is written after it."""

    def __init__(self, file: BinaryIO) -> None:
        self.file = file
        self.error: OSError | None = None

    def readable(self):
        return True

    writable = seekable = readable

    def seek(self, offset, whence=io.SEEK_SET):
        return self.file.seek(offset, whence)

    def tell(self):
        return self.file.tell()

    def readinto(self, buffer):
        return self.file.readinto(buffer)

    def write(self, data):
        try:
            if self.error is None:
                self.file.write(data)
        except OSError as error:
            self.error = error
        return len(data)

    def truncate(self, size=None):
        try:
            if self.error is None:
                self.file.truncate(size)
        except OSError as error:
            self.error = error
        return size


def write_results(
    path: str | os.PathLike, results: Results, rule: Rule = keep, part: Part | None = None
) -> None:
    """Write ``results`` to ``path``, whole or not at all; FileError if that is impossible.

    ``part`` gives rows where they are not in the results. ``rule`` says what becomes of a file that
    is there.
    """
    with unfinished(path, rule) as (_, file):
        unfailing = Unfailing(file)
        try:
            write_groups(unfailing, results, {}, part)
        except Exception:
            if unfailing.error is None:
                raise
        if unfailing.error is not None:
            raise unfailing.error
        seal_file(file)


def image_of(results: Results, attributes: Mapping[str, Any]) -> io.BytesIO:
    """A whole results file in memory, with further attributes, and without a seal."""
    image = io.BytesIO()
    write_groups(image, results, attributes)
    return image


def write_groups(
    image: Any, results: Results, attributes: Mapping[str, Any], part: Part | None = None
) -> None:
    """Write a file of Results into an open file; rows that are not in them as ``part`` gives
    them."""
    import h5py

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
        if part is None:
            write_labelled(group, labelled)
        else:
            write_labelled(group, labelled, empty_dataset, tuple(REPLICATES))
            for where in parts_of((*results.shape, results.count), MOST_VALUES):
                rows = part(where)
                for name in REPLICATES:
                    group[name][tuple(where)] = rows[name]
        # Last, so that its length moves no byte of the groups before it.
        write_run(file, results)


def parts_of(shape: Sequence[int], most: int) -> Iterator[list[slice]]:
    """Cut an array into parts of at most so many values, in order."""
    inner = int(np.prod(shape[1:]))
    step = 1 if len(shape) > 1 and inner > most else max(most // max(inner, 1), 1)
    for first in range(0, shape[0], step):
        own = slice(first, min(first + step, shape[0]))
        rest = parts_of(shape[1:], most) if inner > most else [[slice(0, n) for n in shape[1:]]]
        for each in rest:
            yield [own, *each]


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
