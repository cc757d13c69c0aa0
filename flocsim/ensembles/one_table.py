"""Kinds of study whose results are their rows: one table with a value of each column for every
replicate.

Such a kind declares its columns as a OneTable; its file, its results and what commands show follow.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import attrs
import numpy as np

from flocsim.ensembles.contents import (
    Contents,
    Facts,
    Figures,
    Joined,
    Summary,
    in_words,
    origin,
)
from flocsim.ensembles.kind import OldResults, places_in
from flocsim.errors import FileError
from flocsim.io.groups import FileFormat, Group, Schema, Stored, declared
from flocsim.io.plots.style import Figure, house_style, new_figure
from flocsim.io.results.schema import AXES, COORDINATES
from flocsim.io.terminal import aligned

ROWS = "replicates"


@attrs.frozen(eq=False)
class OneTable(Contents):
    """The ``columns`` {name: (type, unit, meaning)} of the replicates of a kind of study.

    ``name``: what its results files say that they are; ``title``: what they hold, in words.
    """

    name: str
    title: str
    columns: Schema

    @property
    def row(self) -> np.dtype:
        """Columns of a finished replicate."""
        return np.dtype([(name, f"<{kind}") for name, (kind, *_) in self.columns.items()])

    @property
    def file(self) -> FileFormat:
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
        rows = np.zeros(values[next(iter(self.columns))].shape, self.row)
        for name in self.columns:
            rows[name] = values[name]
        chunks = [(condition, 0, rows[place]) for condition, place in places.items()]
        yield OldResults(list(places), rows.shape[-1], chunks, found.run)

    def so_far(self, store: Any, asked: dict[str, Any]) -> tuple[Stored, int, int]:
        """Return as many replicates as there are of each condition."""
        runs = [store.runs[place][:1] for place in range(len(store.conditions))]
        there = min(each[0][1] if each and each[0][0] == 0 else 0 for each in runs)
        if there == 0:
            raise FileError(f"{store.journal.path} lacks some condition yet: try again later")
        many = asked["replicates"] * len(store.conditions)
        return self.stored(store, asked, there, {}), store.there(), many

    def table(self, found: Stored) -> str:
        """Return means over replicates, a row for each condition."""
        return "\n".join(aligned(self.means(found.labelled(ROWS).columns, axes_in(found), AXES)))

    def means(
        self, columns: Mapping[str, Any], axes: Mapping[str, np.ndarray], names: Any
    ) -> list[tuple[str, ...]]:
        """Return means over the last axis at every place of the others, the heads first."""
        heads = [f"{name} [{unit}]" if unit != "1" else name
                 for name, (_, unit, _) in self.columns.items()]  # fmt: skip
        rows = [(*names, *heads)]
        for place in np.ndindex(*(len(axes[name]) for name in names)):
            keys = (in_words(axes[name].tolist()[k]) for name, k in zip(names, place, strict=True))
            values = (f"{columns[name].values[place].mean():.4g}" for name in self.columns)
            rows.append((*keys, *values))
        return rows

    def sweep_rows(self, swept: Any) -> list[tuple[str, ...]]:
        """Return the same at all swept values."""
        table = swept.labelled(ROWS)
        axes = {name: each.values for name, each in table.axes.items()}
        return self.means(table.columns, axes, (*swept.swept, *AXES))

    def figures(self, found: Any) -> Figures:
        """Return a figure for each column of numbers that are not whole."""

        def figure_of(name: str) -> Any:
            _, unit, text = self.columns[name]

            def draw(found: Stored) -> Figure:
                with house_style():
                    figure = new_figure(4.0, 3.0)
                    axes = figure.subplots()
                    values = found.groups[ROWS][name]
                    for kind, each in zip(found.groups[ROWS]["type"], values, strict=True):
                        means = each.mean(axis=(-2, -1))
                        axes.plot(found.groups[ROWS]["vertices"], means, "o-", label=str(kind))
                    axes.set(xlabel="number of vertices N", ylabel=f"{text} [{unit}]")
                    axes.legend()
                return figure

            draw.__doc__ = f"Mean {text} against N."
            return draw

        return {name: figure_of(name) for name, (kind, *_) in self.columns.items() if kind == "f8"}

    def read(self, path: Any) -> Stored:
        """Return what a results file holds."""
        found: Stored = self.file.read(path)
        return found

    def summary(self, found: Stored) -> Summary:
        """Return what a results file says of itself."""
        return Summary(facts_of(found), origin(found.run))

    def running(self, found: Any) -> Facts:
        """Return facts of a study that has not ended."""
        return facts_of(found.results)

    @property
    def joined(self) -> Joined:  # type: ignore[override]
        """Return what sweeps join."""
        return Joined(self.file.groups, self.sweep_rows, dict, asked_of)


def axes_in(found: Stored) -> dict[str, np.ndarray]:
    """Return {axis: values} of the conditions of results."""
    return {axis: found.groups[ROWS][axis] for axis in AXES}


def asked_of(found: Stored) -> dict[str, Any]:
    """Return the axes of results, and how many replicates each condition has."""
    types, vertices, delta = (values.tolist() for values in axes_in(found).values())
    count = len(found.groups[ROWS]["replicate"])
    return {"types": types, "vertices": vertices, "delta": delta, "replicates": count}


def facts_of(found: Stored) -> Facts:
    """Return the conditions of results, and how many replicates each has."""
    facts = [
        (axis, ", ".join(map(in_words, each.tolist()))) for axis, each in axes_in(found).items()
    ]
    return [*facts, ("replicates", f"{len(found.groups[ROWS]['replicate'])} of each")]
