"""The results file of single flocs past a wall: what became of each of them."""

import os
from typing import Any

import attrs
import numpy as np

from flocsim.io.files import Rule
from flocsim.io.groups import (
    Group,
    check_format,
    declared,
    hold_against,
    opened_file,
    run_of,
    scalars_in,
    write_groups,
)
from flocsim.io.labelled import Labelled, Tables

FORMAT, SCHEMA_VERSION = "flocsim lone", 1
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
INDICES = {"flocs": GROUP.index}
ROW = np.dtype([(name, kind) for name, (kind, _, _) in COLUMNS.items()])


@attrs.frozen(eq=False)
class LoneResults(Tables):
    """What became of single flocs: ``columns`` {name: (vertices, replicate)}."""

    vertices: np.ndarray
    columns: dict[str, np.ndarray]
    run: dict[str, Any]
    indices = INDICES
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
    attributes = {"format": FORMAT, "schema_version": SCHEMA_VERSION}
    write_groups(path, attributes, {"flocs": results.labelled()}, results.run, rule)


def read_lone(path: str | os.PathLike) -> LoneResults:
    """The LoneResults of a file; FileError for one that is absent, damaged, or of another kind."""
    complaint = f"{path} holds no readable results of single flocs: "
    with opened_file(path, lambda why: complaint + why) as file:
        check_format(path, file, FORMAT, SCHEMA_VERSION)
        wanted = {"flocs": GROUP.arrays, "run": scalars_in(file, "run")}
        hold_against(file, wanted, wanted)
        found = GROUP.read(file, "flocs")
        run = run_of(file)
        return LoneResults(found["vertices"], {name: found[name] for name in COLUMNS}, run)
