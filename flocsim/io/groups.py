"""Kinds of files, each declared once as tables; written, read, checked and shown from that.

A `FileFormat` is the name and version of a kind of file and its groups. A `Group` is a table: its
columns and their axes, each a `Dataset` with type, axes, unit, meaning, and range or codes. To
declare a kind of file, for example the results of a kind of study:

    COLUMNS = {"speed": ("f8", "m s-1", "mean downward velocity"),
               "steps": ("i8", "1", "accepted integrator steps")}
    SCALES = {"replicate": ("i8", "1", "number of the replicate")}
    FLOCS = Group.of(declared(COLUMNS, ("replicate",)), SCALES)
    FORMAT = FileFormat("flocsim lone", 1, "results of single flocs", {"flocs": FLOCS})

    FORMAT.write(path, {"flocs": FLOCS.labelled({"replicate": numbers, "speed": v, "steps": n})},
                 run={"config": text})
    found = FORMAT.read(path)    # Stored: found.groups["flocs"]["speed"], found.run["config"]
    found.to_xarray("flocs")     # also to_pandas, and `flocsim export csv`

Files are HDF5 that xarray, MATLAB, R and Julia open: axes are dimension scales, every dataset has
``units`` and ``long_name``, codes have ``flag_values`` and ``flag_meanings``, and a checksum
follows the HDF5 data (`flocsim.io.seals`).
"""

import contextlib
import io
import os
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import Any, BinaryIO

import attrs
import numpy as np

from flocsim.errors import FileError, UsageError
from flocsim.io.files import Rule, unfinished
from flocsim.io.hdf5 import File, Unfit, open_hdf5
from flocsim.io.labelled import Column, Labelled, Tables
from flocsim.io.seals import seal_file

Schema = Mapping[str, tuple[str, str, str]]
"""{name: (type, unit, meaning)}; types are "f8", "i8", "i4", "u1" and "text"."""

UNREADABLE = OSError, LookupError, ValueError, TypeError, AttributeError, UsageError
"""What reading a file raises that does not hold what it should."""


@attrs.frozen
class Dataset:
    """One array of a file.

    ``axes``: a length or a name each, and axes of one name are of one length. A text has to be
    printable, and numbers are one of the ``codes`` (codes, their words), or lie from ``low`` to
    ``high``, and where they are places ``along`` an axis below its length. Without a range any
    number will do, NaN too.
    """

    type: str
    axes: tuple[int | str, ...] = ()
    unit: str = "1"
    text: str = ""
    codes: tuple[Sequence[int], Sequence[str]] | None = None
    low: float = -np.inf
    high: float = np.inf
    along: str | None = None

    @property
    def about(self) -> dict[str, Any]:
        """Its attributes."""
        about: dict[str, Any] = {"units": self.unit, "long_name": self.text}
        if self.codes is not None:
            about["flag_values"] = np.array(self.codes[0], "u1")
            about["flag_meanings"] = " ".join(self.codes[1])
        return about

    def check(self, path: str, values: np.ndarray, lengths: Mapping[str, int]) -> None:
        """Raise Unfit for values out of range; ``lengths`` {axis: length} of the file."""
        if self.type == "text":
            wrong = any(not word.isprintable() for word in values.ravel())
        elif self.codes is not None:
            wrong = not np.isin(values, self.codes[0]).all()
        else:
            most = lengths[self.along] - 1 if self.along else self.high
            ranged = (self.low, most) != (-np.inf, np.inf)
            wrong = ranged and not np.all((values >= self.low) & (values <= most))
        if wrong:
            raise Unfit(f"{path} has impossible values")

    def column(self, values: Any) -> Column:
        """Return values of this dataset with its axes and attributes."""
        if self.type == "text":
            array = np.array([str(word) for word in values], dtype=object)
        else:
            array = np.asarray(values, self.type)
        return Column(tuple(map(str, self.axes)), array, self.about)


def declared(
    schema: Schema, axes: Sequence[int | str], codes: Mapping[str, tuple] | None = None,
    low: float = -np.inf, high: float = np.inf, along: Mapping[str, str] | None = None,
) -> dict[str, Dataset]:  # fmt: skip
    """Return {name: Dataset} of arrays along the same axes, and of one range.

    ``codes``: {name: (codes, words)} of the arrays that hold codes; ``along``: {name: axis} of
    those that hold places along an axis.
    """
    codes, along = codes or {}, along or {}
    return {
        name: Dataset(kind, tuple(axes), unit, text, codes.get(name), low, high, along.get(name))
        for name, (kind, unit, text) in schema.items()
    }


@attrs.frozen(eq=False)
class Group:
    """A table: its columns in order, and ``scales``, the coordinates of their axes.

    A coordinate that is no axis itself lies along the axis that its Dataset names.
    """

    columns: Mapping[str, Dataset]
    scales: Mapping[str, Dataset]

    @classmethod
    def of(
        cls, columns: Mapping[str, Dataset], scales: Schema,
        beside: Mapping[str, Dataset] | None = None,
    ) -> "Group":  # fmt: skip
        """Return a group with those of the ``scales`` that its columns have as axes.

        ``beside``: coordinates that are no axes.
        """
        used = dict.fromkeys(str(axis) for each in columns.values() for axis in each.axes)
        axes = {axis: Dataset(scales[axis][0], (axis,), *scales[axis][1:]) for axis in used}
        return cls(columns, axes | dict(beside or {}))

    @property
    def index(self) -> list[str]:
        """The axes that all columns have."""
        return [name for name, scale in self.scales.items() if scale.axes == (name,)
                and all(name in each.axes for each in self.columns.values())]  # fmt: skip

    @property
    def arrays(self) -> dict[str, Dataset]:
        """All coordinates and columns."""
        return {**self.scales, **self.columns}

    def labelled(self, values: Mapping[str, Any]) -> Labelled:
        """Return {name: values} of all coordinates and columns as Labelled."""
        scales, columns = (
            {name: each.column(values[name]) for name, each in part.items()}
            for part in (self.scales, self.columns)
        )
        return Labelled(scales, columns)

    def read(self, file: File, path: str, lengths: Mapping[str, int]) -> dict[str, np.ndarray]:
        """Return {name: values} of all coordinates and columns of a group of an open file."""
        values = {name: file.read(f"{path}/{name}") for name in self.arrays}
        for name, each in self.arrays.items():
            each.check(f"{path}/{name}", values[name], lengths)
        return values


@attrs.frozen(eq=False, repr=False)
class Stored(Tables):
    """What a file of one ``kind`` holds, or is to hold: ``groups`` {group: {name: values}},
    coordinates among them; ``run``, the scalars of the group ``run``; the ``attributes`` of the
    file."""

    kind: "FileFormat"
    groups: dict[str, dict[str, np.ndarray]]
    run: dict[str, Any]
    attributes: dict[str, Any]

    @property
    def format(self) -> str:
        """The name of the kind of file."""
        return self.kind.name

    @property
    def scales(self) -> dict[str, np.ndarray]:
        """{axis: its values} of all groups."""
        return {axis: values[axis] for name, values in self.groups.items()
                for axis in self.kind.groups[name].scales}  # fmt: skip

    @property
    def indices(self) -> dict[str, list[str]]:  # type: ignore[override]
        """{group: the axes that all of its columns have}."""
        return {name: self.kind.groups[name].index for name in self.groups}

    def labelled(self, group: str | None = None) -> Labelled:
        """Return a group's arrays with their axes, the first if none is named; UsageError for an
        unknown one."""
        name = self.known(group)
        return self.kind.groups[name].labelled(self.groups[name])

    def write(self, path: str | os.PathLike, rule: Rule = False) -> None:
        """Write the file, whole or not at all; FileError if that is impossible."""
        groups = {name: self.labelled(name) for name in self.groups}
        self.kind.write(path, groups, self.run, self.attributes, rule)


@attrs.frozen(eq=False)
class FileFormat:
    """A kind of file.

    Parameters
    ----------
    name : str
        What its attribute ``format`` (or the one that ``attribute`` names) says.
    version : int
        Schema version that is written, and the latest that is read.
    title : str
        What a file holds, for messages: "results of a swarm".
    groups : {str: Group}
        Its tables, by the paths of their groups.
    optional : collection of str
        Groups that a file may lack.
    lengths : {str: int}
        Lengths of axes that are the same in every file.
    oldest : int, optional
        Earliest version that is read; ``version`` by default.
    attribute : str
        The attribute of the file that has the name.
    remedy : str
        What a user can do about a file that cannot be read.
    view : type
        The class of what is read: a `Stored`.
    """

    name: str
    version: int
    title: str
    groups: Mapping[str, Group]
    optional: Collection[str] = ()
    lengths: Mapping[str, int] = attrs.Factory(dict)
    oldest: int | None = None
    attribute: str = "format"
    remedy: str = "run the study again"
    view: type[Stored] = Stored

    def stored(
        self, groups: Mapping[str, Mapping[str, Any]], axes: Mapping[str, Any],
        run: Mapping[str, Any], attributes: Mapping[str, Any] | None = None,
    ) -> Any:  # fmt: skip
        """Return arrays in memory as what a file of this kind holds, which can be written.

        ``groups``: the columns of each; ``axes``: values of coordinates, others count from 0.
        """
        found = {}
        for name, columns in groups.items():
            group = self.groups[name]
            lengths = {
                axis: length for column, values in columns.items()
                for axis, length in zip(group.columns[column].axes, np.shape(values), strict=True)
            }  # fmt: skip
            scales = {
                axis: np.asarray(axes[axis]) if axis in axes else np.arange(lengths[axis])
                for axis in group.scales
            }
            found[name] = scales | dict(columns)
        return self.view(self, found, dict(run), dict(attributes or {}))

    def write(
        self, path: str | os.PathLike, groups: Mapping[str, Labelled],
        run: Mapping[str, Any] | None = None, attributes: Mapping[str, Any] | None = None,
        rule: Rule = False, fill: Mapping[str, Callable[[Any], None]] | None = None,
    ) -> None:  # fmt: skip
        """Write a file with its checksum, whole or not at all.

        Parameters
        ----------
        path : path
        groups : {str: Labelled}
            The arrays of each group.
        run : {str: str, int or float}, optional
            The scalars of the group ``run``.
        attributes : {str: str or number}, optional
            Further attributes of the file.
        rule : Rule
            What becomes of a file that exists (`flocsim.io.files`).
        fill : {str: function}, optional
            Functions that write the columns of some groups, given the open group of h5py, a part
            at a time so that memory stays flat. Only types and shapes of their arrays are used.

        Raises
        ------
        FileError
            If the file cannot be written.
        """
        import h5py

        fill = fill or {}
        with unfinished(path, rule) as target:
            # HDF5 can crash where a write fails, as on a full disk: the error is raised afterwards.
            steady = Unfailing(target)
            try:
                with h5py.File(steady, "w") as file:
                    file.attrs.update({self.attribute: self.name, "schema_version": self.version})
                    file.attrs.update(attributes or {})
                    for name, labelled in groups.items():
                        write_labelled(file.require_group(name or "/"), labelled, name in fill)
                    for name, write_columns in fill.items():
                        write_columns(file[name])
                    # Last, so that its length moves no byte of the groups before it.
                    for name, value in (run or {}).items():
                        # A bool would become an HDF5 enumeration, which few readers know.
                        file[f"run/{name}"] = int(value) if isinstance(value, bool) else value
            except Exception:
                if steady.error is None:
                    raise
            if steady.error is not None:
                raise steady.error
            seal_file(target)

    @contextlib.contextmanager
    def opened(self, path: str | os.PathLike) -> Iterator[File]:
        """Open a file, once its checksum, format, version and datasets were found right.

        Raises FileError for an absent or damaged file, and for one of another kind or version. So
        do errors of the block that say that the file does not hold what it should (UNREADABLE).
        """
        try:
            file = open_hdf5(path)
            self.check_version(path, file)
            if self.groups:
                self.check(file)
            yield file
        except FileError:
            raise
        except UNREADABLE as error:
            raise self.unreadable(path, error) from error

    def unreadable(self, path: object, error: Exception) -> FileError:
        """Return the FileError for a file that does not hold what it should."""
        why = " ".join(str(error).split())
        return FileError(f"{path} has no readable {self.title}: {why}; {self.remedy}")

    def check_version(self, path: object, file: File) -> None:
        """Raise FileError unless an open file is of this format and of a version that is read.

        Versions below ``oldest`` were never released, so there is nothing to migrate them by: who
        raises a version adds what makes a file of before one of now.
        """
        if file.kind != self.name:
            other = f'a "{file.kind}" file' if file.kind else "a file of another kind"
            raise FileError(f"{path} is {other}: name a file with {self.title}")
        found = file.attributes.get("schema_version")
        if found not in range(self.oldest or self.version, self.version + 1):
            raise FileError(
                f"{path} has schema version {found}, and this flocsim reads {self.version}: read "
                f"it with the version that wrote it, or {self.remedy}"
            )

    def check(self, file: File) -> dict[str, int]:
        """Return {axis: length} of an open file whose groups and datasets are those declared.

        Raises Unfit for a dataset that is missing, unknown, or of another type or shape.
        """
        lengths = dict(self.lengths)
        wanted = {
            f"{name}/{column}".lstrip("/"): each for name, group in self.groups.items()
            if name in file or name not in self.optional for column, each in group.arrays.items()
        }  # fmt: skip
        datasets = {path for path, node in file.items() if node.type is not None}
        scalars = {path for path in datasets if path.startswith("run/") and not file[path].shape}
        for path in sorted(wanted.keys() ^ (datasets - scalars)):
            raise Unfit(f"{path} is {'missing' if path in wanted else 'unknown'}")
        for path, each in wanted.items():
            node = file[path]
            axes = zip(each.axes, node.shape, strict=False)
            shape = tuple(
                axis if isinstance(axis, int) else lengths.setdefault(axis, length)
                for axis, length in axes
            )
            if len(node.shape) != len(each.axes) or (node.type, node.shape) != (each.type, shape):
                raise Unfit(
                    f"{path} holds {node.type} of shape {node.shape}, expected {each.type} along "
                    f"{', '.join(map(str, each.axes))}"
                )
        return lengths

    def contents(self, file: File, without: Collection[str] = ()) -> Any:
        """Return what an open file holds, checked; ``without``: groups that are not read."""
        lengths = self.check(file)
        groups = {
            name: group.read(file, name, lengths) for name, group in self.groups.items()
            if name in file and name not in without
        }  # fmt: skip
        return self.view(self, groups, run_of(file), file.attributes)

    def read(self, path: str | os.PathLike) -> Any:
        """Return what a file holds, checked, as a ``view``; FileError where it cannot be read."""
        with self.opened(path) as file:
            return self.contents(file)


def facts_of(file: File) -> dict[str, Any]:
    """Return the attributes of an open file but its format and version."""
    apart = ("format", "kind", "schema_version")
    return {name: value for name, value in file.attributes.items() if name not in apart}


def run_of(file: File) -> dict[str, str | int | float]:
    """Return the scalars of the group ``run`` of an open file."""
    return {name: file.read(f"run/{name}").item() for name in file.names("run")}


def write_labelled(place: Any, labelled: Labelled, empty: bool = False) -> None:
    """Write arrays into an open group of h5py, their axes as dimension scales.

    A coordinate that is no axis itself is an array that the attribute ``coordinates`` of the group
    names, where xarray looks for it. ``empty``: the columns are to be filled later.
    """
    import h5py

    scales = {name: each for name, each in labelled.axes.items() if each.axes == (name,)}
    beside = {name: each for name, each in labelled.axes.items() if name not in scales}
    if beside:
        place.attrs["coordinates"] = " ".join(beside)
    for name, column in (scales | beside | labelled.columns).items():
        values = column.values
        if empty and name in labelled.columns:
            dataset = place.create_dataset(name, values.shape, values.dtype)
        elif values.dtype.kind in "OU":
            dataset = place.create_dataset(name, data=values.tolist(), dtype=h5py.string_dtype())
        else:
            dataset = place.create_dataset(name, data=values)
        dataset.attrs.update(column.about)
        if name in scales:
            dataset.make_scale(name)
            continue
        for number, axis in enumerate(column.axes):
            if axis in scales:
                dataset.dims[number].attach_scale(place[axis])


class Unfailing(io.FileIO):
    """An open file as HDF5 sees it: no write fails.

    The first error is remembered in ``error``, and nothing is written after it.
    """

    def __init__(self, file: BinaryIO) -> None:
        super().__init__(file.fileno(), "r+", closefd=False)
        self.error: OSError | None = None

    def write(self, data: Any) -> int:
        """Write all of the data, or none after an error."""
        left = memoryview(data).cast("B")
        try:
            while self.error is None and len(left):
                left = left[super().write(left) :]
        except OSError as error:
            self.error = error
        return len(data)
