"""Labelled arrays as CSV, and as a Dataset of xarray or a DataFrame of pandas where these are
installed."""

import csv
import importlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, TextIO

import attrs
import numpy as np

from flocsim.errors import UsageError

Dataset = Any
"""An xarray Dataset: no hint may load xarray."""

DataFrame = Any
"""A pandas DataFrame."""

ROWS = 10_000
"""Rows that are written at once: as text, a table takes several times the memory of its arrays."""


@attrs.frozen(eq=False)
class Column:
    """One array: its axes by name, its values, and what they are.

    ``about``: units, long_name, flag_values and flag_meanings, as the file has them.
    """

    axes: tuple[str, ...]
    values: np.ndarray
    about: dict[str, Any] = attrs.Factory(dict)

    def coded(self, values: np.ndarray) -> tuple[np.ndarray, list[str]] | None:
        """Return (positions among the words, words) of some of its codes; None for plain values."""
        if "flag_values" not in self.about:
            return None
        words = self.about["flag_meanings"].split()
        return np.searchsorted(self.about["flag_values"], values), words


def about_of(schema: Sequence[str]) -> dict[str, Any]:
    """Units and long name, the last two of what a schema says of a column, as attributes."""
    *_, units, text = schema
    return {"units": units, "long_name": text}


@attrs.frozen(eq=False)
class Labelled:
    """Arrays along named axes; ``axes`` {name: Column} has a coordinate for each.

    A coordinate that is no axis itself lies along those that its Column names.
    """

    axes: dict[str, Column]
    columns: dict[str, Column]
    facts: dict[str, Any] = attrs.Factory(dict)

    @property
    def shared_axes(self) -> list[str]:
        """The axes that all of its arrays have."""
        return [name for name, each in self.axes.items() if each.axes == (name,)
                and all(name in column.axes for column in self.columns.values())]  # fmt: skip

    def to_xarray(self) -> Dataset:
        """A Dataset with units and meanings; UsageError where xarray is not installed."""
        xarray = needed("xarray")
        return xarray.Dataset(
            {name: (each.axes, each.values, each.about) for name, each in self.columns.items()},
            {name: (each.axes, each.values, each.about) for name, each in self.axes.items()},
            self.facts,
        )

    def to_pandas(self, index: Sequence[str]) -> DataFrame:
        """A DataFrame with a row for each place along ``index``, and codes as their words.

        A column for each word of any further axis. UsageError where pandas is not installed.
        """
        pandas = needed("pandas")
        labels = [self.axes[name].values for name in index]
        rows = pandas.MultiIndex.from_product(labels, names=list(index))
        found = {}
        for label, column, values in self.flat(index):
            coded = column.coded(values)
            found[label] = values if coded is None else pandas.Categorical.from_codes(*coded)
        return pandas.DataFrame(found, index=rows)

    def write_csv(self, file: TextIO, index: Sequence[str]) -> None:
        """Write a header of plain names, then a row for each place along ``index``.

        Numbers have all their digits, codes are written as their words, NaN as an empty cell; there
        is a column for each word of any further axis.
        """
        shape = [len(self.axes[name].values) for name in index]
        places = np.unravel_index(np.arange(np.prod(shape, dtype=int)), shape)
        columns = {
            name: self.axes[name].values[place] for name, place in zip(index, places, strict=True)
        }
        for label, column, values in self.flat(index):
            coded = column.coded(values)
            columns[label] = values if coded is None else np.array(coded[1], object)[coded[0]]
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        for start in range(0, len(places[0]), ROWS):
            cells = (cells_of(each[start : start + ROWS]) for each in columns.values())
            writer.writerows(zip(*cells, strict=True))

    def flat(self, index: Sequence[str]) -> Iterator[tuple[str, Column, np.ndarray]]:
        """Yield (label, column, values along the index), coordinates that are no axis first."""
        further = {name: each for name, each in self.axes.items() if each.axes != (name,)}
        for name, column in (further | self.columns).items():
            for label, values in self.spread(name, column, index):
                yield label, column, values

    def spread(
        self, name: str, column: Column, index: Sequence[str]
    ) -> Iterable[tuple[str, np.ndarray]]:
        """(label, values along the index) of a column, one for each place of its further axes."""
        further = [axis for axis in column.axes if axis not in index]
        words = [self.axes[axis].values for axis in further]
        lengths = [len(self.axes[axis].values) for axis in index]
        places = [column.axes.index(axis) for axis in further]
        values = np.moveaxis(column.values, places, range(-len(places), 0))
        # A column that does not lie along an axis of the index is the same all along it.
        own = iter(values.shape)
        shape = [next(own) if axis in column.axes else 1 for axis in index]
        values = np.broadcast_to(values.reshape(*shape, *own), (*lengths, *map(len, words)))
        for place in np.ndindex(*map(len, words)):
            parts = [str(labels[at]) for labels, at in zip(words, place, strict=True)]
            yield "_".join([name, *parts]), values[(..., *place)].reshape(lengths).ravel()


class Tables:
    """Results of named groups of arrays.

    A subclass gives `labelled(group)` and ``indices``, {group: axes along which its rows lie}, the
    first being the one that is meant where none is named; ``exported``: the groups that are written
    as CSV where none is named, none standing for all; ``word``: what groups are called.
    """

    indices: Mapping[str, Sequence[str]]
    exported: Sequence[str] = ()
    word = "group"

    def labelled(self, group: str) -> Labelled:
        """The arrays of a group with their axes; UsageError for an unknown one."""
        raise NotImplementedError

    def known(self, group: str | None) -> str:
        """The name of a group; UsageError for an unknown one."""
        name = next(iter(self.indices)) if group is None else group
        if name not in self.indices:
            known = ", ".join(self.indices)
            raise UsageError(f"{self.word} must be one of {known}, found {group!r}")
        return name

    def to_xarray(self, group: str | None = None) -> Dataset:
        """A group as an xarray Dataset, with units, meanings and flags.

        UsageError where xarray is not installed (``pip install 'flocsim[tables]'``).
        """
        return self.labelled(self.known(group)).to_xarray()

    def to_pandas(self, group: str | None = None) -> DataFrame:
        """A group as a pandas DataFrame, a row for each place along its axes, codes as words.

        UsageError where pandas is not installed (``pip install 'flocsim[tables]'``).
        """
        name = self.known(group)
        return self.labelled(name).to_pandas(self.indices[name])


def cells_of(values: np.ndarray) -> list[Any]:
    """Return the values as cells of a table: an empty one for NaN."""
    return ["" if value != value else value for value in values.tolist()]


def needed(library: str) -> Any:
    """A library of the extra `tables`; UsageError with the command that installs it."""
    try:
        return importlib.import_module(library)
    except ImportError:
        raise UsageError(f"{library} is not installed: pip install 'flocsim[tables]'") from None
