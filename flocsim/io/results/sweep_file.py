"""The joined file of a sweep: tables of a study's probabilities, the swept keys first.

HDF5 as the results file is: groups `probabilities` and `pooled` with dimension scales, units and
meanings, a checksum behind; the attribute `swept` (JSON) names the keys.
"""

import io
import json
from collections.abc import Mapping
from pathlib import Path

import attrs
import numpy as np

from flocsim.io.files import Rule, keep, seal, write_file
from flocsim.io.hdf5.expected import Column as Expected
from flocsim.io.hdf5.expected import check_root, hold_against
from flocsim.io.json_text import read_json
from flocsim.io.labelled import Column, Labelled
from flocsim.io.opening import opened_file
from flocsim.io.results.groups import write_labelled
from flocsim.io.results.schema import (
    AXES,
    COORDINATES,
    LAST_AXES,
    POOLED,
    RADII,
    TABLE,
    last_axis,
    tail_of,
)

FORMAT = "flocsim sweep"
SCHEMA_VERSION = 1
SCHEMAS = {"probabilities": (TABLE, AXES), "pooled": (POOLED, AXES[:2])}
ROOT = {"format": "text", "schema_version": "i8", "swept": "text"}
KINDS = {"type": "text", "vertices": "i8", "delta": "f8"} | dict.fromkeys(LAST_AXES, "text")


@attrs.frozen(eq=False)
class Swept:
    """A key that was swept: dotted, its values (numbers in SI, or words), their unit."""

    key: str
    values: list
    unit: str = "1"

    @property
    def words(self) -> bool:
        """Whether the values are words, not numbers."""
        return any(isinstance(value, str) for value in self.values)

    def column(self, name: str) -> Column:
        """The coordinate of its dimension."""
        values = np.array(self.values, dtype=object if self.words else "f8")
        return Column((name,), values, {"units": self.unit, "long_name": self.key})


def write_sweep(
    path: str | Path, swept: Mapping[str, Swept], groups: Mapping[str, Labelled], rule: Rule = keep
) -> None:
    """Write the joined file, whole or not at all; FileError if that is impossible."""
    import h5py

    image = io.BytesIO()
    with h5py.File(image, "w") as file:
        about = {name: {"key": each.key, "unit": each.unit} for name, each in swept.items()}
        file.attrs.update(
            {"format": FORMAT, "schema_version": SCHEMA_VERSION, "swept": json.dumps(about)}
        )
        for group, labelled in groups.items():
            write_labelled(file.create_group(group), labelled)
    write_file(path, seal(image.getvalue()), rule)


def read_sweep(path: str | Path) -> tuple[dict[str, Swept], dict[str, Labelled]]:
    """({dimension: Swept}, {group: Labelled}) of a joined file.

    FileError for one that is absent, damaged, of another kind or version.
    """
    with opened_file(
        path,
        lambda reason: f"{path} holds no readable sweep: {reason}; join it again with --resume",
    ) as (file, nodes):
        check_root(nodes, ROOT)
        if str(file.attrs["format"]) != FORMAT or int(file.attrs["schema_version"]) != (
            SCHEMA_VERSION
        ):
            raise ValueError(f"its format is not {FORMAT} of version {SCHEMA_VERSION}")
        about = read_json(str(file.attrs["swept"]), {})
        names = list(about)
        if not all(
            isinstance(each, dict) and all(isinstance(each.get(k), str) for k in ("key", "unit"))
            for each in about.values()
        ):
            raise ValueError("its attribute swept names no keys")
        hold_against(nodes, expected(nodes, names), SCHEMAS)
        groups = {group: labelled_of(file[group], group, names) for group in SCHEMAS}
        first = groups["probabilities"].axes
        swept = {
            name: Swept(each["key"], first[name].values.tolist(), each["unit"])
            for name, each in about.items()
        }
        return swept, groups


def expected(nodes, names):
    """{group: {dataset: Expected}} of a sweep over dimensions of these names."""
    groups = {}
    for group, (schema, axes) in SCHEMAS.items():
        columns = {
            name: Expected(kind, (*names, *axes, *tail_of(name) * (group == "probabilities")))
            for name, (kind, _, _) in schema.items()
        }
        columns |= {name: Expected(kind, (*names, "type")) for name, (kind, _, _) in RADII.items()}
        columns |= {axis: Expected(KINDS[axis], (axis,)) for axis in axes}
        if group == "probabilities":
            for axis, words in LAST_AXES.items():
                columns[axis] = Expected("text", (len(words),))
        for name in names:
            node = nodes.get(f"{group}/{name}")
            kind = "text" if node is not None and node.type == "text" else "f8"
            columns[name] = Expected(kind, (name,))
        groups[group] = columns
    return groups


def labelled_of(place, group, names):
    """A group of an open file as Labelled."""
    schema, axes = SCHEMAS[group]
    columns = {}
    for name, (_, units, text) in schema.items():
        further = (last_axis(name),) if group == "probabilities" and last_axis(name) else ()
        about = {"units": units, "long_name": text}
        columns[name] = Column((*names, *axes, *further), place[name][()], about)
    used = dict.fromkeys(axis for column in columns.values() for axis in column.axes)
    sizes = {
        name: Column((*names, "type"), place[name][()], {"units": units, "long_name": text})
        for name, (_, units, text) in RADII.items()
    }
    return Labelled({axis: coordinate(place[axis], axis) for axis in used} | sizes, columns)


def coordinate(dataset, axis):
    """A dimension scale as a Column."""
    words = dataset.dtype.kind == "O"
    values = np.array(dataset.asstr()[()].tolist(), dtype=object) if words else dataset[()]
    about = {name: str(dataset.attrs[name]) for name in ("units", "long_name")}
    if axis in COORDINATES:
        about = dict(zip(("units", "long_name"), COORDINATES[axis], strict=True))
    return Column((axis,), values, about)
