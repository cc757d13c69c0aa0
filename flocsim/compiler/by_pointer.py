"""Arguments of compiled functions, handed over by one pointer.

numba passes an array as seven to eleven numbers, and a tuple of arrays as those of all of them: a
run's state would be some four hundred numbers in every call. Here a call hands over the address of
a table of 64-bit words. An array is the address of its data, then its sizes; a record is its
address; a tuple is what is in it, one after the other; a number is one word. What compiled code
makes of a table: flocsim.compiler.table_types.
"""

import ctypes
import functools
import struct
from typing import Any, NamedTuple, get_type_hints

import numpy as np

from flocsim.errors import KernelError


class Stacked(NamedTuple):
    """Tables of one type, which compiled code takes by an index."""

    words: np.ndarray  # (tables, words) of int64
    kinds: tuple[Any, ...]  # the types in each, as table_of gives them
    one: Any  # an argument that has such a table


def as_plain(value: Any) -> Any:
    """Return an array, or a record that is alone in its array (Record.one), as an array without
    fields; KernelError unless it is, and lies in C order."""
    array = value.base if isinstance(value, np.void) else value
    if array is not value and (array is None or array.size != 1):
        raise KernelError(f"a {type(value).__name__} is not alone in its array: take a copy")
    if not array.flags.c_contiguous:
        raise KernelError(f"an array (shape {array.shape}) does not lie in C order")
    # Bytes will do: they have the same address, and are cleared in the same way.
    return array if array.dtype.names is None else array.view(np.uint8)


def address_of(value: Any) -> int:
    """Return the address of the data of such an array or record."""
    plain = as_plain(value)
    if plain.size and plain.flags.writeable:
        # By the buffer protocol, which takes a fifth of the time.
        return ctypes.addressof(ctypes.c_char.from_buffer(plain))
    return int(plain.ctypes.data)


def letter_of(value: Any) -> str:
    """Return the letter (struct) of a number; "" for a law of a scene that runs uncompiled, and for
    None: nothing that compiled code could use."""
    if isinstance(value, float):
        return "d"
    if isinstance(value, bool | np.bool_):
        return "?"
    return "" if value is None or callable(value) else "q"


def flatten(value, words, kinds):
    """Append an argument to the words of a table, and its type to ``kinds``."""
    if isinstance(value, Stacked):
        flatten(value.words, words, kinds)
        words.pop()  # the tables alone are counted, as their length is known
        kinds += [Stacked, *value.kinds]
    elif isinstance(value, np.ndarray):
        # Sizes are words and not part of the type: arrays of any size share machine code.
        words.append(address_of(value))
        words.extend(value.shape)
        kinds.append((value.dtype if value.dtype.names else value.dtype.char, value.ndim))
    elif isinstance(value, np.void):
        words.append(address_of(value))
        kinds.append(value.dtype)
    elif isinstance(value, tuple):
        kinds.append((type(value), len(value)))
        for each in value:
            flatten(each, words, kinds)
    else:
        # What compiled code cannot use takes a word that it never reads.
        letter = letter_of(value)
        words.append(value if letter else 0)
        kinds.append(letter)


def table_of(arguments: tuple[Any, ...]) -> tuple[bytes, tuple[Any, ...]]:
    """Return the arguments as a table, and their types as a flat tuple: a tuple is (its class, its
    length) before its items, an array (its dtype, its dimensions)."""
    words: list[Any] = []
    kinds: list[Any] = []
    flatten(arguments, words, kinds)
    letters = ("d" if isinstance(each, float) else "q" for each in words)
    return struct.pack("@" + "".join(letters), *words), tuple(kinds)


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
    # The repr of a class is its name: two of one name may have other fields.
    named = [each[0] for each in kinds if isinstance(each, tuple) and hasattr(each[0], "_fields")]
    return repr((kinds, [(each._fields, sizes_of(each)) for each in named]))
