"""What a kernel may not do, as its code shows before it is compiled, with file and line.

Calls of Python: kernels run without the interpreter's lock. Inner functions have no environment in
which numba's ``print`` finds what it needs of Python: it fails while it holds the lock, never gives
it back, and the process hangs with all of its threads, deaf to signals.

Returns of None on some of its ways, and arrays: samples never reach every branch, and what they
leave out numba would compile to a None or refuse in words of its own.
"""

import builtins
import dis
import functools
import sys
import types
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from flocsim.compiler.linker import (
    ATTRIBUTE_LOADS,
    PACKAGE,
    is_versioned,
    module_reads,
    reached,
    where,
)
from flocsim.errors import KernelError

OBJECT_MODE = "objmode"
"""numba's name for a way back into Python."""


@functools.lru_cache(maxsize=4096)
def instructions(code: types.CodeType) -> tuple[tuple[str, Any, int], ...]:
    """(name, argument, line) of every instruction of a code and of the codes in it; kept, for
    disassembly takes longer than a short run."""
    found = [(each.opname, each.argval, line_of(each, code)) for each in dis.get_instructions(code)]
    nested = [each for each in code.co_consts if isinstance(each, types.CodeType)]
    return tuple(found) + sum(map(instructions, nested), ())


def line_of(instruction, code):
    """The line of an instruction, or of its code."""
    line = instruction.positions.lineno if instruction.positions else None
    return line or code.co_firstlineno


def refuse_interpreter(entry: Any, fillings: Mapping[Callable, Callable] | None = None) -> None:
    """KernelError where a function, or one that it reaches, calls Python while it runs compiled.

    ``fillings`` {hook: function}: what stands in the place of hooks.
    """
    numba = sys.modules.get("numba")  # where it is not loaded, nothing of it can be called
    forbidden = [print, getattr(numba, OBJECT_MODE, print)]
    fillings = fillings or {}
    pending, seen = [entry], set()
    while pending:
        function = pending.pop()
        function = fillings.get(function, function)
        if function in seen or not isinstance(function, types.FunctionType):
            continue
        seen.add(function)
        pending += [each for each in reached(function).values() if callable(each)]
        if function.__code__.co_filename.startswith(PACKAGE):
            continue  # flocsim's own do not, and are many
        for opname, name, line in instructions(function.__code__):
            calls = opname in ATTRIBUTE_LOADS and name == OBJECT_MODE
            if opname in ("LOAD_GLOBAL", "LOAD_NAME"):
                value = function.__globals__.get(name, getattr(builtins, name, None))
                calls = any(value is each for each in forbidden)
            if calls:
                raise KernelError(
                    f"kernel {where(function)} calls {name} in line {line}: compiled code cannot "
                    "call Python while it runs; take it out (to look into a kernel, call it from "
                    "Python)"
                )


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


def parts_left(instruction):
    """How many parts an instruction leaves to be returned: 0 for None, 1 for one number that is
    computed or written there, k for a tuple of k; None where only a call could tell."""
    if instruction.opname == "BUILD_TUPLE":
        return instruction.arg
    if instruction.opname in ("BINARY_OP", "UNARY_NEGATIVE", "COMPARE_OP"):
        return 1
    value = instruction.argval
    if instruction.opname not in ("LOAD_CONST", "RETURN_CONST"):
        return None
    if value is None or isinstance(value, tuple):
        return len(value or ())
    return 1 if isinstance(value, (int, float)) else None


@functools.lru_cache(maxsize=1024)
def wrong_return(kernel: types.FunctionType, parts: int | None) -> str:
    """What a kernel returns somewhere in place of ``parts`` numbers (None: any tuple of them), in
    words; "" where nothing wrong shows."""
    code, before = kernel.__code__, None
    for each in dis.get_instructions(code):
        last = {"RETURN_CONST": each, "RETURN_VALUE": before}.get(each.opname)
        count = parts_left(last) if last else None
        place = f"{code.co_filename}:{line_of(each, code)}"
        if count == 0:
            return f"returns None on the way that ends in {place}"
        if count is not None and parts is not None and count != parts:
            what = "one number" if count == 1 else f"{count} numbers"
            return f"returns {what} in {place}"
        before = each
    return ""


def made_in(function: types.FunctionType) -> Iterator[tuple[str, int]]:
    """(what, line) of every container or array that a function's own code makes."""
    alone = [((name,), value) for name, value in reached(function).items()]
    makers = {
        chain[-1]: ".".join(chain)
        for chain, value in [*module_reads(function).items(), *alone]
        if getattr(value, "__name__", "") in ARRAY_MAKERS
        and (getattr(value, "__module__", None) or "numpy").startswith("numpy")
    }
    for opname, argument, line in instructions(function.__code__):
        if opname in CONTAINERS:
            yield CONTAINERS[opname], line
        elif opname.startswith("LOAD") and argument in makers:
            yield f"an array ({makers[argument]})", line


@functools.lru_cache(maxsize=1024)
def made_by(kernel: Callable) -> str:
    """ "makes an array (np.zeros) in file:line" of a kernel or of a helper of its; "" where none
    does. Numpy's functions, which compiled code has in its own way, and Python's are no helpers."""
    pending, seen = [kernel], set()
    while pending:
        function = pending.pop()
        if not isinstance(function, types.FunctionType) or function in seen:
            continue
        seen.add(function)
        module = sys.modules.get(function.__module__ or "")
        if module is not None and module.__name__ != "__main__" and is_versioned(module):
            continue
        for what, line in made_in(function):
            return f"makes {what} in {function.__code__.co_filename}:{line}"
        pending += [*reached(function).values(), *module_reads(function).values()]
    return ""
