"""Calls of Python out of compiled code: refused before anything is compiled, with file and line.

Kernels run without the interpreter's lock. Inner functions have no environment in which numba's
``print`` finds what it needs of Python: it fails while it holds the lock, never gives it back, and
the process hangs with all of its threads, deaf to signals.
"""

import builtins
import dis
import functools
import sys
import types
from collections.abc import Callable, Mapping
from typing import Any

from flocsim.compiler.reads import PACKAGE, reached, where
from flocsim.errors import KernelError

OBJECT_MODE = "objmode"
"""numba's name for a way back into Python."""


def interpreter_call(function: types.FunctionType) -> tuple[str, int] | None:
    """(name, line) of the first call of Python in a function's own code; None without one."""
    known = function.__globals__
    numba = sys.modules.get("numba")  # where it is not loaded, nothing of it can be called
    forbidden = [print, getattr(numba, OBJECT_MODE, print)]
    for name, line, is_attribute in names_loaded(function.__code__):
        value = known.get(name, getattr(builtins, name, None))
        if name == OBJECT_MODE if is_attribute else any(value is each for each in forbidden):
            return name, line
    return None


@functools.lru_cache(maxsize=4096)
def names_loaded(code: types.CodeType) -> tuple[tuple[str, int, bool], ...]:
    """(name, line, whether of an attribute) of every global and attribute that a code, and the
    codes in it, load; kept, for disassembly takes longer than a short run."""
    found = []
    for each in dis.get_instructions(code):
        is_attribute = each.opname in ("LOAD_ATTR", "LOAD_METHOD")
        if is_attribute or each.opname in ("LOAD_GLOBAL", "LOAD_NAME"):
            line = (each.positions.lineno if each.positions else None) or code.co_firstlineno
            found.append((each.argval, line, is_attribute))
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            found += names_loaded(constant)
    return tuple(found)


def refuse_interpreter(entry: Any, fillings: Mapping[Callable, Callable] | None = None) -> None:
    """KernelError where a function, or one that it reaches, calls Python while it runs compiled.

    ``fillings`` {hook: function}: what stands in the place of hooks.
    """
    fillings = fillings or {}
    pending, seen = [entry], set()
    while pending:
        function = fillings.get(pending[-1], pending[-1])
        pending.pop()
        if function in seen or not isinstance(function, types.FunctionType):
            continue
        seen.add(function)
        pending += [each for each in reached(function).values() if callable(each)]
        if function.__code__.co_filename.startswith(PACKAGE):
            continue  # flocsim's own do not, and are many
        if (found := interpreter_call(function)) is not None:
            name, line = found
            raise KernelError(
                f"kernel {where(function)} calls {name} in line {line}: compiled code cannot call "
                "Python while it runs; take it out (to look into a kernel, call it from Python)"
            )
