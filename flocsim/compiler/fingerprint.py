"""What a function does, as a hash of bytecode, constants and all that it reaches through globals;
and what a kernel may not do, as its code shows before it is compiled, with file and line.

The hash names what is filed on disk: an edited kernel has another name, whoever calls it. Whatever
reaches machine code has to be in its hash. Numbers, texts, tuples of them, enums of them and named
tuples are told by value; what Python, numpy and numba have is told by name, for their versions are
in the hash. All else is refused by name: what could change without another hash would be computed
with today and be stale tomorrow.

A kernel may not call Python, for kernels run without the interpreter's lock. Nor may it return None
on some of its ways, or make arrays: samples never reach every branch, and numba would refuse what
they leave out in words of its own.
"""

import builtins
import dis
import enum
import functools
import hashlib
import inspect
import sys
import types
from collections.abc import Callable, Iterable, Mapping
from itertools import pairwise
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
from flocsim.compiler.processor import compilers
from flocsim.errors import KernelError

# Types whose values are told by ``repr``.
LITERALS = (bool, int, float, complex, str, bytes, type(None))

# Modules whose numbers are others in each run.
RANDOM = ("random", "numpy.random", "_random")

# Instructions that make what Python allocates, and its name.
CONTAINERS = {"BUILD_LIST": "a list", "BUILD_SET": "a set", "BUILD_MAP": "a dict"}

# Functions of numpy that return an array whatever they are given.
ARRAY_MAKERS = (
    "arange array asarray concatenate copy cross diag empty empty_like eye full full_like identity "
    "linspace logspace ones ones_like outer repeat stack zeros zeros_like"
)


class Intrinsic(NamedTuple):
    """What compiled code calls and numba has yet to make: its ``name``, and ``make()`` it."""

    name: str
    make: Callable[[], Any]


class Untold(Exception):
    """A value that cannot be told; the words say what it is and what to do."""


def told(value: Any) -> str:
    """Return one line that tells a value wholly; Untold where there is none."""
    kind = type(value)
    if kind in LITERALS:
        return repr(value)
    if isinstance(value, Intrinsic):
        return f"intrinsic {value.name}"
    if kind is tuple:
        return f"({', '.join(map(told, value))})"
    if isinstance(value, enum.Enum):
        return f"{value.name} of {told(kind)}"
    if is_named_tuple(kind):
        return f"{told(kind)}({', '.join(map(told, value))})"
    if isinstance(value, np.number | np.bool_):
        return f"{value.dtype.str} {value.tobytes().hex()}"
    if is_named_tuple(value):
        return f"class {value.__name__}{value._fields} {told_items(value._field_defaults)}"
    if isinstance(value, type) and issubclass(value, enum.Enum):
        members = {name: each.value for name, each in value.__members__.items()}
        return f"class {value.__name__}{value.__bases__} {told_items(members)}"
    # What is raised ends a run: no number hangs on its class.
    if isinstance(value, type) and issubclass(value, BaseException):
        return f"class {value.__name__}"
    module, name = getattr(value, "__module__", None), getattr(value, "__name__", None)
    if isinstance(module, str) and isinstance(name, str) and module not in RANDOM:
        for owner in (module, module.partition(".")[0]):
            known = sys.modules.get(owner)
            if getattr(known, name, None) is value and is_versioned(known) and owner != "__main__":
                return f"{owner}.{name}"
    raise Untold(complaint(value))


def told_items(items: Mapping[str, Any]) -> str:
    """Return the line of values with names."""
    return ", ".join(f"{name}={told(value)}" for name, value in items.items())


def is_named_tuple(kind):
    """Return True for a class of named tuples as Python makes them, without more to it."""
    return getattr(kind, "__mro__", ())[1:] == (tuple, object) and hasattr(kind, "_fields")


def complaint(value):
    """Return what a value is that cannot be told, and what to do about it."""
    kind, owner = type(value), type(getattr(value, "__self__", None))
    modules = getattr(value, "__module__", None) or "", kind.__module__, owner.__module__
    if any(each in RANDOM or each.startswith("numpy.random") for each in modules):
        return "which draws random numbers: no run could be repeated; leave them out"
    if callable(value):
        what = f"the class {value.__name__}" if isinstance(value, type) else f"a {kind.__name__}"
        return (
            f"{what}, whose code no hash follows; write a plain function with `def`, a named tuple "
            "or an enum of numbers"
        )
    return f"a {kind.__name__} that can change; make it a parameter or a tuple of numbers"


@functools.lru_cache(maxsize=4096)
def code_text(code, docstring=None):
    """Return what the code does; docstrings, line numbers and file names do not matter."""
    constants = [
        code_text(each) if inspect.iscode(each)
        else sorted(map(repr, each)) if isinstance(each, frozenset)  # in any order otherwise
        else repr(each)
        for each in code.co_consts if each != docstring
    ]  # fmt: skip
    counts = (code.co_argcount, code.co_kwonlyargcount, code.co_posonlyargcount, code.co_flags)
    names = (code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)
    return repr((code.co_code, constants, *names, *counts, code.co_exceptiontable))


class Told(NamedTuple):
    """What a function does, in ``lines``; the ``functions`` that it reaches; ``calls`` {name:
    function}: what of that is compiled apart, which is left out."""

    lines: list[str]
    functions: list[Callable]
    calls: dict[str, Callable]


@functools.lru_cache(maxsize=4096)
def lines_of(function: Any) -> tuple[list[str], dict[str, Any]]:
    """Return what a function's own code does, in lines, and {name: function} that it calls."""
    refuse_closure(function)
    doc = function.__doc__
    lines = [f"{function.__qualname__} {code_text(function.__code__, doc)}"]
    try:
        lines.append(told_items({"": function.__defaults__, **(function.__kwdefaults__ or {})}))
    except Untold as error:
        raise KernelError(f"kernel {where(function)} has a default argument, {error}") from None
    called = {}
    for chain, value in reads(function).items():
        name = ".".join(chain)
        if isinstance(value, types.FunctionType) and not is_library(value):
            called[name] = value
            continue
        try:
            lines.append(f"{name}={told(value)}")
        except Untold as error:
            raise KernelError(
                f"kernel {where(function)} reads the global {name!r}, {error}"
            ) from None
    return lines, called


@functools.lru_cache(maxsize=4096)
def tell(entry: Any) -> Told:
    """Return all that a function does, but for functions that are compiled apart from it, which it
    knows by name.

    KernelError, with the kernel's file and line and the name, for what cannot be told.
    """
    lines: list[str] = []
    functions, calls = [entry], {}
    numbers = {entry: 0}
    for function in functions:  # grows
        if not isinstance(function, types.FunctionType):
            raise KernelError(
                f"{function!r} is no plain function; write one with `def` and leave @njit out"
            )
        own, called = lines_of(function)
        lines += own
        for name, value in called.items():
            if hasattr(value, "apart"):
                lines.append(f"{name}->{value.apart}")
                calls[value.apart] = value
                continue
            if value not in numbers:
                numbers[value] = len(functions)
                functions.append(value)
            # Two functions may share a name, so that a number has to tell which is called.
            lines.append(f"{name}->{numbers[value]}")
    return Told(lines, functions, calls)


def unit_name(function: Callable, options: str) -> str:
    """Return the name of the file of a unit, by what it does up to the units that it calls."""
    return f"flocsim_unit_{hashed(tell(function).lines, options)}"


def hashed(lines: Iterable[str], options: str) -> str:
    """Return the hash of what lines tell, and of how it is compiled."""
    text = "\n".join([compilers(), options, *lines])
    return hashlib.blake2b(text.encode(), digest_size=12).hexdigest()


def fingerprint(
    entry: Callable, fillings: dict[Callable, Callable], options: str = "", linked: Any = None
) -> str:
    """Return a hash of everything that a function does with its hooks filled, and of how it is
    compiled. ``linked``: that function, where it is known.

    KernelError, with the kernel's file and line and the name, for what no hash can follow.
    """
    units, pending = {}, {"": linked or Linker(fillings).link(entry)}
    while pending:
        name, function = pending.popitem()
        units[name] = tell(function)
        pending |= {x: y for x, y in units[name].calls.items() if x not in units}
    return hashed([f"{name}={units[name].lines}" for name in sorted(units)], options)


def reached_by(entry: Any, fillings: Mapping[Callable, Callable]) -> list[types.FunctionType]:
    """Return a function and all plain functions that it reaches, its hooks filled."""
    found: dict[Any, None] = {}
    pending = [entry]
    for value in pending:  # grows
        function = fillings.get(value, value)
        if function not in found and not is_library(function):
            found[function] = None
            called = reads(function).values()
            pending += [each for each in called if isinstance(each, types.FunctionType)]
    return list(found)


def refuse_interpreter(entry: Any, fillings: Mapping[Callable, Callable] | None = None) -> None:
    """Raise KernelError where a function, or one that it reaches, calls ``print``: Python, while it
    runs compiled. ``fillings`` {hook: function}: what stands in the place of hooks."""
    for function in reached_by(entry, fillings or {}):
        for chain, value in reads(function).items():
            if value is builtins.print:
                raise KernelError(
                    f"kernel {where(function)} calls {'.'.join(chain)}: compiled code cannot call "
                    "Python while it runs; take it out (to look into a kernel, call it from Python)"
                )


@functools.lru_cache(maxsize=1024)
def wrong_return(kernel: types.FunctionType, parts: int | None) -> str:
    """Return what a kernel returns somewhere in place of ``parts`` numbers (None: any tuple of
    them), in words; "" where nothing wrong shows. Only a call could tell what other calls give."""
    code = kernel.__code__
    for before, last in pairwise(dis.get_instructions(code)):
        if last.opname not in ("RETURN_VALUE", "RETURN_CONST"):
            continue
        each, count = before if last.opname == "RETURN_VALUE" else last, None
        if each.opname in ("LOAD_CONST", "RETURN_CONST"):
            value = each.argval
            count = 1 if isinstance(value, (int, float)) else count
            count = len(value or ()) if value is None or isinstance(value, tuple) else count
        elif each.opname == "BUILD_TUPLE":
            count = each.arg
        elif each.opname in ("BINARY_OP", "UNARY_NEGATIVE", "COMPARE_OP"):
            count = 1
        place = f"{code.co_filename}:{last.positions.lineno or code.co_firstlineno}"
        if count == 0:
            return f"returns None on the way that ends in {place}"
        if count is not None and parts is not None and count != parts:
            return f"returns {'one number' if count == 1 else f'{count} numbers'} in {place}"
    return ""


@functools.lru_cache(maxsize=1024)
def made_by(kernel: Callable) -> str:
    """Return "makes an array (np.zeros) in file:line" of a kernel or of a helper of its; "" where
    none does."""
    for function in reached_by(kernel, {}):
        file, line = function.__code__.co_filename, function.__code__.co_firstlineno
        for chain, value in reads(function).items():
            module = getattr(value, "__module__", None) or "numpy"
            if chain[-1] in ARRAY_MAKERS.split() and module.startswith("numpy"):
                return f"makes an array ({'.'.join(chain)}) in {file}:{line}"
        for code in codes_in(function.__code__):
            for each in dis.get_instructions(code):
                if (what := CONTAINERS.get(each.opname)) is not None:
                    return f"makes {what} in {file}:{each.positions.lineno or line}"
    return ""
