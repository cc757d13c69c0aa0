"""The results file of pairs and rates (`schema.RESULTS`): writing it, and reading it in parts.

Its table of replicates may be larger than the memory: rank 0 writes it a part at a time, and a
reader takes a column at a time.
"""

import math
import os
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from flocsim.io.files import Rule
from flocsim.io.groups import Dataset, File, Unfit
from flocsim.io.labelled import Labelled
from flocsim.io.results.kernel_group import kernel_in
from flocsim.io.results.schema import (
    CLASSES,
    FLOCS,
    GROUPS,
    REPLICATES,
    RESULTS,
    Results,
    row_columns,
)

FORMAT, SCHEMA_VERSION = RESULTS.name, RESULTS.version

MOST_VALUES = 65_536
"""Rows that are written at a time, 11 MB."""

Part = Callable[[int, int], Any]
"""Gives the rows of replicates [first, stop) (type, vertices, delta, replicate), an array by
column."""


def write_results(
    path: str | os.PathLike, results: Results, rule: Rule = False, part: Part | None = None
) -> None:
    """Write results, whole or not at all; FileError if that is impossible.

    ``part`` gives rows where they are not in the results. ``rule`` says what becomes of a file that
    exists.
    """

    def fill(group: Any) -> None:
        step = max(MOST_VALUES // math.prod(results.shape), 1)
        for first in range(0, results.count, step):
            stop = min(first + step, results.count)
            rows = part(first, stop)  # type: ignore[misc]
            for name in REPLICATES:
                group[name][..., first:stop] = rows[name]

    fills = {"replicates": fill} if part is not None else {}
    RESULTS.write(path, groups_of(results), results.run, rule=rule, fill=fills)


def groups_of(results: Results) -> dict[str, Labelled]:
    """Return the groups of a results file, replicates last."""
    names = ("probabilities", "pooled", "differences", "numerics", "outlines")
    groups = {name: results.labelled(name) for name in names if getattr(results, name)}
    if results.kernel is not None:
        groups["kernel"] = results.kernel.labelled()
    if results.flocs:
        groups["flocs"] = FLOCS.labelled({"floc": results.flocs})
    return groups | {"replicates": results.labelled("replicates")}


class Rows(Mapping[str, np.ndarray]):
    """The table of replicates in an open file: a column is read whenever it is asked for.

    FileError where it has values that no run can have given.
    """

    def __init__(self, file: File, columns: Mapping[str, Dataset]) -> None:
        self.file, self.columns = file, columns

    def __getitem__(self, name: str) -> np.ndarray:
        column, path = self.columns[name], f"replicates/{name}"
        values = self.file.read(path)
        try:
            column.check(path, values, {})
        except Unfit as error:
            raise RESULTS.unreadable(self.file.path, error) from error
        return values

    def __iter__(self) -> Iterator[str]:
        return iter(self.columns)

    def __len__(self) -> int:
        return len(self.columns)


def read_results(path: str | os.PathLike) -> Results:
    """Return the Results in a file; FileError if it is absent, damaged, of another kind or version.

    Their table of replicates, which may be larger than the memory, is read from the file a column
    at a time, whenever one is asked for.
    """
    with RESULTS.opened(path) as file:
        stored = RESULTS.contents(file, without=("replicates",))
        table, run = stored.groups["probabilities"], stored.run
        failures = failures_of(file)
        tables: dict[str, Any] = {
            name: {column: stored.groups[name][column] for column in group.columns}
            for name, group in GROUPS.items() if name in stored.groups
        }  # fmt: skip
        kernel = stored.groups.get("kernel")
        return Results(
            types=table["type"], vertices=table["vertices"], delta=table["delta"], run=run,
            failures=failures, flocs=stored.groups.get("flocs", {"floc": ()})["floc"],
            count=file.node("replicates/replicate").shape[0],
            radii={name: table[name] for name in ("r_i", "r_j")},
            kernel=None if kernel is None else kernel_in(kernel, str(run.get("identity", ""))),
            replicates=Rows(file, row_columns(failures)), **tables,
        )  # fmt: skip


def failures_of(file: File) -> list[str]:
    """Return the words for the codes of failures."""
    words: str = file.node("replicates/failure").attributes["flag_meanings"]
    return words.split()


def instructive_of_each(results: Results) -> dict[str, tuple[tuple[int, int, int, int], str]]:
    """Return {class: (place (type, vertices, delta, replicate), why)} of a replicate to watch.

    Of the flocs with the most vertices of the class, the one whose time from touch to decision is
    nearest to the upper quartile: what happens in contact shows, and is not exceptional.
    """
    assert results.replicates is not None
    codes = np.asarray(results.replicates["outcome"])
    times = np.asarray(results.replicates["t_end"]) - results.replicates["t_collision"]
    found = {}
    for code, name in enumerate(CLASSES):
        of_class = (codes == code) & np.isfinite(times)
        if not of_class.any():
            continue
        most = results.vertices[of_class.any(axis=(0, 2, 3))].max()
        of_class &= (results.vertices == most)[:, np.newaxis, np.newaxis]
        wanted = np.quantile(times[of_class], 0.75)
        distances = np.where(of_class, np.abs(times - wanted), np.inf)
        t, v, d, row = map(int, np.unravel_index(distances.argmin(), distances.shape))
        why = f"{1e3 * times[t, v, d, row]:.3g} ms from touch to decision"
        found[name] = (t, v, d, row), why
    return found
