"""Labelled arrays as CSV, and as a Dataset of xarray or a DataFrame of pandas where these are
installed."""

import csv
import importlib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TextIO

import attrs
import numpy as np

from flocsim.errors import UsageError

Dataset = Any
"""An xarray Dataset: no hint may load xarray."""

DataFrame = Any
"""A pandas DataFrame."""


@attrs.frozen(eq=False)
class Column:
    """One array: its axes by name, its values, and what they are.

    ``about``: units, long_name, flag_values and flag_meanings, as the file has them.
    """

    axes: tuple[str, ...]
    values: np.ndarray
    about: dict[str, Any] = attrs.Factory(dict)


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
        further = {name: each for name, each in self.axes.items() if each.axes != (name,)}
        for name, column in (further | self.columns).items():
            for label, values in self.spread(name, column, index):
                found[label] = worded(pandas, column, values)
        return pandas.DataFrame(found, index=rows)

    def write_csv(self, file: TextIO, index: Sequence[str]) -> None:
        """Write a header of plain names, then a row for each place along ``index``.

        Numbers have all their digits, codes are written as their words, NaN as an empty cell; there
        is a column for each word of any further axis.
        """
        columns = {}
        beside = {n: a for n, a in self.axes.items() if n not in index and a.axes != (n,)}
        named = {name: self.axes[name] for name in index}
        for name, column in (named | beside | self.columns).items():
            for label, values in self.spread(name, column, index):
                if "flag_values" in column.about:
                    words = np.array(column.about["flag_meanings"].split(), object)
                    values = words[np.searchsorted(column.about["flag_values"], values)]
                columns[label] = values
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        # Row by row: as lists, a table would take several times the memory of its arrays.
        for row in zip(*columns.values(), strict=True):
            writer.writerow(["" if cell != cell else cell for cell in row])

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


def worded(pandas, column, values):
    """Codes as a categorical of their words; all else as it is."""
    if "flag_values" not in column.about:
        return values
    codes = np.searchsorted(column.about["flag_values"], values)
    return pandas.Categorical.from_codes(codes, column.about["flag_meanings"].split())


def needed(library: str) -> Any:
    """A library of the extra `tables`; UsageError with the command that installs it."""
    try:
        return importlib.import_module(library)
    except ImportError:
        raise UsageError(f"{library} is not installed: pip install 'flocsim[tables]'") from None
