"""What a kernel may read beside functions: values that a line of text tells wholly.

Whatever reaches machine code has to be in its hash. Numbers, texts, tuples of them, enums of them
and named tuples are told by value; what Python, numpy and numba have is told by name, for their
versions are in the hash. All else is refused: what could change without another hash would be
computed with today and be stale tomorrow.
"""

import enum
import sys
from collections.abc import Callable
from typing import Any, NamedTuple

from flocsim.compiler.reads import is_versioned

LITERALS = (bool, int, float, complex, str, bytes, type(None))
"""Types whose values are told by ``repr``."""

RANDOM = ("random", "numpy.random")
"""Modules whose numbers are others in each run."""

OF_NUMBA = ("prange", "literally", "literal_unroll")
"""What a kernel may call of numba itself, beside its types as conversions."""


class Intrinsic(NamedTuple):
    """What compiled code calls and numba has yet to make: its ``name``, and ``make()`` it."""

    name: str
    make: Callable[[], Any]


class Untold(Exception):
    """A value that cannot be told; the words say what it is and what to do."""


def told(value: Any) -> str:
    """One line that tells a value wholly; Untold where there is none."""
    if type(value) in LITERALS:
        return repr(value)
    if isinstance(value, Intrinsic):
        return f"intrinsic {value.name}"
    if type(value) is tuple:
        return f"({', '.join(map(told, value))})"
    if isinstance(value, type):
        return told_class(value)
    if isinstance(value, enum.Enum):
        return f"{value.name} of {told_class(type(value))}"
    if is_named_tuple(type(value)):
        return f"{told_class(type(value))}({', '.join(map(told, value))})"
    line = told_number(value) or told_by_name(value) or told_of_numba(value)
    if line is None:
        raise Untold(complaint(value))
    return line


def told_number(value):
    """The line of a number of numpy's; None for anything else."""
    numpy = sys.modules.get("numpy")
    if numpy is None or not isinstance(value, (numpy.number, numpy.bool_)):
        return None
    return f"{value.dtype.str} {value.tobytes().hex()}"


def is_named_tuple(kind):
    """Whether a class is a named tuple as Python makes them, without more to it."""
    return kind.__mro__[1:] == (tuple, object) and hasattr(kind, "_fields")


def told_class(kind):
    """The line of a class; Untold for one that is no named tuple, enum or exception."""
    if is_named_tuple(kind):
        defaults = ", ".join(f"{name}={told(v)}" for name, v in kind._field_defaults.items())
        return f"class {kind.__name__}{kind._fields} {defaults}"
    if issubclass(kind, enum.Enum):
        bases = [base.__name__ for base in kind.__mro__[1:]]
        members = ", ".join(f"{name}={told(m.value)}" for name, m in kind.__members__.items())
        return f"class {kind.__name__}{bases} {members}"
    # What is raised ends a run; which numbers come before that does not hang on its class.
    if issubclass(kind, BaseException):
        return f"class {kind.__name__}"
    line = told_by_name(kind)
    if line is None:
        raise Untold(
            f"the class {kind.__name__}, which no hash follows; make what it holds a parameter, a "
            "named tuple, an enum of numbers or a module constant"
        )
    return line


def told_by_name(value):
    """The line of what Python or numpy have under a name of their own; None for anything else."""
    module, name = getattr(value, "__module__", None), getattr(value, "__name__", None)
    if not isinstance(module, str) or not isinstance(name, str) or module in RANDOM:
        return None
    for owner in (module, module.partition(".")[0]):
        known = sys.modules.get(owner)
        if getattr(known, name, None) is value and owner != "__main__" and is_versioned(known):
            return f"{owner}.{name}"
    return None


def told_of_numba(value):
    """The line of a type of numba's, or of the few of its functions that a kernel may call."""
    numba = sys.modules.get("numba")
    if numba is None:
        return None
    if isinstance(value, numba.types.Type) and getattr(numba.types, str(value), None) == value:
        return f"numba {value}"
    for name in OF_NUMBA:
        if getattr(numba, name) is value:
            return f"numba {name}"
    return None


def complaint(value):
    """What a value is that cannot be told, and what to do about it."""
    kind = type(value).__name__
    module = getattr(value, "__module__", None) or ""
    owner = getattr(value, "__self__", None)
    if module in RANDOM or type(owner).__module__.partition(".")[0] in ("random", "_random"):
        return "which draws random numbers: no run could be repeated; leave them out"
    makers = (type(value).__module__ or "").partition("._")[0], type(owner).__name__
    if makers[0] in RANDOM or makers[1] == "RandomState":
        return "which draws random numbers: no run could be repeated; leave them out"
    if module.partition(".")[0] == "numba" and not callable(value):
        return f"a {kind} of numba, which no hash follows; leave it out"
    if callable(value):
        return (
            f"a {kind}, whose code no hash follows; write a plain function with `def`, or put "
            "@numba.njit above it"
        )
    return f"a {kind} that can change; make it a parameter, a number or a tuple of numbers"
