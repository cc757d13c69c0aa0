"""What a kernel's code shows before it is called: returns on all of its ways, and no arrays.

Samples never reach every branch. What they leave out, numba would compile to a None or refuse in
words of its own.
"""

import dis
import functools
import sys
import types
from collections.abc import Callable, Iterator

from flocsim.compiler.reads import is_versioned, module_reads, reached

CONTAINERS = {
    "BUILD_LIST": "a list", "BUILD_SET": "a set", "BUILD_MAP": "a dict",
    "BUILD_CONST_KEY_MAP": "a dict", "LIST_APPEND": "a list", "SET_ADD": "a set",
    "MAP_ADD": "a dict",
}  # fmt: skip
"""Instructions that make what Python allocates, and its name."""

ARRAY_MAKERS = {
    "arange", "array", "asanyarray", "asarray", "ascontiguousarray", "asfortranarray",
    "atleast_1d", "atleast_2d", "column_stack", "concatenate", "copy", "cross", "diag",
    "dstack", "empty", "empty_like", "eye", "fromiter", "full", "full_like", "geomspace",
    "hstack", "identity", "linspace", "logspace", "meshgrid", "ndarray", "ones", "ones_like",
    "outer", "repeat", "stack", "tile", "vstack", "zeros", "zeros_like",
}  # fmt: skip
"""Functions of numpy that give an array whatever they are given."""


def line_of(instruction, code):
    """The line of an instruction, or of its code."""
    line = instruction.positions.lineno if instruction.positions else None
    return line or code.co_firstlineno


@functools.lru_cache(maxsize=1024)
def returned(code: types.CodeType) -> tuple[tuple[int, int | None], ...]:
    """(line, how many parts) of every return whose kind is seen: 0 for None, 1 for one number that
    was computed or written there, k for a tuple of k; None where only a call could tell."""
    found = []
    before = None
    for each in dis.get_instructions(code):
        if each.opname == "RETURN_CONST":
            found.append((line_of(each, code), parts_of(each.argval)))
        elif each.opname == "RETURN_VALUE" and before is not None:
            found.append((line_of(each, code), parts_left(before)))
        before = each
    return tuple(found)


def parts_of(value):
    """How many parts a constant has: 0 for None, 1 for a number, k for a tuple; None else."""
    if value is None:
        return 0
    if isinstance(value, tuple):
        return len(value)
    return 1 if isinstance(value, (int, float)) else None


def parts_left(instruction):
    """How many parts an instruction leaves to be returned; None where it does not show."""
    if instruction.opname == "BUILD_TUPLE":
        return instruction.arg
    if instruction.opname == "LOAD_CONST":
        return parts_of(instruction.argval)
    if instruction.opname in ("BINARY_OP", "UNARY_NEGATIVE", "COMPARE_OP"):
        return 1
    return None


def wrong_return(kernel: types.FunctionType, parts: int | None) -> str:
    """What a kernel returns somewhere in place of ``parts`` numbers (None: any tuple of them), in
    words; "" where nothing wrong shows."""
    code = kernel.__code__
    for line, count in returned(code):
        place = f"{code.co_filename}:{line}"
        if count == 0:
            return f"returns None on the way that ends in {place}"
        if count is not None and parts is not None and count != parts:
            what = "one number" if count == 1 else f"{count} numbers"
            return f"returns {what} in {place}"
    return ""


def made_in(function: types.FunctionType) -> Iterator[tuple[str, int]]:
    """(what, line) of every container or array that a function's own code makes."""
    code = function.__code__
    makers = {
        chain[-1]: ".".join(chain)
        for chain, value in [*module_reads(function).items(), *alone(function)]
        if getattr(value, "__name__", "") in ARRAY_MAKERS
        and (getattr(value, "__module__", None) or "numpy").startswith("numpy")
    }
    pending = [code]
    while pending:
        each = pending.pop()
        pending += [c for c in each.co_consts if isinstance(c, types.CodeType)]
        for instruction in dis.get_instructions(each):
            line = line_of(instruction, each)
            if instruction.opname in CONTAINERS:
                yield CONTAINERS[instruction.opname], line
            elif instruction.opname.startswith("LOAD") and instruction.argval in makers:
                yield f"an array ({makers[instruction.argval]})", line


def alone(function):
    """(name,), value of the globals that a function reads by a name of their own."""
    return [((name,), value) for name, value in reached(function).items()]


@functools.lru_cache(maxsize=1024)
def made_by(kernel: Callable) -> str:
    """ "makes an array (np.zeros) in file:line" of a kernel or of a helper of its; "" where none
    does."""
    pending, seen = [kernel], set()
    while pending:
        function = pending.pop()
        if not isinstance(function, types.FunctionType) or function in seen:
            continue
        seen.add(function)
        if is_versioned_function(function):
            continue
        for what, line in made_in(function):
            return f"makes {what} in {function.__code__.co_filename}:{line}"
        pending += [*reached(function).values(), *module_reads(function).values()]
    return ""


def is_versioned_function(function):
    """Whether it is numpy's, which compiled code has in its own way, or Python's own."""
    module = sys.modules.get(function.__module__ or "")
    return module is not None and module.__name__ != "__main__" and is_versioned(module)
