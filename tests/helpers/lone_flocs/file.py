"""The results file of single flocs past a wall: what became of each of them."""

import os
from typing import Any

import attrs
import numpy as np

from flocsim.io.files import Rule
from flocsim.io.groups import FileFormat, Group, declared
from flocsim.io.labelled import Labelled, Tables

COLUMNS = {
    "speed": ("f8", "m s-1", "mean downward velocity"),
    "drift": ("f8", "m", "how far it has moved away from the wall"),
    "steps": ("i8", "1", "accepted integrator steps"),
    "failed": ("u1", "1", "1: its run came to no end"),
}
SCALES = {
    "vertices": ("i8", "1", "number of vertices N"),
    "replicate": ("i8", "1", "number of the replicate"),
}
GROUP = Group.of(declared(COLUMNS, ("vertices", "replicate")), SCALES)
LONE = FileFormat("flocsim lone", 1, "results of single flocs", {"flocs": GROUP})
FORMAT = LONE.name
ROW = np.dtype([(name, kind) for name, (kind, _, _) in COLUMNS.items()])


@attrs.frozen(eq=False)
class LoneResults(Tables):
    """What became of single flocs: ``columns`` {name: (vertices, replicate)}."""

    vertices: np.ndarray
    columns: dict[str, np.ndarray]
    run: dict[str, Any]
    indices = LONE.indices
    format = FORMAT

    @property
    def count(self) -> int:
        """Replicates of each number of vertices."""
        return int(self.columns["speed"].shape[1])

    def labelled(self, group: str = "flocs") -> Labelled:
        """The one group with its axes; UsageError for another."""
        self.known(group)
        scales = {"vertices": self.vertices, "replicate": np.arange(self.count)}
        return GROUP.labelled(scales | self.columns)


def write_lone(path: Any, results: LoneResults, rule: Rule) -> None:
    """Write the file, whole or not at all; FileError if that is impossible."""
    LONE.write(path, {"flocs": results.labelled()}, results.run, rule=rule)


def read_lone(path: str | os.PathLike) -> LoneResults:
    """The LoneResults of a file; FileError for one that is absent, damaged, or of another kind."""
    found = LONE.read(path)
    flocs = found.groups["flocs"]
    return LoneResults(flocs["vertices"], {name: flocs[name] for name in COLUMNS}, found.run)
