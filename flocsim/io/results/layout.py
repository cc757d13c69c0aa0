"""How a results file is laid out: its groups, their coordinates, and where large values go.

HDF5 lays out the large datasets and writes all that describes them, into a SparseImage; their
values go to the disk without it (`row_file`). So memory stays flat, and a full disk is never
met inside HDF5, where it can end the process.
"""

import io

import attrs
import numpy as np

from flocsim.errors import UsageError
from flocsim.io.results.kernel_group import write_kernel
from flocsim.io.results.schema import (
    AXES,
    COORDINATES,
    DIFFERENCES,
    EVENTS,
    FLAGS,
    LAST_AXES,
    POOLED,
    RADII,
    REPLICATES,
    TABLE,
    Results,
    last_axis,
)

FORMAT = "flocsim results"
SCHEMA_VERSION = 5


class SparseImage(io.RawIOBase):
    """A file in memory of which only what is written takes space; h5py takes it for a file."""

    def __init__(self):
        self.writes = []
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
        self.writes.append((self.place, data))
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
        """The bytes [start, stop), as a later write has left them."""
        found = bytearray(max(stop - start, 0))
        for place, data in self.writes:
            low, high = max(place, start), min(place + len(data), stop)
            if low < high:
                found[low - start : high - start] = data[low - place : high - place]
        return bytes(found)


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
        file.attrs.update({"format": FORMAT, "schema_version": SCHEMA_VERSION})
        study = {"type": list(results.types), "vertices": results.vertices, "delta": results.delta}
        lists = {axis: list(words) for axis, words in LAST_AXES.items()}
        write_group(file, "probabilities", results.probabilities, TABLE, AXES, study | lists)
        write_radii(file["probabilities"], results)
        if results.pooled:
            write_group(file, "pooled", results.pooled, POOLED, AXES[:2], study)
            write_radii(file["pooled"], results)
        if results.differences:
            axes = ("against", "event", *AXES)
            more = {"against": list(AXES), "event": list(EVENTS)}
            write_group(file, "differences", results.differences, DIFFERENCES, axes, study | more)
        if results.kernel is not None:
            write_kernel(file, results.kernel)
        if results.flocs:
            write_coordinate(file.create_group("flocs"), "floc", list(results.flocs))
        frame.streams = reserve_replicates(file, study, results)
        # Last, so that its length moves no byte of the groups before it.
        group = file.create_group("run")
        for name, value in results.run.items():
            value = value.item() if isinstance(value, np.generic) else value
            if not isinstance(value, str | int | float):
                raise UsageError(f"run/{name} must be text or a number, found {value!r}")
            # A bool would become an HDF5 enumeration, which few readers know.
            group[name] = int(value) if isinstance(value, bool) else value
    return frame


def write_group(file, name, arrays, schema, axes, coordinates):
    group = file.create_group(name)
    lasts = {variable: (last_axis(variable),) for variable in schema if last_axis(variable)}
    for axis in dict.fromkeys((*axes, *(axis for last in lasts.values() for axis in last))):
        write_coordinate(group, axis, coordinates[axis])
    for variable, about in schema.items():
        dataset = group.create_dataset(variable, data=arrays[variable])
        annotate(dataset, about, group, (*axes, *lasts.get(variable, ())))


def write_radii(group, results):
    """The radii of the types, coordinates that are no axis: xarray looks for the attribute."""
    for name, about in RADII.items():
        annotate(group.create_dataset(name, data=results.radii[name]), about, group, AXES[:1])
    group.attrs["coordinates"] = " ".join(RADII)


def annotate(dataset, about, group, axes):
    _, unit, text = about
    dataset.attrs.update({"units": unit, "long_name": text})
    for number, axis in zip(range(dataset.ndim), axes, strict=False):
        dataset.dims[number].attach_scale(group[axis])


def reserve_replicates(file, study, results):
    """The group of replicates, all but its values; where in the file they go."""
    group = file.create_group("replicates")
    for axis in AXES:
        write_coordinate(group, axis, study[axis])
    flags = FLAGS | {"failure": (tuple(range(len(results.failures))), results.failures)}
    shape = (*results.shape, results.count)
    scale = empty_dataset(group, "replicate", (results.count,), "i8")
    scale.make_scale("replicate")
    annotate_scale(scale, "replicate")
    datasets = [scale]
    for name, about in REPLICATES.items():
        dataset = empty_dataset(group, name, shape, about[0])
        annotate(dataset, about, group, (*AXES, "replicate"))
        if name in flags:
            values, meanings = flags[name]
            dataset.attrs["flag_values"] = np.array(values, "u1")
            dataset.attrs["flag_meanings"] = " ".join(meanings)
        datasets.append(dataset)
    file.flush()
    return [
        (dataset.id.get_offset(), dataset.nbytes, dataset.name.rsplit("/", 1)[1])
        for dataset in datasets
        if dataset.nbytes
    ]


def empty_dataset(group, name, shape, kind):
    """A dataset with its place in the file, whose values HDF5 does not write."""
    import h5py

    plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plan.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    plan.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    little = np.dtype(kind).newbyteorder("<")
    return group.create_dataset(name, shape, little, dcpl=plan)


def write_coordinate(group, axis, values):
    """A dimension scale; words are stored as variable-length UTF-8."""
    import h5py

    words = isinstance(values, list)
    scale = group.create_dataset(axis, data=values, dtype=h5py.string_dtype() if words else None)
    scale.make_scale(axis)
    annotate_scale(scale, axis)


def annotate_scale(scale, axis):
    unit, text = COORDINATES[axis]
    scale.attrs.update({"units": unit, "long_name": text})
