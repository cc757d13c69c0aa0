"""The joined file of a sweep: tables of a study's probabilities, the swept keys first.

HDF5 as the results file is: groups `probabilities` and `pooled` with dimension scales, units and
meanings, a checksum behind; the attribute `swept` (JSON) names the keys, and `run/plan` (JSON) has
what the rows of each part follow from.
"""

import io
import json
import os
from pathlib import Path

import attrs
import numpy as np

from flocsim.errors import UsageError
from flocsim.io.files import Rule, keep, seal, write_file
from flocsim.io.hdf5.expected import Column as Expected
from flocsim.io.hdf5.expected import check_root, hold_against
from flocsim.io.json_text import matches, read_json
from flocsim.io.labelled import Column, DataFrame, Dataset, Labelled
from flocsim.io.opening import opened_file
from flocsim.io.results.groups import write_labelled
from flocsim.io.results.schema import (
    AXES,
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


@attrs.frozen(eq=False)
class SweepResults:
    """A joined file as `flocsim.open` gives it; ``swept`` {dimension: Swept} are its keys, and
    ``plan`` (JSON) says what each of its parts is."""

    path: Path
    swept: dict[str, Swept]
    groups: dict[str, Labelled]
    plan: str = ""

    def labelled(self, group: str) -> Labelled:
        """The arrays of a group; UsageError for an unknown one."""
        if group not in self.groups:
            raise UsageError(f"group must be one of {', '.join(self.groups)}, found {group!r}")
        return self.groups[group]

    def to_xarray(self, group: str = "probabilities") -> Dataset:
        """A group, "probabilities" or "pooled", with the swept keys as its first dimensions."""
        return self.labelled(group).to_xarray()

    def to_pandas(self, group: str = "probabilities") -> DataFrame:
        """The same as a DataFrame, a row for each value and condition."""
        return self.labelled(group).to_pandas((*self.swept, *SCHEMAS[group][1]))

    def __repr__(self) -> str:
        over = ", ".join(f"{each.key}: {len(each.values)} values" for each in self.swept.values())
        return f"SweepResults({str(self.path)!r}: {over})"


def write_sweep(results: SweepResults, rule: Rule = keep) -> None:
    """Write the joined file, whole or not at all; FileError if that is impossible."""
    import h5py

    image = io.BytesIO()
    with h5py.File(image, "w") as file:
        about = {name: {"key": each.key, "unit": each.unit} for name, each in results.swept.items()}
        file.attrs.update(
            {"format": FORMAT, "schema_version": SCHEMA_VERSION, "swept": json.dumps(about)}
        )
        for group, labelled in results.groups.items():
            write_labelled(file.create_group(group), labelled)
        file.create_group("run")["plan"] = results.plan
    write_file(results.path, seal(image.getvalue()), rule)


def read_sweep(path: str | os.PathLike) -> SweepResults:
    """The SweepResults in a joined file; FileError for one that is absent, damaged, of another kind
    or version."""
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
        if not all(matches(each, {"key": str, "unit": str}) for each in about.values()):
            raise ValueError("its attribute swept names no keys")
        wanted = expected(nodes, list(about))
        hold_against(nodes, wanted | {"run": {"plan": Expected("text")}}, SCHEMAS)
        groups = {group: labelled_of(file[group], wanted[group]) for group in SCHEMAS}
        first = groups["probabilities"].axes
        swept = {
            name: Swept(each["key"], first[name].values.tolist(), each["unit"])
            for name, each in about.items()
        }
        plan = file["run/plan"].asstr()[()] if "run" in file else ""
        return SweepResults(Path(path), swept, groups, plan)


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


def labelled_of(place, expected):
    """A group of an open file, which was held against these columns, as Labelled."""
    found = {}
    for name, each in expected.items():
        dataset, words = place[name], each.type == "text"
        values = np.array(dataset.asstr()[()].tolist(), dtype=object) if words else dataset[()]
        axes = tuple(a if isinstance(a, str) else last_axis(name) or name for a in each.axes)
        about = {about: str(dataset.attrs[about]) for about in ("units", "long_name")}
        found[name] = Column(axes, values, about)
    axes = {name for name, each in found.items() if each.axes == (name,) or name in RADII}
    return Labelled(
        {name: each for name, each in found.items() if name in axes},
        {name: each for name, each in found.items() if name not in axes},
    )
