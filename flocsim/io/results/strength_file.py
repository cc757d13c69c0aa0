"""The file of `flocsim strength`: rates at which bound doublets open, one by one and by condition.

HDF5 with a checksum behind, groups with dimension scales:

- ``doublets``    every doublet that was tested: where it stands in the study, and what was found
- ``conditions``  how many of a condition were found bound, tested and opened, and quantiles

The attribute ``about`` (JSON) has the flow, the precision, where it came from, and whether all that
was asked for has been tested: the file of a survey that still runs, or was stopped, holds what
there is so far.
"""

import io
import json
import os
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from flocsim.io.files import Rule, keep, seal, write_file
from flocsim.io.hdf5.expected import Column as Expected
from flocsim.io.hdf5.expected import check_root, hold_against
from flocsim.io.json_text import read_json
from flocsim.io.labelled import Column, Labelled, about_of
from flocsim.io.opening import opened_file
from flocsim.io.results.groups import write_labelled
from flocsim.io.results.schema import AXES, COORDINATES, FLAGS

FORMAT = "flocsim strength"
SCHEMA_VERSION = 2
ROOT = {"format": "text", "schema_version": "i8", "about": "text"}

STATUS = ("opened", "opens_at_least_rate", "holds_at_most_rate", "failed")
"""Words of the codes of ``status``: between two rates; at the lowest rate already; at none; a run
failed."""

DOUBLETS = {
    "type": ("i8", "1", "place of the collision type in the study"),
    "vertices": ("i8", "1", "place of N in the study"),
    "delta": ("i8", "1", "place of the displacement in the study"),
    "replicate": ("i8", "1", "replicate of the study"),
    "bond": ("u1", "1", "what holds the pair"),
    "holds": ("f8", "s-1", "highest rate below the first opening at which it held; NaN: none"),
    "opens": ("f8", "s-1", "first rate found at which it opens; NaN: none"),
    "status": ("u1", "1", "what was found"),
    "runs": ("i8", "1", "rates at which it was run"),
    "tolerance": ("f8", "m", "largest tolerance that one of its runs needed; NaN: unknown"),
}
"""Columns (doublet,): {name: (type, units, long name)}."""

COUNTS = {
    "n_bound": ("i8", "1", "doublets found bound"),
    "n_tested": ("i8", "1", "doublets put into flows"),
    "n_opened": ("i8", "1", "doublets that opened"),
    "n_holding": ("i8", "1", "doublets that held at every rate"),
    "n_failed": ("i8", "1", "doublets of which a run failed"),
}
"""Columns (type, vertices, delta) of ``conditions``."""

RATE = {"rate": ("f8", "s-1", "rate at which a share of the doublets has opened; inf: no such")}
"""The column (type, vertices, delta, quantile)."""

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)

FURTHER = {
    "doublet": ("1", "number of the doublet"),
    "quantile": ("1", "share of the doublets"),
}


@attrs.frozen(eq=False)
class Strengths:
    """What `flocsim strength` has found: ``about``, how; the two groups of its file as Labelled."""

    about: dict[str, Any]
    doublets: Labelled
    conditions: Labelled

    @property
    def complete(self) -> bool:
        """Whether all doublets that were asked for have been tested."""
        return self.about.get("complete") is True

    @property
    def progress(self) -> str:
        """How many have been, in words."""
        asked = self.about.get("asked")
        of = f" of {asked}" if isinstance(asked, int) else ""
        return f"{len(self.column('status'))}{of} doublets"

    def column(self, name: str) -> np.ndarray:
        """A column of the doublets (k,)."""
        return self.doublets.columns[name].values

    def table(self, name: str) -> np.ndarray:
        """A column of the conditions (type, vertices, delta, …)."""
        return self.conditions.columns[name].values


def coordinates(axes: tuple) -> dict[str, Column]:
    """The scales of types, numbers of vertices and displacements."""
    types, vertices, delta = axes
    values = {
        "type": np.array(list(types), dtype=object), "vertices": np.asarray(vertices, "i8"),
        "delta": np.asarray(delta, "f8"),
    }  # fmt: skip
    return {
        name: Column((name,), value, about_of(COORDINATES[name])) for name, value in values.items()
    }


def labelled_doublets(columns: dict[str, np.ndarray]) -> Labelled:
    """The group ``doublets`` of plain columns (k,)."""
    found = {}
    for name, schema in DOUBLETS.items():
        kind, notes = schema[0], about_of(schema)
        flags = FLAGS["bond"] if name == "bond" else (range(len(STATUS)), STATUS)
        if kind == "u1":
            notes |= {"flag_values": np.array(flags[0], "u1"), "flag_meanings": " ".join(flags[1])}
        found[name] = Column(("doublet",), np.asarray(columns[name], kind), notes)
    count = len(next(iter(columns.values())))
    scale = Column(("doublet",), np.arange(count), about_of(FURTHER["doublet"]))
    return Labelled({"doublet": scale}, found)


def labelled_conditions(axes: tuple, columns: dict[str, np.ndarray]) -> Labelled:
    """The group ``conditions`` of plain arrays."""
    scales = coordinates(axes)
    scales["quantile"] = Column(("quantile",), np.array(QUANTILES), about_of(FURTHER["quantile"]))
    found = {
        name: Column((*AXES, *(("quantile",) * (name in RATE))), columns[name], about_of(schema))
        for name, schema in (COUNTS | RATE).items()
    }
    return Labelled(scales, found)


def write_strengths(path: str | Path, found: Strengths, rule: Rule = keep) -> None:
    """Write the file, whole or not at all; FileError if that is impossible."""
    import h5py

    image = io.BytesIO()
    with h5py.File(image, "w") as file:
        file.attrs.update(
            {"format": FORMAT, "schema_version": SCHEMA_VERSION, "about": json.dumps(found.about)}
        )
        write_labelled(file.create_group("doublets"), found.doublets)
        write_labelled(file.create_group("conditions"), found.conditions)
    write_file(path, seal(image.getvalue()), rule)


EXPECTED = {
    "doublets": {name: Expected(kind, ("doublet",)) for name, (kind, _, _) in DOUBLETS.items()}
    | {"doublet": Expected("i8", ("doublet",))},
    "conditions": {name: Expected(kind, AXES) for name, (kind, _, _) in COUNTS.items()}
    | {name: Expected(kind, (*AXES, "quantile")) for name, (kind, _, _) in RATE.items()}
    | {
        "type": Expected("text", ("type",)), "vertices": Expected("i8", ("vertices",)),
        "delta": Expected("f8", ("delta",)), "quantile": Expected("f8", (len(QUANTILES),)),
    },
}  # fmt: skip


def read_strengths(path: str | os.PathLike) -> Strengths:
    """The Strengths of a file; FileError for one that is absent, damaged, or of another kind."""
    with opened_file(
        path, lambda reason: f"{path} holds no readable strengths of bonds: {reason}"
    ) as (file, nodes):
        check_root(nodes, ROOT)
        if str(file.attrs["format"]) != FORMAT or int(file.attrs["schema_version"]) != (
            SCHEMA_VERSION
        ):
            raise ValueError(f"its format is not {FORMAT} of version {SCHEMA_VERSION}")
        known = read_json(str(file.attrs["about"]), {})
        if not isinstance(known, dict):
            raise ValueError("its attribute about is no table")
        hold_against(nodes, EXPECTED, EXPECTED)
        doublets, conditions = file["doublets"], file["conditions"]
        types = conditions["type"].asstr()[()].tolist()
        axes = types, conditions["vertices"][()], conditions["delta"][()]
        columns = {name: doublets[name][()] for name in DOUBLETS}
        check_places(columns, tuple(map(len, axes)))
        return Strengths(
            known, labelled_doublets(columns),
            labelled_conditions(axes, {name: conditions[name][()] for name in COUNTS | RATE}),
        )  # fmt: skip


def check_places(columns, shape):
    """ValueError for doublets of conditions that the file does not have, or of unknown codes."""
    for name, length in zip(AXES, shape, strict=True):
        if np.any((columns[name] < 0) | (columns[name] >= length)):
            raise ValueError(f"a doublet is of no {name} of the file")
    if np.any(columns["status"] >= len(STATUS)):
        raise ValueError("a doublet has an unknown status")
