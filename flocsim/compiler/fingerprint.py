"""What a function does, as a hash: bytecode, constants, and all that it reaches through globals.

It names what the composer files on disk: an edited kernel has another name, whoever calls it.
"""

import dis
import hashlib
import inspect
import sys
import types
from collections.abc import Callable
from typing import Any

from flocsim.errors import KernelError

LITERALS = (bool, int, float, complex, str, bytes, type(None))
"""Types of globals that a kernel may read: their value is part of the hash."""


def where(function: Any) -> str:
    """ "name (file:line)" of a function, for messages."""
    code = function.__code__
    return f"{function.__qualname__} ({code.co_filename}:{code.co_firstlineno})"


def refuse_closure(function: Any) -> None:
    """KernelError where the function captures variables."""
    if function.__closure__:
        captured = ", ".join(function.__code__.co_freevars)
        raise KernelError(
            f"kernel {where(function)} captures {captured}; "
            "make it a parameter (a field of the force) or a module constant"
        )


def names_in(code: types.CodeType) -> set[str]:
    """Global names that the code reads, those of nested code included."""
    names = set(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            names |= names_in(constant)
    return names


def plain(value):
    """The Python function behind a compiled one; anything else as it is."""
    return getattr(value, "py_func", value)


def reached(function: Any) -> dict[str, Any]:
    """The globals that a function reads: {name: value}."""
    known = function.__globals__
    names = sorted(names_in(function.__code__))
    return {name: plain(known[name]) for name in names if name in known}


def attributes_of(code, name):
    """Chains of attributes that the code reads of a global: name.a.b gives ("a", "b")."""
    chain = None
    for instruction in dis.get_instructions(code):
        if chain is not None and instruction.opname in ("LOAD_ATTR", "LOAD_METHOD"):
            chain.append(instruction.argval)
            continue
        if chain:
            yield tuple(chain)
        starts = instruction.opname == "LOAD_GLOBAL" and instruction.argval == name
        chain = [] if starts else None
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from attributes_of(constant, name)


def reached_in_modules(function):
    """What a function reads as attributes of modules: {dotted name: value}.

    Python's own modules and numpy are left out: their versions are part of the hash.
    """
    found = {}
    for name, module in reached(function).items():
        if not isinstance(module, types.ModuleType) or is_versioned(module):
            continue
        for chain in attributes_of(function.__code__, name):
            value, dotted = module, name
            for attribute in chain:
                if isinstance(value, types.ModuleType):
                    value, dotted = plain(getattr(value, attribute, None)), f"{dotted}.{attribute}"
            found[dotted] = value
    return found


def is_versioned(module):
    """Whether a module is Python's own or numpy's."""
    root = module.__name__.partition(".")[0]
    return root in sys.stdlib_module_names or root == "numpy"


def code_digest(code):
    """A hash of what the code does; docstrings, line numbers and file names do not matter."""
    constants = [
        code_digest(c) if isinstance(c, types.CodeType) else repr(c) for c in code.co_consts
    ]
    if has_docstring(code):
        constants[0] = "docstring"
    parts = (code.co_code, constants, code.co_names, code.co_varnames, code.co_argcount)
    return hashlib.blake2b(repr(parts).encode(), digest_size=16).hexdigest()


def has_docstring(code):
    """Whether the first constant of the code is its docstring."""
    if sys.version_info >= (3, 13):
        return bool(code.co_flags & inspect.CO_HAS_DOCSTRING)
    # Before, that place was None without one.
    return bool(code.co_consts) and isinstance(code.co_consts[0], str)


def line_on(name, value):
    """One line about a global that is no function, for the hash; None for what may change."""
    if isinstance(value, types.ModuleType):
        return f"{name}=module {value.__name__}"
    if isinstance(value, type):
        return f"{name}=class {value.__name__} {getattr(value, '_fields', ())}"
    if is_literal(value):
        return f"{name}={value!r}"
    return f"{name}={value.__name__}" if callable(value) else None


def is_literal(value):
    """Whether a value is a number, a text, or a tuple of such: what cannot change."""
    if isinstance(value, tuple):
        return all(is_literal(part) for part in value)
    return isinstance(value, LITERALS)


def fingerprint(entry: Any, fillings: dict[Callable, Callable], options: str = "") -> str:
    """A hash of everything that the composed function does, and of how it is compiled."""
    import numba
    import numpy

    lines = [sys.version, numba.__version__, numpy.__version__, options]
    seen: dict[Callable, int] = {}

    def visit(function):
        function = fillings.get(function, function)
        if function in seen:
            return seen[function]
        seen[function] = len(seen)
        refuse_closure(function)
        lines.append(f"{function.__qualname__} {code_digest(function.__code__)}")
        lines.append(repr(function.__defaults__))
        for name, value in (reached(function) | reached_in_modules(function)).items():
            if isinstance(value, types.FunctionType):
                # Two functions may share a name, so that a number has to tell which is called.
                lines.append(f"{name}->{visit(value)}")
                continue
            line = line_on(name, value)
            if line is None:
                raise KernelError(
                    f"kernel {where(function)} reads the global {name!r}, a "
                    f"{type(value).__name__} that can change; make it a parameter or a number"
                )
            lines.append(line)
        return seen[function]

    visit(entry)
    return hashlib.blake2b("\n".join(lines).encode(), digest_size=12).hexdigest()
