"""Groups of arrays in HDF5, declared once.

A Group says what arrays a group has, along which axes, of what type, in what unit, and what they
mean: how it is written and read, what a file is held against and what a user sees follow from it.
A file is opened in three steps: its checksum, then its structure (`flocsim.io.hdf5`), then values.
"""

import contextlib
import io
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from flocsim.errors import FileError, UsageError
from flocsim.io.files import Rule, keep, write_file
from flocsim.io.hdf5 import File, Node, Unfit, open_hdf5
from flocsim.io.labelled import Column, Labelled
from flocsim.io.seals import checked_sealed, seal

ATTRIBUTES = {
    "units", "long_name", "flag_values", "flag_meanings", "CLASS", "NAME", "DIMENSION_LIST",
    "REFERENCE_LIST",
}  # fmt: skip
"""Attributes that a dataset may have."""

Schema = Mapping[str, tuple[str, str, str]]
"""{name: (type, unit, meaning)}."""

UNREADABLE = (
    OSError, KeyError, ValueError, TypeError, RuntimeError, UsageError, AttributeError,
    OverflowError, IndexError, EOFError,
)  # fmt: skip
"""What h5py raises for what it cannot read."""

LONGEST_WORDS = 80
"""Letters of what a file says that it is."""


@attrs.frozen
class Declared:
    """A dataset: its type and its axes, each a length or the name of one that is found, its unit,
    its meaning, and where it holds codes these and their words.

    Axes of one name are of one length.
    """

    type: str
    axes: tuple[int | str, ...] = ()
    unit: str = "1"
    text: str = ""
    codes: tuple[Sequence[int], Sequence[str]] | None = None

    @property
    def about(self) -> dict[str, Any]:
        """Its attributes."""
        said: dict[str, Any] = {"units": self.unit, "long_name": self.text}
        if self.codes is not None:
            said["flag_values"] = np.array(self.codes[0], "u1")
            said["flag_meanings"] = " ".join(self.codes[1])
        return said


def hold_against(
    nodes: Mapping[str, Node], groups: Mapping[str, Mapping[str, Declared]],
    needed: Iterable[str], known: Mapping[str, int] | None = None,
) -> dict[str, int]:  # fmt: skip
    """{axis: length} where every group and dataset of a file is as its kind should have it.

    ``groups``: {path: {name: Declared}}, ``needed`` the paths of those that it must have, ``known``
    the lengths of axes that are always the same. Raises Unfit for a group or dataset that is
    missing, unknown, or of another type or shape.
    """
    lengths = dict(known or {})
    for path in needed:
        if path not in nodes or nodes[path].type is not None:
            raise Unfit(f"there is no group {path}")
    for path, node in nodes.items():
        group, _, name = path.rpartition("/")
        if node.type is None:
            if path and path not in groups:
                raise Unfit(f"there is an unknown group {path}")
            # Coordinates that are no axis, as xarray looks for them.
            if path and node.attributes.keys() - {"coordinates"}:
                raise Unfit(f"the group {path} has attributes")
        elif name not in groups.get(group, {}):
            raise Unfit(f"there is an unknown dataset {path}")
        else:
            check_column(path, node, groups[group][name], lengths)
    for group, columns in groups.items():
        for name in columns:
            if group in nodes and f"{group}/{name}" not in nodes:
                raise Unfit(f"{group}/{name} is missing")
    return lengths


def check_column(path, node, column, lengths):
    if node.type != column.type:
        raise Unfit(f"{path} holds {node.type}, expected {column.type}")
    if len(node.shape) != len(column.axes):
        raise Unfit(f"{path} has {len(node.shape)} dimensions, expected {len(column.axes)}")
    for axis, length in zip(column.axes, node.shape, strict=True):
        wanted = axis if isinstance(axis, int) else lengths.setdefault(axis, length)
        if length != wanted:
            raise Unfit(f"{path} has {length} values along {axis}, expected {wanted}")
    for name in node.attributes.keys() - ATTRIBUTES:
        raise Unfit(f"{path} has an attribute {name} that flocsim does not write")


def declared(
    schema: Schema, axes: Sequence[int | str], codes: Mapping[str, tuple] | None = None
) -> dict[str, Declared]:
    """{name: Declared} of arrays along the same axes; ``codes`` {name: (codes, words)}."""
    return {
        name: Declared(kind, tuple(axes), unit, text, (codes or {}).get(name))
        for name, (kind, unit, text) in schema.items()
    }


@attrs.frozen(eq=False)
class Group:
    """A group: its arrays in order, and ``scales`` {axis: Declared} of the axes that they have.

    ``beside``: coordinates that are no axis themselves.
    """

    columns: Mapping[str, Declared]
    scales: Mapping[str, Declared]
    beside: Mapping[str, Declared] = attrs.Factory(dict)

    @classmethod
    def of(
        cls, columns: Mapping[str, Declared], scales: Schema,
        beside: Mapping[str, Declared] | None = None,
    ) -> "Group":  # fmt: skip
        """A group whose axes are those of its arrays, of some ``scales`` {axis: (type, unit,
        meaning)}."""
        used = dict.fromkeys(str(axis) for each in columns.values() for axis in each.axes)
        axes = {axis: Declared(scales[axis][0], (axis,), *scales[axis][1:]) for axis in used}
        return cls(columns, axes, beside or {})

    @property
    def index(self) -> list[str]:
        """The axes that all of its arrays have."""
        return [axis for axis in self.scales
                if all(axis in each.axes for each in self.columns.values())]  # fmt: skip

    @property
    def arrays(self) -> dict[str, Declared]:
        """All that it holds."""
        return {**self.scales, **self.beside, **self.columns}

    def labelled(self, values: Mapping[str, Any]) -> Labelled:
        """Values of all that it holds, by name, as Labelled."""

        def columns(declared):
            return {name: column_of(each, values[name]) for name, each in declared.items()}

        return Labelled(columns({**self.scales, **self.beside}), columns(self.columns))

    def read(self, file: File, path: str) -> dict[str, np.ndarray]:
        """{name: values} of all that a group of a file holds, which was held against this one."""
        return {name: file.read(f"{path}/{name}") for name in self.arrays}


def column_of(declared: Declared, values: Any) -> Column:
    """Values with what is said of them."""
    words = declared.type == "text"
    found = (
        np.array([str(word) for word in values], dtype=object)
        if words
        else (np.asarray(values, declared.type))
    )
    return Column(tuple(map(str, declared.axes)), found, declared.about)


def run_of(file: File) -> dict[str, str | int | float]:
    """The scalars of the group ``run`` of an open file."""
    return {name: scalar_of(file, f"run/{name}") for name in file.names("run")}


def scalar_of(file: File, path: str) -> str | int | float:
    """The value of a dataset of one."""
    value: str | int | float = file.read(path).item()
    return value


def scalars_in(nodes: Mapping[str, Node], group: str) -> dict[str, Declared]:
    """What a group of any scalars holds, to hold it against."""
    return {
        path.removeprefix(f"{group}/"): Declared(node.type)
        for path, node in nodes.items()
        if path.startswith(f"{group}/") and node.type in ("text", "i8", "f8")
    }


def write_labelled(
    place: Any, labelled: Labelled, create: Callable[[Any, str, np.ndarray], Any] | None = None,
    created: Sequence[str] = (),
) -> list[Any]:  # fmt: skip
    """Write arrays into an open group, their axes as dimension scales; the datasets in order.

    A coordinate that is no axis itself is an array that the attribute of the group names.
    ``create(group, name, values)`` makes the datasets of the names in ``created``.
    """
    import h5py

    inner = {name: each for name, each in labelled.axes.items() if each.axes != (name,)}
    scales = {name: each for name, each in labelled.axes.items() if name not in inner}
    if inner:
        place.attrs["coordinates"] = " ".join(inner)
    datasets: dict[str, Any] = {}
    for name, column in (scales | inner | labelled.columns).items():
        if create is not None and name in created:
            dataset = create(place, name, column.values)
        else:
            words = column.values.dtype.kind in "OU"
            values = column.values.tolist() if words else column.values
            kind = h5py.string_dtype() if words else None
            dataset = place.create_dataset(name, data=values, dtype=kind)
        datasets[name] = dataset
        if name in scales:
            dataset.make_scale(name)
        dataset.attrs.update(column.about)
        for number, axis in enumerate(column.axes):
            if name not in scales and axis in scales:
                h5py.h5ds.attach_scale(dataset.id, datasets[axis].id, number)
    return list(datasets.values())


def write_groups(
    path: str | os.PathLike, attributes: Mapping[str, Any], groups: Mapping[str, Labelled],
    scalars: Mapping[str, Any] | None = None, rule: Rule = keep,
) -> None:  # fmt: skip
    """Write a file of groups, sealed, whole or not at all; FileError if that is impossible.

    ``scalars``, optional: those of the group ``run``; ``rule`` says what becomes of a file that is
    there.
    """
    import h5py

    image = io.BytesIO()
    with h5py.File(image, "w") as file:
        file.attrs.update(attributes)
        for name, labelled in groups.items():
            write_labelled(file.require_group(name), labelled)
        if scalars is not None:
            run = file.create_group("run")
            for name, value in scalars.items():
                run[name] = value
    write_file(path, seal(image.getvalue()), rule)


def check_format(
    path: object, file: File, name: str, version: int, text: str | None = None
) -> None:
    """ValueError unless an open file is of this format, and has the attribute ``text``; FileError
    for another version."""
    for attribute in ("format", text or "format"):
        if not isinstance(file.attributes.get(attribute), str):
            raise Unfit(f"its attribute {attribute} is missing, or is of another type")
    if file.attributes["format"] != name:
        raise ValueError(f"its format is not {name}")
    check_version(path, file, version)


def check_version(
    path: object, file: File, first: int, last: int | None = None,
    remedy: str = "run the study again",
) -> int:  # fmt: skip
    """The schema version of an open file; FileError unless it is one of ``first`` to ``last``.

    Versions below ``first`` were never released, so there is nothing to migrate them by: whoever
    raises a version puts here what makes a file of before one of now.
    """
    version = file.attributes.get("schema_version")
    if not isinstance(version, int) or version < 1:
        raise Unfit("it does not record a schema version")
    if version < first:
        raise FileError(
            f"{path} has schema version {version}, written by a flocsim before 0.3 that was never "
            f"released: {remedy}"
        )
    if version > (last or first):
        raise FileError(
            f"{path} has schema version {version}, and this flocsim reads up to {last or first}: "
            "read it with the version that wrote it"
        )
    return version


@contextlib.contextmanager
def opened_file(path: str | os.PathLike, complaint: Callable[[str], str]) -> Iterator[File]:
    """An open file, once checksum and structure were found right.

    FileError with ``complaint(reason)`` where it, or what is done with it, fails on what it holds,
    and where it was written to meanwhile.
    """
    before = stamp(path)
    with checked_sealed(path) as (data, _):
        try:
            yield open_hdf5(path, data)
        except FileError:
            raise
        except UNREADABLE as error:
            raise FileError(complaint(" ".join(str(error).split()))) from error
        if stamp(data.fileno()) != before:
            raise FileError(f"{path} was changed by another program while it was read: try again")


def stamp(file: str | os.PathLike | int) -> tuple | None:
    """What tells that a file is another one, or was written to; None where there is none."""
    try:
        about = os.stat(file)
    except (OSError, ValueError):
        return None
    return about.st_dev, about.st_ino, about.st_size, about.st_mtime_ns


def text_of(file: File, name: str) -> str:
    """An attribute of an open file that is a text; "" where there is none, or none that flocsim
    writes there, which messages show."""
    found = file.attributes.get(name)
    if not isinstance(found, str) or not found.isprintable() or len(found) > LONGEST_WORDS:
        return ""
    return found


def kind_of(path: str | os.PathLike) -> str:
    """What a file says that it is, its `kind` or `format`; "" where that cannot be read: who then
    reads it as one of these says what is wrong.

    One look for all kinds, since each look goes through the whole file for its checksum. FileError
    where that is wrong, or where there is no such file.
    """
    with checked_sealed(path) as (data, _):
        try:
            file = open_hdf5(path, data, root_only=True)
        except UNREADABLE:
            return ""
        return text_of(file, "kind") or text_of(file, "format")


def checked_arrays(
    group: str, arrays: Mapping[str, Any], declared: Mapping[str, Declared],
    lengths: Mapping[str, int],
) -> dict[str, np.ndarray]:  # fmt: skip
    """A group's arrays in the order and of the types declared; UsageError for an array that is
    missing, unknown, misshapen or would lose its values."""
    if set(arrays) != set(declared):
        strange = ", ".join(sorted(set(arrays) ^ set(declared)))
        raise UsageError(f"{group} must hold exactly the schema's arrays; differing: {strange}")
    found = {
        name: exact(arrays[name], each.type, f"{group}/{name}") for name, each in declared.items()
    }
    for name, array in found.items():
        shape = tuple(lengths[str(axis)] for axis in declared[name].axes)
        if array.shape != shape:
            raise UsageError(f"{group}/{name} has shape {array.shape}, expected {shape}")
    return found


def exact(values, dtype, name):
    """``values`` as an array of ``dtype``; UsageError if a value would change."""
    try:
        given = np.asarray(values)
        with np.errstate(invalid="ignore"):
            converted = given.astype(dtype)
        same = np.array_equal(given, converted, equal_nan=converted.dtype.kind == "f")
    except (TypeError, ValueError, OverflowError) as error:
        raise UsageError(f"{name} must hold numbers of type {dtype}: {error}") from error
    if not same:
        raise UsageError(f"{name} holds values that do not fit the type {dtype}")
    return converted
