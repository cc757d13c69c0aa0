"""Arguments of compiled functions, handed over by one pointer.

numba passes an array as seven to eleven numbers, and a tuple of arrays as those of all of them: a
run's state would be some four hundred numbers in every call. Here a call hands over the address of
a table of 64-bit words. An array is the address of its data, then its sizes; a record is its
address; a tuple is what is in it, one after the other; a number is one word. What compiled code
makes of a table: flocsim.compiler.table_types.
"""

import contextlib
import ctypes
import functools
import struct
import weakref
from collections.abc import Sequence
from typing import Any, get_type_hints

import numpy as np

from flocsim.errors import KernelError

# {types of the arguments: format of struct.pack for their table}
LAYOUTS: dict[tuple[Any, ...], str] = {}

# {id of a tuple: (the tuple, its words, their types)}; see `keep`.
KEPT: dict[int, tuple[Any, list[Any], list[Any]]] = {}


def address_of(value):
    """Return the address of an array's data, or of a record; KernelError unless it lies in C
    order.

    By the buffer protocol, which takes a fifth of the time of numpy's own attributes; of records
    these would describe all fields, for 50 µs.
    """
    if isinstance(value, np.record):
        return np.frombuffer(value, np.uint8).ctypes.data
    if value.size:
        with contextlib.suppress(TypeError, ValueError, BufferError):  # read-only, not in C order
            plain = value if value.dtype.names is None else value.view(np.uint8)
            return ctypes.addressof(ctypes.c_char.from_buffer(plain))
    if not value.flags.c_contiguous:
        raise KernelError(f"an array (shape {value.shape}) does not lie in C order")
    return value.ctypes.data


def keep(value: tuple, owner: Any) -> None:
    """Remember the words of a tuple while its owner lives: tables of it are then made in a fraction
    of the time. Its arrays may not be exchanged meanwhile."""
    if id(value) not in KEPT:
        words: list[Any] = []
        kinds: list[Any] = []
        flatten(value, words, kinds)
        KEPT[id(value)] = value, words, kinds
        weakref.finalize(owner, KEPT.pop, id(value), None)


def flatten(value, words, kinds):
    """Append an argument to the words of a table, and its type to ``kinds``."""
    if isinstance(value, np.ndarray):
        words.append(address_of(value))
        words.extend(value.shape)
        kinds.append((value.dtype if value.dtype.names else value.dtype.char, value.ndim))
    elif isinstance(value, np.record):
        words.append(address_of(value))
        kinds.append(value.dtype)
    elif isinstance(value, tuple):
        if (kept := KEPT.get(id(value))) is not None:
            words += kept[1]
            kinds += kept[2]
            return
        kinds.append((type(value), len(value)))
        for each in value:
            flatten(each, words, kinds)
    elif value is None or callable(value):
        # A law of a scene that runs uncompiled: nothing that compiled code could use.
        words.append(0)
        kinds.append(None)
    else:
        words.append(value)
        kinds.append("d" if isinstance(value, float) else "?" if value is True or value is False
                     or isinstance(value, np.bool_) else "q")  # fmt: skip


def table_of(arguments: Sequence[Any]) -> tuple[np.ndarray, tuple[Any, ...]]:
    """Return the arguments as a table (words,), and their types as a flat tuple: a tuple is (its
    class, its length) before its items, an array (its dtype, its dimensions)."""
    words: list[Any] = []
    found: list[Any] = []
    for each in arguments:
        flatten(each, words, found)
    kinds = tuple(found)
    if kinds not in LAYOUTS:
        LAYOUTS[kinds] = "".join("d" if isinstance(each, float) else "q" for each in words)
    return np.frombuffer(struct.pack(LAYOUTS[kinds], *words), np.int64), kinds


@functools.cache
def sizes_of(named: Any) -> dict[str, tuple[int, ...]]:
    """Return {field: sizes} that a tuple with names declares; 0 for those that vary."""
    hints = get_type_hints(named, include_extras=True)
    return {
        name: tuple(each if isinstance(each, int) else 0 for each in hint.__metadata__[0])
        for name, hint in hints.items()
        if hasattr(hint, "__metadata__")
    }


def kinds_text(kinds: tuple[Any, ...]) -> str:
    """Return the types of arguments as text that differs where machine code may: with the names of
    fields in their order, and sizes that are declared."""
    return " ".join(
        f"{each[0].__name__}{each[0]._fields}{sizes_of(each[0])}"
        if isinstance(each, tuple) and hasattr(each[0], "_fields")
        else repr(each)
        for each in kinds
    )
