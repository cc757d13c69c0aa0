"""The results file of an ensemble: HDF5 that xarray, MATLAB, R and Julia can open.

Layout (schema version 1). Every group holds its own coordinates as dimension scales, and every
dataset a ``units`` and a ``long_name``; codes carry ``flag_values`` and ``flag_meanings``:

- ``probabilities``  (type, vertices, delta[, class]): counts, probabilities, ``_low``, ``_high``
- ``replicates``     (type, vertices, delta, replicate): what became of every single collision
- ``run``            scalars: config text, versions, machine, wall times

All that may differ between two runs of one config is in ``run``, so `same_data` can compare the
rest byte for byte. The file ends in a checksum behind the HDF5 data (see `flocsim.io.files`).
"""

import contextlib
import io

import numpy as np

from flocsim.errors import FileError, UsageError
from flocsim.io.files import read_sealed, replace_file, seal
from flocsim.io.results_schema import (
    AXES,
    CLASSES,
    COORDINATES,
    FLAGS,
    NOT_APPLICABLE,
    OUTCOMES,
    REPLICATES,
    TABLE,
    Results,
)

__all__ = [
    "CLASSES",
    "NOT_APPLICABLE",
    "OUTCOMES",
    "REPLICATES",
    "TABLE",
    "Results",
    "read_results",
    "same_data",
    "write_results",
]

FORMAT = "flocsim results"
SCHEMA_VERSION = 1


def write_results(path, results):
    """Write ``results`` to ``path``, whole or not at all; FileError if that is impossible."""
    replace_file(path, seal(hdf5_image(results)))


def hdf5_image(results):
    """The results as the bytes of an HDF5 file, the same bytes whenever the results are."""
    import h5py

    image = io.BytesIO()
    with h5py.File(image, "w") as file:
        file.attrs.update({"format": FORMAT, "schema_version": SCHEMA_VERSION})
        write_group(file, "probabilities", results, TABLE, ("class", list(CLASSES)))
        count = results.replicates["outcome"].shape[-1]
        write_group(file, "replicates", results, REPLICATES, ("replicate", np.arange(count)))
        # Last, so that its length moves no byte of the groups before it.
        write_run(file.create_group("run"), results.run)
    return image.getvalue()


def write_group(file, name, results, schema, last_axis):
    """One group: its coordinates, then every array of its schema attached to them."""
    group = file.create_group(name)
    coordinates = [list(results.types), results.vertices, results.delta, last_axis[1]]
    axes = [*AXES, last_axis[0]]
    for axis, values in zip(axes, coordinates, strict=True):
        write_coordinate(group, axis, values)
    flags = FLAGS | {"failure": (tuple(range(len(results.failures))), results.failures)}
    for variable, (_, unit, text) in schema.items():
        dataset = group.create_dataset(variable, data=getattr(results, name)[variable])
        dataset.attrs.update({"units": unit, "long_name": text})
        if variable in flags:
            values, meanings = flags[variable]
            dataset.attrs["flag_values"] = np.array(values, "u1")
            dataset.attrs["flag_meanings"] = " ".join(meanings)
        for number, axis in zip(range(dataset.ndim), axes, strict=False):
            dataset.dims[number].attach_scale(group[axis])


def write_coordinate(group, axis, values):
    """A dimension scale; words are stored as variable-length UTF-8."""
    import h5py

    words = isinstance(values, list)
    scale = group.create_dataset(axis, data=values, dtype=h5py.string_dtype() if words else None)
    scale.make_scale(axis)
    unit, text = COORDINATES[axis]
    scale.attrs.update({"units": unit, "long_name": text})


def write_run(group, run):
    """Scalars: text, whole numbers and floats; anything else is refused."""
    for name, value in run.items():
        value = value.item() if isinstance(value, np.generic) else value
        if not isinstance(value, str | int | float):
            raise UsageError(f"run/{name} must be text or a number, found {value!r}")
        # A bool would become an HDF5 enumeration, which few readers know.
        group[name] = int(value) if isinstance(value, bool) else value


def read_results(path):
    """The Results in a file; FileError if it is absent, damaged, of another kind or version."""
    with opened(path) as file:
        table, replicates = file["probabilities"], file["replicates"]
        return Results(
            types=table["type"].asstr()[()],
            vertices=table["vertices"][()],
            delta=table["delta"][()],
            replicates={name: replicates[name][()] for name in REPLICATES},
            probabilities={name: table[name][()] for name in TABLE},
            run={name: read_scalar(dataset) for name, dataset in file["run"].items()},
            failures=replicates["failure"].attrs["flag_meanings"].split(),
        )


def read_scalar(dataset):
    """A number or a text."""
    return dataset.asstr()[()] if dataset.dtype.kind == "O" else dataset[()].item()


@contextlib.contextmanager
def opened(path):
    """An open h5py file of a known schema, from bytes whose checksum was right."""
    import h5py

    image = io.BytesIO(read_sealed(path))
    try:
        with h5py.File(image, "r") as file:
            check_schema(path, file.attrs)
            yield file
    except (OSError, KeyError, ValueError, TypeError, UsageError) as error:
        if isinstance(error, FileError):
            raise
        raise FileError(f"{path} holds no readable results: {error}; run it again") from error


def check_schema(path, attributes):
    """FileError unless the file is a results file of the version that this code knows."""
    if attributes.get("format") != FORMAT:
        raise FileError(f"{path} is not a results file: name one that flocsim ensemble wrote")
    version = attributes.get("schema_version")
    if version != SCHEMA_VERSION:
        raise FileError(
            f"{path} has results of schema version {version}, this flocsim reads "
            f"{SCHEMA_VERSION}: read it with the version that wrote it"
        )


def same_data(path_a, path_b):
    """Names of the datasets in ``probabilities`` and ``replicates`` whose bytes differ.

    Coordinates included; a dataset that only one file has differs. Empty when all agree.
    """
    with opened(path_a) as a, opened(path_b) as b:
        names = {f"{group}/{name}" for group in ("probabilities", "replicates")
                 for file in (a, b) for name in file[group]}  # fmt: skip
        return sorted(
            n for n in names if n not in a or n not in b or content(a[n]) != content(b[n])
        )


def content(dataset):
    """What must agree for two datasets to be the same: shape, type and bytes."""
    values = dataset[()]
    stored = values.tolist() if values.dtype.kind == "O" else values.tobytes()
    return values.shape, str(values.dtype), stored
