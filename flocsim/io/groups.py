"""Groups of arrays in HDF5, declared once.

A Group says what arrays a group has, along which axes, of what type, in what unit, and what they
mean: how it is written and read, what a file is held against and what a user sees follow from it.
"""

import io
import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from flocsim.io.files import Rule, keep, seal, write_file
from flocsim.io.hdf5.expected import Declared, check_root
from flocsim.io.hdf5.structure import Node
from flocsim.io.labelled import Column, Labelled

Schema = Mapping[str, tuple[str, str, str]]
"""{name: (type, unit, meaning)}."""

SCALAR_TYPES = ("text", "i8", "f8")


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

    def read(self, place: Any) -> dict[str, np.ndarray]:
        """{name: values} of all that an open group holds, which was held against this one."""
        return {name: values_of(place[name]) for name in self.arrays}


def column_of(declared: Declared, values: Any) -> Column:
    """Values with what is said of them."""
    words = declared.type == "text"
    found = (
        np.array([str(word) for word in values], dtype=object)
        if words
        else (np.asarray(values, declared.type))
    )
    return Column(tuple(map(str, declared.axes)), found, declared.about)


def values_of(dataset: Any) -> np.ndarray:
    """The values of an open dataset; text as objects."""
    words = dataset.dtype.kind == "O"
    return np.array(dataset.asstr()[()].tolist(), dtype=object) if words else dataset[()]


def scalar_of(dataset: Any) -> str | int | float:
    """A scalar of an open file."""
    return dataset.asstr()[()] if dataset.dtype.kind == "O" else dataset[()].item()


def scalars_in(nodes: Mapping[str, Node], group: str) -> dict[str, Declared]:
    """What a group of any scalars holds, to hold it against."""
    return {
        path.removeprefix(f"{group}/"): Declared(node.type)
        for path, node in nodes.items()
        if path.startswith(f"{group}/") and node.type in SCALAR_TYPES
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
    file: Any, nodes: Mapping[str, Node], name: str, version: int,
    further: Mapping[str, str] | None = None,
) -> None:  # fmt: skip
    """ValueError unless an open file says that it is of this format and version, and has the
    ``further`` attributes {name: type}."""
    check_root(nodes, {"format": "text", "schema_version": "i8", **(further or {})})
    if (str(file.attrs["format"]), int(file.attrs["schema_version"])) != (name, version):
        raise ValueError(f"its format is not {name} of version {version}")
