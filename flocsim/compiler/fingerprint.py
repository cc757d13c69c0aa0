"""What a function does, as a hash: bytecode, constants, and all that it reaches through globals.

It names what the composer files on disk: an edited kernel has another name, whoever calls it.
What no hash can follow is refused by name (constants, reads).
"""

import functools
import hashlib
import inspect
import sys
import types
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from flocsim.compiler.constants import Untold, told
from flocsim.compiler.processor import compilers, numba_settings
from flocsim.compiler.reads import chains, module_reads, reached, refuse_closure, where
from flocsim.errors import KernelError


def code_digest(code):
    """A hash of what the code does; docstrings, line numbers and file names do not matter."""
    constants = [constant_text(each) for each in code.co_consts]
    if has_docstring(code):
        constants[0] = "docstring"
    counts = (code.co_argcount, code.co_kwonlyargcount, code.co_posonlyargcount, code.co_flags)
    names = (code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)
    parts = (code.co_code, constants, *names, *counts, getattr(code, "co_exceptiontable", b""))
    return hashlib.blake2b(repr(parts).encode(), digest_size=16).hexdigest()


def constant_text(value):
    """A constant of the code as text that is the same in every process."""
    if isinstance(value, types.CodeType):
        return code_digest(value)
    if isinstance(value, frozenset):
        return f"set {sorted(map(constant_text, value))}"
    return repr(value)


def has_docstring(code):
    """Whether the first constant of the code is its docstring."""
    if sys.version_info >= (3, 13):
        return bool(code.co_flags & inspect.CO_HAS_DOCSTRING)
    # Before, that place was None without one.
    return bool(code.co_consts) and isinstance(code.co_consts[0], str)


@functools.cache
def compiler_text() -> str:
    """What compiles: Python, numba, LLVM, numpy and numba's settings."""
    return f"{compilers()}\n{numba_settings()}"


def globals_read(function: Any) -> Iterable[tuple[str, Any]]:
    """(name, value) of all that a function reads, attributes of modules by their dotted names."""
    for name, value in reached(function).items():
        if not isinstance(value, types.ModuleType):
            yield name, value
    for chain, value in module_reads(function).items():
        yield ".".join(chain), value


def told_of(function, name, value):
    """The line of a value that a function reads; KernelError where there is none."""
    try:
        return told(value)
    except Untold as error:
        code = function.__code__
        if "." not in name and not any(chain[0] == name for chain in chains(code)):
            return "an attribute of that name is read, not the global"
        raise KernelError(f"kernel {where(function)} reads the global {name!r}, {error}") from None


def told_defaults(function):
    """The line of a function's default arguments; KernelError for one that could change."""
    defaults = {"": function.__defaults__ or (), **(function.__kwdefaults__ or {})}
    try:
        return " ".join(f"{name}={told(value)}" for name, value in defaults.items())
    except Untold as error:
        raise KernelError(f"kernel {where(function)} has a default argument, {error}") from None


class Told(NamedTuple):
    """What a function does, in ``lines``, the ``functions`` that it reaches and what they ``read``;
    ``calls`` {name: function} what of that is compiled apart, where that is left out."""

    lines: list[str]
    functions: list[Callable]
    read: list[Any]
    calls: dict[str, Callable]


def tell(entry: Any, fillings: dict[Callable, Callable], *, within: bool = False) -> Told:
    """All that a function does; ``within``: but for functions that are compiled apart from it,
    which it knows by name.

    KernelError, with the kernel's file and line and the name, for what cannot be told.
    """
    lines: list[str] = []
    seen: dict[Callable, int] = {}
    read: list[Any] = []
    calls: dict[str, Callable] = {}

    def visit(function):
        function = fillings.get(function, function)
        if function in seen:
            return seen[function]
        seen[function] = len(seen)
        if not isinstance(function, types.FunctionType):
            raise KernelError(
                f"{function!r} is no plain function; write one with `def` and leave @njit out"
            )
        refuse_closure(function)
        lines.append(f"{function.__qualname__} {code_digest(function.__code__)}")
        lines.append(told_defaults(function))
        for name, value in globals_read(function):
            if within and hasattr(value, "apart"):
                lines.append(f"{name}->{value.apart}")
                calls[value.apart] = value
                continue
            if isinstance(value, types.FunctionType):
                # Two functions may share a name, so that a number has to tell which is called.
                lines.append(f"{name}->{visit(value)}")
                continue
            lines.append(f"{name}={told_of(function, name, value)}")
            read.append(value)
        return seen[function]

    visit(entry)
    return Told(lines, list(seen), read, calls)


def fingerprint(entry: Any, fillings: dict[Callable, Callable], options: str = "") -> str:
    """A hash of everything that the composed function does, and of how it is compiled.

    KernelError, with the kernel's file and line and the name, for what no hash can follow.
    """
    from flocsim.compiler.numba_internals import refuse_extensions

    found = tell(entry, fillings)
    refuse_extensions(found.functions, found.read)
    return hashed(found.lines, options)


def hashed(lines: Iterable[str], options: str) -> str:
    """The hash of what lines tell, and of how it is compiled."""
    text = "\n".join([compiler_text(), options, *lines])
    return hashlib.blake2b(text.encode(), digest_size=12).hexdigest()
