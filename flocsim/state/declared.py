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
    """Return a NamedTuple of arrays of zeros, of the given sizes {name: number}."""
    made: dict[str, Any] = {}
    for name, (element, shape) in fields_of(kind).items():
        whole = tuple(sizes[each] if isinstance(each, str) else each for each in shape)
        if not issubclass(element, Record):
            made[name] = np.zeros(whole, element) if shape else zeros_of(element, **sizes)
        else:
            made[name] = element.rows(*whole) if shape else element.one()
    return kind(**made)


def enlarged(arrays: Any, **sizes: int) -> Any:
    """Return the same tuple in which the axes of such names have the given sizes, with zeros at
    their ends."""
    larger: dict[str, Any] = {}
    for name, (element, shape) in fields_of(arrays.__class__).items():
        value = getattr(arrays, name)
        if hasattr(element, "_fields"):
            larger[name] = enlarged(value, **sizes)
        elif sizes.keys() & set(shape):
            whole = [
                sizes.get(str(each), size) for each, size in zip(shape, value.shape, strict=True)
            ]
            larger[name] = np.zeros(whole, value.dtype)
            larger[name][tuple(map(slice, value.shape))] = value
    return arrays._replace(**larger)
