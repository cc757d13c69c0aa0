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
    """Return units and long name, the last two of what a schema says of a column, as attributes."""
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
        """Return a Dataset with units and meanings; UsageError where xarray is not installed."""
        xarray = needed("xarray")
        return xarray.Dataset(
            {name: (each.axes, each.values, each.about) for name, each in self.columns.items()},
            {name: (each.axes, each.values, each.about) for name, each in self.axes.items()},
            self.facts,
        )

    def to_pandas(self, index: Sequence[str]) -> DataFrame:
        """Return a DataFrame with a row for each place along ``index``, codes as categories.

        A column for each word of any further axis. UsageError where pandas is not installed.
        """
        pandas = needed("pandas")
        labels = [self.axes[name].values for name in index]
        rows = pandas.MultiIndex.from_product(labels, names=list(index))
        beside = [name for name, each in self.axes.items() if each.axes != (name,)]
        columns = {
            label: pandas.Categorical.from_codes(values, words) if words else values
            for name in (*beside, *self.columns)
            for label, values, words in self.spread(name, index)
        }
        return pandas.DataFrame(columns, index=rows)

    def write_csv(self, file: TextIO, index: Sequence[str]) -> None:
        """Write a header of plain names, then a row for each place along ``index``.

        Numbers have all their digits, codes are written as their words, NaN as an empty cell; there
        is a column for each word of any further axis.
        """
        beside = [n for n, a in self.axes.items() if n not in index and a.axes != (n,)]
        columns = {
            label: np.array(words, object)[values] if words else values
            for name in (*index, *beside, *self.columns)
            for label, values, words in self.spread(name, index)
        }
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        # Row by row: as lists, a table would take several times the memory of its arrays.
        for row in zip(*columns.values(), strict=True):
            writer.writerow(["" if cell != cell else cell for cell in row])

    def spread(
        self, name: str, index: Sequence[str]
    ) -> Iterable[tuple[str, np.ndarray, list[str]]]:
        """Yield (label, values along the index, words) of an array, for each place of its further
        axes; where it holds codes the values are places among the words."""
        column = (self.axes | self.columns)[name]
        values, words = column.values, []
        if "flag_values" in column.about:
            words = column.about["flag_meanings"].split()
            values = np.searchsorted(column.about["flag_values"], values)
        further = [axis for axis in column.axes if axis not in index]
        labels = [self.axes[axis].values for axis in further]
        lengths = [len(self.axes[axis].values) for axis in index]
        # Axes of the index first, in its order; one that the column lacks is of length 1.
        values = values.transpose([column.axes.index(axis) for axis in (*index, *further)
                                   if axis in column.axes])  # fmt: skip
        values = values[tuple(slice(None) if axis in column.axes else None for axis in index)]
        for place in np.ndindex(*map(len, labels)):
            parts = [str(words_of[at]) for words_of, at in zip(labels, place, strict=True)]
            own = np.broadcast_to(values[(..., *place)], lengths)
            yield "_".join([name, *parts]), own.ravel(), words


def with_unit(name: str, unit: str) -> str:
    """Return a quantity with its unit, if it has one: "speed [m s-1]"."""
    return name if unit == "1" else f"{name} [{unit}]"


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
        """Return the arrays of a group with their axes.

        Parameters
        ----------
        group : str
            Name of the group.

        Returns
        -------
        Labelled

        Raises
        ------
        UsageError
            If there is no such group.
        """
        raise NotImplementedError

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(self.indices)})"

    def known(self, group: str | None) -> str:
        """Return the name of a group; UsageError for an unknown one."""
        name = next(iter(self.indices)) if group is None else group
        if name not in self.indices:
            known = ", ".join(self.indices)
            raise UsageError(f"{self.word} must be one of {known}, found {group!r}")
        return name

    def to_xarray(self, group: str | None = None) -> Dataset:
        """Return a group as an xarray Dataset, with units, meanings and flags.

        Parameters
        ----------
        group : str, optional
            Name of the group; the first by default.

        Returns
        -------
        xarray.Dataset

        Raises
        ------
        UsageError
            If there is no such group, or xarray is not installed (``pip install
            'flocsim[tables]'``).
        """
        return self.labelled(self.known(group)).to_xarray()

    def to_pandas(self, group: str | None = None) -> DataFrame:
        """Return a group as a pandas DataFrame: one row for each point of its axes, with codes as
        words.

        Parameters
        ----------
        group : str, optional
            Name of the group; the first by default.

        Returns
        -------
        pandas.DataFrame

        Raises
        ------
        UsageError
            If there is no such group, or pandas is not installed (``pip install
            'flocsim[tables]'``).
        """
        name = self.known(group)
        return self.labelled(name).to_pandas(self.indices[name])


def needed(library: str) -> Any:
    """Return a library of the extra `tables`; UsageError with the command that installs it."""
    try:
        return importlib.import_module(library)
    except ImportError:
        raise UsageError(f"{library} is not installed: pip install 'flocsim[tables]'") from None
