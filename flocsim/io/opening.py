"""An HDF5 file that flocsim wrote, opened: its checksum first, then its structure, then h5py."""

import contextlib
import os
from collections.abc import Callable, Iterator
from typing import Any, BinaryIO

from flocsim.errors import FileError, UsageError
from flocsim.io.files import checked_sealed
from flocsim.io.hdf5.structure import Node, structure_of

UNREADABLE = (
    OSError, KeyError, ValueError, TypeError, RuntimeError, UsageError, AttributeError,
    OverflowError, IndexError, EOFError,
)  # fmt: skip
"""What h5py raises for what it cannot read."""


LONGEST_WORDS = 80
"""Letters of what a file says that it is."""


@contextlib.contextmanager
def parsed(data: BinaryIO, size: int) -> Iterator[tuple[Any, dict[str, Node]]]:
    """(open h5py file, its structure) of HDF5 data, h5py being let at it once the structure is one
    that flocsim writes."""
    import h5py

    nodes = structure_of(data, size)
    data.seek(0)
    with h5py.File(data, "r") as file:
        yield file, nodes


@contextlib.contextmanager
def opened_file(
    path: str | os.PathLike, complaint: Callable[[str], str]
) -> Iterator[tuple[Any, dict[str, Node]]]:
    """(open h5py file, its structure), once checksum and structure were found right.

    FileError with ``complaint(reason)`` where it, or what is done with it, fails on what it holds.
    """
    with checked_sealed(path) as (data, size):
        try:
            with parsed(data, size) as found:
                yield found
        except FileError:
            raise
        except UNREADABLE as error:
            raise FileError(complaint(" ".join(str(error).split()))) from error


def text_of(file: Any, nodes: dict[str, Node], name: str) -> str:
    """An attribute of an open file that is a text; "" where there is none, or none that flocsim
    writes there, which messages show."""
    known = nodes[""].attributes.get(name)
    found = str(file.attrs[name]) if known == ("text", ()) else ""
    return found if found.isprintable() and len(found) <= LONGEST_WORDS else ""


def kind_of(path: str | os.PathLike) -> str:
    """What a file says that it is, its `kind` or `format`; "" where that cannot be read: who then
    reads it as one of these says what is wrong.

    One look for all kinds, since each look goes through the whole file for its checksum. FileError
    where that is wrong, or where there is no such file.
    """
    with checked_sealed(path) as (data, size):
        try:
            with parsed(data, size) as (file, nodes):
                return text_of(file, nodes, "kind") or text_of(file, nodes, "format")
        except UNREADABLE:
            return ""
