"""Records: rows of numbers with named fields, the same for plain Python and for numba.

A subclass of Record declares its fields, one per line, as ``float`` or ``int``. An element of an
array of its ``rows``, or a record alone (``one``), is of that class, and its fields are read and
written by name: ``clock.time``, ``contacts[row].slip_offset``.
"""

from collections.abc import Iterable
from operator import itemgetter
from typing import TYPE_CHECKING, Any, ClassVar, Self, get_type_hints

import numpy as np

KINDS = {float: "f8", int: "i8"}
"""Array type of each declared type."""


if TYPE_CHECKING:

    class Element(np.generic):
        """What a record is to type checkers, for which nothing can be derived from np.void."""

        def __setitem__(self, name: str, value: float) -> None: ...

else:

    class Element(np.void):
        """An element of a structured array, whose fields are written as attributes, too."""

        __setattr__ = np.void.__setitem__


class Record(Element):
    """Base of all records; see the module."""

    dtype: ClassVar[np.dtype[Any]]

    def __init_subclass__(cls) -> None:
        fields = [
            (name, KINDS[kind]) for name, kind in get_type_hints(cls).items() if kind in KINDS
        ]
        if taken := [name for name, _ in fields if hasattr(np.void, name)]:
            raise TypeError(f"{cls.__name__}.{taken[0]}: numpy's records have that name themselves")
        for name, _ in fields:
            # numpy.record does this by a search in Python, in four times the time.
            setattr(cls, name, property(itemgetter(name)))
        cls.dtype = np.dtype((cls, np.dtype(fields, align=True)))

    @classmethod
    def one(cls, **values: float) -> Self:
        """Return a record of these values, and of zeros."""
        found: Self = cls.rows(1)[0]
        for name, value in values.items():
            found[name] = value
        return found

    def copy(self) -> Self:  # type: ignore[override]
        """Return a record of the same values, alone in an array of its own."""
        found = self.rows(1)
        found[0] = self
        copy: Self = found[0]
        return copy

    @classmethod
    def rows(cls, *shape: int) -> Any:
        """Return an array of records of zeros."""
        return np.zeros(shape, dtype=cls.dtype)

    @classmethod
    def of(cls, *columns: np.ndarray) -> Any:
        """Return an array of records whose fields, in order, are the given columns, (n,) or (n,
        k)."""
        values = np.column_stack(columns)
        found = cls.rows(len(values))
        for name, column in zip(found.dtype.names, values.T, strict=True):
            found[name] = column
        return found

    @classmethod
    def joined(cls, arrays: Iterable[np.ndarray]) -> Any:
        """Return arrays of these records as one.

        np.concatenate compares the fields of records one by one, and forgets their class where two
        arrays do not share one dtype object: it is given their bytes.
        """
        return np.concatenate([each.view(np.uint8) for each in arrays]).view(cls.dtype)


def copied(value: Any) -> Any:
    """Return a copy of an array, a record, or a tuple of such."""
    if isinstance(value, tuple):
        return type(value)(*map(copied, value))
    return value.copy()
