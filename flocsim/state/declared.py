"""Arrays as a NamedTuple declares them: their sizes, and what they are arrays of.

A field ``motion: Annotated[np.ndarray, ("rows", "n", 6)]`` is an array of that shape. A name stands
for a size that is given when the arrays are made, and may grow later. The elements are numbers, or
of the type that follows the shape: ``Annotated[np.ndarray, ("n",), Pose]``. A field may also be a
record, or another such tuple.
"""

import functools
from typing import Any, get_type_hints

import numpy as np

from flocsim.state.records import Record


@functools.cache
def fields_of(kind: Any) -> dict[str, tuple[Any, tuple[int | str, ...]]]:
    """Return {field: (type of its elements, shape)} of a declaration; a record or a tuple has the
    shape ()."""
    found = {}
    for name, hint in get_type_hints(kind, include_extras=True).items():
        shape, *elements = getattr(hint, "__metadata__", ((), hint))
        found[name] = (elements or [float])[0], shape
    return found


def zeros_of(kind: Any, **sizes: int) -> Any:
    """Return a NamedTuple of arrays of zeros, of the given sizes {name: number}, which lie in one
    block of memory."""
    return views_in(np.zeros(1, block_type(kind, sizes)), kind)


def block_type(kind: Any, sizes: dict[str, int]) -> np.dtype[Any]:
    """Return the type of a record that has all arrays of a declaration as its fields."""
    fields: list[Any] = []
    for name, (element, shape) in fields_of(kind).items():
        whole = tuple(sizes[each] if isinstance(each, str) else each for each in shape)
        if hasattr(element, "_fields"):
            element = block_type(element, sizes)
        elif issubclass(element, Record):
            element = element.dtype
        fields.append((name, element, whole))
    return np.dtype(fields, align=True)


def views_in(block: np.ndarray, kind: Any) -> Any:
    """Return the declared tuple of a block (1,): views of its fields."""
    made = []
    for name, (element, _) in fields_of(kind).items():
        field = block[name]
        made.append(views_in(field, element) if hasattr(element, "_fields") else field[0])
    return kind(*made)


def block_of(arrays: Any) -> np.ndarray:
    """Return the memory of a tuple that zeros_of has made, as whole numbers; what has been put in
    the place of one of its arrays since then is not in it."""
    # A view's base is the block.
    block: np.ndarray = arrays[0].base.view(np.int64)
    return block


def sizes_in(arrays: Any) -> dict[str, int]:
    """Return the sizes {name: number} that a tuple was made with."""
    found: dict[str, int] = {}
    for value, (element, shape) in zip(arrays, fields_of(arrays.__class__).values(), strict=True):
        if hasattr(element, "_fields"):
            found |= sizes_in(value)
        elif shape:
            named = zip(shape, value.shape, strict=True)
            found |= {name: size for name, size in named if isinstance(name, str)}
    return found


def copy_into(arrays: Any, larger: Any) -> None:
    """Copy the contents of a tuple of arrays to where another one of the same kind begins."""
    for value, room in zip(arrays, larger, strict=True):
        if isinstance(value, tuple):
            copy_into(value, room)
        elif isinstance(value, Record):
            room.base[0] = value
        else:
            room[tuple(map(slice, value.shape))] = value


def enlarged(arrays: Any, **sizes: int) -> Any:
    """Return a copy of a tuple in which the axes of such names have the given sizes, with zeros at
    their ends."""
    larger = zeros_of(type(arrays), **(sizes_in(arrays) | sizes))
    copy_into(arrays, larger)
    return larger
