"""The joined file of a sweep: tables of a study's probabilities, the swept keys first.

HDF5 as the results file is: groups `probabilities` and `pooled` with dimension scales, units and
meanings, a checksum behind; the attribute `swept` (JSON) names the keys.
"""

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from flocsim.io.files import Rule
from flocsim.io.groups import Dataset, FileFormat, Group
from flocsim.io.hdf5 import File
from flocsim.io.json_text import matches, read_json
from flocsim.io.labelled import Column, Labelled, Tables

SWEEP = FileFormat("flocsim sweep", 1, "sweep", {}, remedy="join it again with --resume")
"""Its groups are those of the studies that are joined, along the swept keys as well."""


@attrs.frozen(eq=False)
class Swept:
    """A key that was swept: dotted, its values (numbers in SI, or words), their unit."""

    key: str
    values: list
    unit: str = "1"

    @property
    def words(self) -> bool:
        """Return True if the values are words, not numbers."""
        return any(isinstance(value, str) for value in self.values)

    def column(self, name: str) -> Column:
        """Return the coordinate of its dimension."""
        values = np.array(self.values, dtype=object if self.words else "f8")
        return Column((name,), values, {"units": self.unit, "long_name": self.key})


@attrs.frozen(eq=False, repr=False)
class SweepResults(Tables):
    """Joined results of a sweep, as `flocsim.open` returns them.

    Attributes
    ----------
    path : Path
        Name of the file.
    swept : dict of str to Swept
        Keys of the sweep, as dimensions.
    groups : dict of str to Labelled
        Joined tables.
    run : dict
        Flocs, preset and version of all parts.
    """

    path: Path
    swept: dict[str, Swept]
    groups: dict[str, Labelled]
    run: dict[str, Any] = attrs.Factory(dict)

    @property
    def indices(self) -> dict[str, list[str]]:  # type: ignore[override]
        """Return {group: axes of its rows}, the swept keys first."""
        return {name: group.shared_axes for name, group in self.groups.items()}

    def labelled(self, group: str) -> Labelled:
        """Return the arrays of a group with their axes.

        Parameters
        ----------
        group : str
            "probabilities" or "pooled"; of swarms "counts".

        Returns
        -------
        Labelled

        Raises
        ------
        UsageError
            If there is no such group.
        """
        return self.groups[self.known(group)]


def write_sweep(results: SweepResults, rule: Rule = False) -> None:
    """Write the joined file, whole or not at all; FileError if that is impossible."""
    about = {name: {"key": each.key, "unit": each.unit} for name, each in results.swept.items()}
    SWEEP.write(results.path, results.groups, results.run, {"swept": json.dumps(about)}, rule)


def read_sweep(
    path: str | os.PathLike, known: Sequence[tuple[FileFormat, Sequence[str]]]
) -> SweepResults:
    """Return the SweepResults in a joined file; FileError for one that is absent, damaged, of
    another kind or version.

    ``known``: (results file, groups of it that are joined) of all kinds of studies.
    """
    with SWEEP.opened(path) as file:
        about = read_json(file.attributes["swept"], {})
        if not all(matches(each, {"key": str, "unit": str}) for each in about.values()):
            raise ValueError("its attribute swept does not name any keys")
        part, names = next((each for each in known if {*each[1]} <= file.keys()), (SWEEP, ()))
        if not names:
            raise ValueError("it has no group of a sweep")
        groups = {name: joined_group(part.groups[name], name, about, file) for name in names}
        stored = attrs.evolve(SWEEP, groups=groups, lengths=part.lengths).contents(file)
        first = next(iter(stored.groups.values()))
        swept = {
            name: Swept(each["key"], first[name].tolist(), each["unit"])
            for name, each in about.items()
        }
        tables = {name: stored.labelled(name) for name in groups}
        return SweepResults(Path(path), swept, tables, dict(stored.run))


def joined_group(one: Group, name: str, about: Mapping[str, dict], file: File) -> Group:
    """Return a group of results along the swept keys, {dimension: {key, unit}}, as well."""

    def along(declared: Mapping[str, Dataset]) -> dict[str, Dataset]:
        return {
            name: attrs.evolve(each, axes=(*about, *each.axes)) for name, each in declared.items()
        }

    swept = {
        axis: Dataset(file.node(f"{name}/{axis}").type or "f8", (axis,), each["unit"], each["key"])
        for axis, each in about.items()
    }
    axes = {name: each for name, each in one.scales.items() if each.axes == (name,)}
    beside = {name: each for name, each in one.scales.items() if name not in axes}
    return Group(along(one.columns), swept | axes | along(beside))
