"""How a results file is laid out: its groups, their coordinates, and where large values go.

HDF5 lays out the large datasets and writes all that describes them, into a SparseImage; their
values go to the disk without it (`row_file`). So memory stays flat, and a full disk is never
met inside HDF5, where it can end the process.
"""

import io
from collections.abc import Mapping
from typing import Any

import attrs
import numpy as np

from flocsim.errors import UsageError
from flocsim.io.groups import write_labelled
from flocsim.io.results.schema import FLOCS, REPLICATES, Results

FORMAT = "flocsim results"
SCHEMA_VERSION = 7


PAGE = 16_384


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
    import h5py

    frame = Frame()
    with h5py.File(frame.image, "w") as file:
        write_tables(file, results)
        frame.streams = reserve_replicates(file, results)
        # Last, so that its length moves no byte of the groups before it.
        write_run(file, results)
    return frame


def image_of(results: Results, attributes: Mapping[str, Any]) -> io.BytesIO:
    """A whole results file in memory, with further attributes, and without a seal."""
    import h5py

    image = io.BytesIO()
    with h5py.File(image, "w") as file:
        write_tables(file, results)
        write_labelled(file.create_group("replicates"), results.labelled("replicates"))
        write_run(file, results)
        file.attrs.update(attributes)
    return image


def write_tables(file, results):
    """All groups but the replicates and where they came from."""
    file.attrs.update({"format": FORMAT, "schema_version": SCHEMA_VERSION})
    for name in ("probabilities", "pooled", "differences", "numerics", "outlines"):
        if getattr(results, name):
            write_labelled(file.create_group(name), results.labelled(name))
    if results.kernel is not None:
        write_labelled(file.create_group("kernel"), results.kernel.labelled())
    if results.flocs:
        write_labelled(file.create_group("flocs"), FLOCS.labelled({"floc": results.flocs}))


def write_run(file, results):
    """The group of what the results came from."""
    group = file.create_group("run")
    for name, value in results.run.items():
        value = value.item() if isinstance(value, np.generic) else value
        if not isinstance(value, str | int | float):
            raise UsageError(f"run/{name} must be text or a number, found {value!r}")
        # A bool would become an HDF5 enumeration, which few readers know.
        group[name] = int(value) if isinstance(value, bool) else value


def reserve_replicates(file, results):
    """The group of replicates, all but its values; where in the file they go."""
    labelled, streamed = results.labelled("replicates"), ("replicate", *REPLICATES)
    group = file.create_group("replicates")
    datasets = write_labelled(group, labelled, empty_dataset, streamed)
    file.flush()
    return [
        (dataset.id.get_offset(), dataset.nbytes, name)
        for dataset in datasets
        if (name := dataset.name.rsplit("/", 1)[1]) in streamed and dataset.nbytes
    ]


def empty_dataset(group, name, values):
    """A dataset with its place in the file, whose values HDF5 does not write."""
    import h5py

    plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plan.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    plan.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    little = values.dtype.newbyteorder("<")
    return group.create_dataset(name, values.shape, little, dcpl=plan)
