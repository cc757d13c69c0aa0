"""What was found in an HDF5 file, held against what its kind should have."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from flocsim.io.hdf5.structure import Node, Unfit

SCALE_ATTRIBUTES = {
    "units": "text",
    "long_name": "text",
    "flag_values": "u1",
    "flag_meanings": "text",
    "CLASS": "fixed",
    "NAME": "fixed",
    "DIMENSION_LIST": "references",
    "REFERENCE_LIST": "scales",
}
"""Attributes that a dataset may have, and their types."""

GROUP_ATTRIBUTES = {"coordinates": ("text", ())}
"""Attributes that a group may have: coordinates that are no axis, as xarray looks for them."""


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
            if path and node.attributes.items() - GROUP_ATTRIBUTES.items():
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
    for name, (kind, shape) in node.attributes.items():
        known = SCALE_ATTRIBUTES.get(name)
        if known is None or kind.split()[0] != known or len(shape) > 1:
            raise Unfit(f"{path} has an attribute {name} that flocsim does not write")


def check_root(nodes: Mapping[str, Node], needed: Mapping[str, str]) -> None:
    """Unfit unless the file itself has the attributes {name: type}, all scalars."""
    for name, kind in needed.items():
        if nodes[""].attributes.get(name) != (kind, ()):
            raise Unfit(f"its attribute {name} is missing, or is of another type")
