"""Records: rows of numbers with named fields, the same for plain Python and for numba.

A subclass of Record declares its fields, one per line, as ``float`` or ``int``. ``dtype`` is
numpy's structured type of them. An element of an array of that type (``rows``), or a record alone
(``one``), is read and written by name: ``clock.time``, ``contacts[row].slip_offset``. The classes
are never instantiated; type checkers take them for the type of such an element.
"""

import ctypes
from typing import TYPE_CHECKING, Any, ClassVar, Self, get_type_hints

import numpy as np

from flocsim.compiler.by_pointer import address_of

KINDS = {float: "f8", int: "i8"}
"""Array type of each declared type."""


class Record:
    """Base of all records; see the module."""

    dtype: ClassVar[np.dtype[Any]]

    if TYPE_CHECKING:

        def copy(self) -> Self:
            """Return a record of the same numbers, as elements of arrays have it."""

    def __init_subclass__(cls) -> None:
        fields = [
            (name, KINDS[kind]) for name, kind in get_type_hints(cls).items() if kind in KINDS
        ]
        if taken := [name for name, _ in fields if hasattr(np.record, name)]:
            raise TypeError(f"{cls.__name__}.{taken[0]}: numpy's records have that name themselves")
        cls.dtype = np.dtype((np.record, np.dtype(fields, align=True)))

    @classmethod
    def one(cls) -> Self:
        """Return a record of zeros."""
        return cls.rows(1)[0]

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


def clear(value: Any) -> None:
    """Set an array of numbers or of records, a record, or a tuple of such, to zero."""
    if isinstance(value, tuple):
        for each in value:
            clear(each)
    elif isinstance(value, np.record):
        ctypes.memset(address_of(value), 0, value.nbytes)
    else:
        # Of records all at once: numpy would set field by field.
        (value if value.dtype.names is None else value.view(np.uint8)).fill(0)


def copied(value: Any) -> Any:
    """Return a copy of any value that `clear` accepts."""
    if isinstance(value, tuple):
        return type(value)(*map(copied, value))
    return value.copy()
