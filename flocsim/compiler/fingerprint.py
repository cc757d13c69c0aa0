"""Hash of what a function does: its bytecode, its constants and all that it reaches by globals.

The hash names a file of machine code, so it has to cover all that the machine code depends on.
Numbers, texts, tuples of them and named tuples enter by value; functions of Python,
numpy and numba enter by name, as the versions of these are in the hash. Anything else is refused
with file, line and name: it could change, and the stored machine code would then be stale.

Kernels run without the interpreter's lock, so that a kernel that prints is refused as well.
"""

import dis
import functools
import hashlib
import inspect
import sys
import types
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np

from flocsim.compiler.linker import (
    Linker,
    codes_in,
    is_library,
    is_versioned,
    reads,
    refuse_closure,
    where,
)
from flocsim.compiler.processor import versions
from flocsim.errors import KernelError


class Intrinsic(NamedTuple):
    """A function that exists in compiled code only. ``make()`` returns it once numba is loaded;
    ``name`` identifies it in hashes."""

    name: str
    make: Callable[[], Any]


def value_text(value: Any) -> str:
    """Return a text that determines a value; TypeError with what to do if there is none."""
    kind = type(value)
    # ``repr`` tells -0.0 from 0.0 and is exact.
    if kind in (bool, int, float, complex, str, bytes, type(None)):
        return repr(value)
    if kind is tuple:
        return f"({', '.join(map(value_text, value))})"
    if isinstance(value, Intrinsic):
        return f"intrinsic {value.name}"
    if isinstance(value, np.number | np.bool_):
        return f"{kind} {value!r}"
    if is_named_tuple(kind):
        return f"{value_text(kind)}({', '.join(map(value_text, value))})"
    # A kernel that makes such tuples reads their class: fields and defaults say all of it.
    if is_named_tuple(value):
        defaults = value_text(tuple(value._field_defaults.items()))
        return f"class {value.__name__}{value._fields} {defaults}"
    # The rest must be found under its own name in a versioned module: then its name and the
    # versions in the hash determine what it does. Random numbers never do.
    module, name = getattr(value, "__module__", None), getattr(value, "__name__", None)
    if isinstance(module, str) and isinstance(name, str) and "random" not in module:
        for owner in (module, module.partition(".")[0]):
            known: Any = sys.modules.get(owner)
            if getattr(known, name, None) is value and is_versioned(known) and owner != "__main__":
                return f"{owner}.{name}"
    raise TypeError(refusal(value))


def is_named_tuple(kind: Any) -> bool:
    """Return True for a class of named tuples as typing makes it, with no other base."""
    return getattr(kind, "__mro__", ())[1:] == (tuple, object) and hasattr(kind, "_fields")


def refusal(value: Any) -> str:
    """Return what a value without a text is, and what to write in its place."""
    kind, owner = type(value), type(getattr(value, "__self__", None))
    # A bound method of a random generator tells its module only through the generator.
    modules = f"{getattr(value, '__module__', None)}.{kind.__module__}.{owner.__module__}"
    if {"random", "_random"} & set(modules.split(".")):
        return "which draws random numbers: no run could be repeated; leave them out"
    if callable(value):
        what = f"the class {value.__name__}" if isinstance(value, type) else f"a {kind.__name__}"
        return (
            f"{what}, whose code no hash follows; write a plain function with `def`, or a named "
            "tuple of numbers"
        )
    return f"a {kind.__name__} that can change; make it a parameter or a tuple of numbers"


@functools.lru_cache(maxsize=4096)
def code_text(code: types.CodeType, docstring: str | None = None) -> str:
    """Return a text that determines what code does, without docstring, line numbers and file."""
    # Constants enter by repr: 0.0 and −0.0, or 1 and 1.0, are equal, but compile to other code.
    constants = [
        code_text(each) if inspect.iscode(each)
        else sorted(map(repr, each)) if isinstance(each, frozenset)  # in any order otherwise
        else repr(each)
        for each in code.co_consts if each != docstring
    ]  # fmt: skip
    counts = (code.co_argcount, code.co_kwonlyargcount, code.co_posonlyargcount, code.co_flags)
    names = (code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)
    return repr((code.co_code, constants, *names, *counts, code.co_exceptiontable))


class Description(NamedTuple):
    """What a function does, in ``lines``; the ``functions`` that it reaches; and those that are
    compiled as units of their own, ``calls`` {name: function}, of which the lines give the name."""

    lines: list[str]
    functions: list[Callable]
    calls: dict[str, Callable]


@functools.lru_cache(maxsize=4096)
def own_lines(function: Any) -> tuple[list[str], dict[str, Any]]:
    """Return lines on a function's own code, and {name: function} of what it calls."""
    refuse_closure(function)
    lines = [f"{function.__qualname__} {code_text(function.__code__, function.__doc__)}"]
    defaults = function.__defaults__, *(function.__kwdefaults__ or {}).items()
    read = {f"the global {'.'.join(chain)!r}": value for chain, value in reads(function).items()}
    called = {}
    for name, value in {"a default argument": defaults, **read}.items():
        # Functions get lines of their own; the value of anything else must determine it.
        if isinstance(value, types.FunctionType) and not is_library(value):
            called[name] = value
            continue
        try:
            lines.append(f"{name}={value_text(value)}")
        except TypeError as error:
            raise KernelError(f"kernel {where(function)} reads {name}, {error}") from None
    return lines, called


@functools.lru_cache(maxsize=4096)
def describe(entry: Any) -> Description:
    """Return the description of a function and of all that it reaches, up to other units.

    Raises KernelError, with file, line and name, for what has no text.
    """
    lines: list[str] = []
    functions, calls = [entry], {}
    for function in functions:  # grows
        if not isinstance(function, types.FunctionType):
            raise KernelError(
                f"{function!r} is no plain function; write one with `def` and leave @njit out"
            )
        own, called = own_lines(function)
        lines += own
        for name, value in called.items():
            # A unit of its own: its name suffices, as its code is stored and checked by itself.
            if hasattr(value, "apart"):
                lines.append(f"{name}->{value.apart}")
                calls[value.apart] = value
                continue
            if value not in functions:
                functions.append(value)
            # Two functions may share a name, so that a number has to tell which is called.
            lines.append(f"{name}->{functions.index(value)}")
    return Description(lines, functions, calls)


def refuse_python(function: Any) -> None:
    """Raise KernelError where a function prints or raises, which compiled code cannot do while it
    runs."""
    # Every other byte is the number of an operation; `assert` compiles to that of `raise`.
    operations = b"".join(code.co_code[::2] for code in codes_in(function.__code__))
    prints = any(value is print for value in reads(function).values())
    if prints or dis.opmap["RAISE_VARARGS"] in operations:
        raise KernelError(
            f"kernel {where(function)} prints, raises an exception or asserts, which compiled code "
            "cannot: return math.nan where there is no answer; to look into it, use jit=False"
        )


def hashed(lines: Iterable[str], options: str) -> str:
    """Return the hash of lines, of how they are compiled, and of all versions."""
    text = "\n".join([repr(versions()), options, *lines])
    return hashlib.blake2b(text.encode(), digest_size=12).hexdigest()


def fingerprint(
    entry: Callable, fillings: dict[Callable, Callable], options: str = "", linked: Any = None
) -> str:
    """Return a hash of all that a function does with its hooks filled, in all its units.

    ``linked``: that function with its hooks filled, where it is at hand; ``options``: how it is
    compiled. Raises KernelError, with file, line and name, for what no hash covers and for `print`.
    """
    units: dict[str, Description] = {}
    pending = {"": linked or Linker(fillings).link(entry)}
    # Follow the calls from unit to unit, until each of them has been described once.
    while pending:
        name, function = pending.popitem()
        units[name] = describe(function)
        pending |= {x: y for x, y in units[name].calls.items() if x not in units}
    for function in (each for unit in units.values() for each in unit.functions):
        refuse_python(function)
    return hashed([f"{name}={units[name].lines}" for name in sorted(units)], options)
