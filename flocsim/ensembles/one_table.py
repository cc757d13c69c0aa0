"""Kinds of study whose results are their rows: one table with a value of each column for every
replicate.

Such a kind declares its columns as a OneTable; its file, its results and what commands show follow.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import attrs
import numpy as np

from flocsim.ensembles.contents import (
    Contents,
    Facts,
    Row,
    Summary,
    study_summary,
)
from flocsim.ensembles.kind import OldResults, places_in
from flocsim.errors import FileError
from flocsim.io.groups import FileFormat, Group, Schema, Stored, declared
from flocsim.io.labelled import Labelled, with_unit
from flocsim.io.results.run_group import describe_note
from flocsim.io.results.schema import AXES, COORDINATES
from flocsim.io.terminal import in_words, rows_along

ROWS = "replicates"


@attrs.frozen(eq=False)
class OneTable(Contents):
    """The ``columns`` {name: (type, unit, meaning)} of the replicates of a kind of study.

    ``name``: what its results files say that they are; ``title``: what they hold, in words.
    """

    name: str
    title: str
    columns: Schema

    swept = (ROWS,)

    @property
    def row(self) -> np.dtype:
        """Columns of a finished replicate."""
        return np.dtype([(name, f"<{kind}") for name, (kind, *_) in self.columns.items()])

    @property
    def file(self) -> FileFormat:  # type: ignore[override]
        """The results file."""
        columns = declared(self.columns, (*AXES, "replicate"))
        return FileFormat(self.name, 1, self.title, {ROWS: Group.of(columns, COORDINATES)})

    def stored(self, store: Any, asked: Mapping[str, Any], count: int, run: dict) -> Stored:
        """Return the results of the first so many replicates of each condition of a store."""
        rows = np.stack([store.rows(place, 0, count) for place in range(len(store.conditions))])
        names = ("types", "vertices", "delta")
        shape = *(len(asked[each]) for each in names), count
        axes = {axis: np.array(asked[each]) for axis, each in zip(AXES, names, strict=True)}
        columns = {name: rows[name].reshape(shape) for name in self.columns}
        found: Stored = self.file.stored({ROWS: columns}, axes, run)
        return found

    def results(self, study: Any, start: Any, count: int, run: dict, output: Any) -> Stored:
        """Write the results of a study, and return them."""
        found = self.stored(start.store, study.asked(), count, run)
        found.write(output, start.replacing)
        return found

    @contextmanager
    def old_rows(self, output: Any) -> Iterator[OldResults]:
        """Open a results file that is to be extended."""
        found = self.read(output)
        values = found.groups[ROWS]
        places = places_in(*(values[axis] for axis in AXES))
        rows = np.rec.fromarrays([values[name] for name in self.columns], dtype=self.row)
        chunks = [(condition, 0, rows[place]) for condition, place in places.items()]
        yield OldResults(list(places), rows.shape[-1], chunks, found.run)

    def so_far(self, store: Any, asked: dict[str, Any]) -> tuple[Stored, int, int]:
        """Return as many replicates as there are of each condition."""
        runs = [store.runs[place][:1] for place in range(len(store.conditions))]
        there = min(each[0][1] if each and each[0][0] == 0 else 0 for each in runs)
        if there == 0:
            raise FileError(
                f"{store.journal.path} does not have all conditions yet: try again later"
            )
        many = asked["replicates"] * len(store.conditions)
        return self.stored(store, asked, there, {}), store.there(), many

    def rows(self, found: Stored) -> list[list[str]]:
        """Return means over replicates, a row for each condition."""
        return rows_along(axes_in(found), *self.swept_table(found.labelled(ROWS)))

    def swept_table(self, table: Labelled) -> tuple[Sequence[str], Row]:
        """Return means over replicates: heads, and the cells at a place along the other axes."""
        heads = [with_unit(name, unit) for name, (_, unit, _) in self.columns.items()]
        return heads, lambda place: [
            f"{table.columns[name].values[place].mean():.4g}" for name in self.columns
        ]

    def summary(self, found: Stored) -> Summary:
        """Return what a results file says of itself."""
        return study_summary(facts_of(found), found.run, describe_note)

    def running(self, found: Any) -> Facts:
        """Return facts of a study that has not ended."""
        return facts_of(found.results)


def axes_in(found: Stored) -> dict[str, np.ndarray]:
    """Return {axis: values} of the conditions of results."""
    return {axis: found.groups[ROWS][axis] for axis in AXES}


def facts_of(found: Stored) -> Facts:
    """Return the conditions of results, and how many replicates each has."""
    facts = [
        (axis, ", ".join(map(in_words, each.tolist()))) for axis, each in axes_in(found).items()
    ]
    return [*facts, ("replicates", f"{len(found.groups[ROWS]['replicate'])} of each")]
