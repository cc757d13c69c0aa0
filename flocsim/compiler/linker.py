"""The globals that functions read, and clones of functions in which hooks are replaced.

`reads` finds what a function depends on beside its arguments: globals, and attributes of modules.
`Linker` copies a driver with every function that it reaches, the hooks of a scene filled.
"""

import builtins
import dis
import functools
import inspect
import os
import sys
import types
from collections.abc import Callable
from typing import Any

import attrs

from flocsim.errors import KernelError

# Opcodes that read an attribute. Python 3.11 has a second one, for calls such as a.b().
ATTRIBUTE_LOADS = ("LOAD_ATTR", "LOAD_METHOD")

MISSING = object()


def where(function: Any) -> str:
    """Return "name (file:line)" of a function, for messages."""
    code = function.__code__
    return f"{function.__qualname__} ({code.co_filename}:{code.co_firstlineno})"


def refuse_closure(function: Any) -> None:
    """Raise KernelError where the function captures variables: numba does not tell two functions
    apart that differ in those alone."""
    if function.__closure__:
        captured = ", ".join(function.__code__.co_freevars)
        raise KernelError(
            f"kernel {where(function)} captures {captured}; "
            "make it a parameter (a field of the force) or a module constant"
        )


def codes_in(code: types.CodeType) -> list[types.CodeType]:
    """Return the code and all that is nested in it."""
    # Nested functions and comprehensions are constants of the code around them.
    nested = filter(inspect.iscode, code.co_consts)
    return [code, *(each for one in nested for each in codes_in(one))]


def names_in(code: types.CodeType) -> set[str]:
    """Return the names of globals and attributes that the code reads."""
    return {name for each in codes_in(code) for name in each.co_names}


def is_versioned(module: types.ModuleType) -> bool:
    """Return True for modules of Python, numpy and numba, whose versions are part of the hash; a
    file of the user's that has the name of one of Python's modules is the user's."""
    root = module.__name__.partition(".")[0]
    if root in ("numpy", "numba"):
        return True
    file = getattr(module, "__file__", None) or os.__file__
    # Installed packages lie in the same folder, but Python's version says nothing of them.
    of_python = file.startswith(os.path.dirname(os.__file__)) and "-packages" not in file
    return root in sys.stdlib_module_names and of_python


def is_library(function: Any) -> bool:
    """Return True for functions of Python, numpy and numba, of which numba has implementations of
    its own."""
    module = sys.modules.get(function.__module__ or "")
    return module is not None and module.__name__ != "__main__" and is_versioned(module)


def plain(value: Any) -> Any:
    """Return the Python function behind one of @njit; anything else as it is."""
    if not hasattr(value, "py_func"):
        return value
    from numba.extending import is_jitted

    return value.py_func if is_jitted(value) else value


@functools.lru_cache(maxsize=4096)
def chains(code: types.CodeType) -> tuple[tuple[str, ...], ...]:
    """Return each read of a global with the attributes that follow: ("a", "b") of ``a.b``."""
    found: list[list[str]] = []
    for each in codes_in(code):
        follows = False
        for instruction in dis.get_instructions(each):
            # Attributes that follow at once belong to the global; other instructions end the chain.
            # EXTENDED_ARG only widens the argument of the next one.
            if instruction.opname == "LOAD_GLOBAL":
                found.append([instruction.argval])
                follows = True
            elif follows and instruction.opname in ATTRIBUTE_LOADS:
                found[-1].append(instruction.argval)
            elif instruction.opname != "EXTENDED_ARG":
                follows = False
    return tuple(dict.fromkeys(map(tuple, found)))


def reads(function: Any) -> dict[tuple[str, ...], Any]:
    """Return all globals that a function reads: {("name",) or ("module", …, "name"): value}.

    Raises KernelError for what a module lacks, and for a module that is used as a value, since
    nobody knows then which of its attributes are read.
    """
    known, found = function.__globals__, {}
    for chain in chains(function.__code__):
        name, used = chain[0], 1
        value = known[name] if name in known else getattr(builtins, name, MISSING)
        # Follow the chain through modules alone: the attributes of any other value are part of it.
        while isinstance(value, types.ModuleType) and used < len(chain):
            name, used = value.__name__, used + 1
            value = getattr(value, chain[used - 1], MISSING)
            if value is MISSING:
                raise KernelError(
                    f"kernel {where(function)} reads {'.'.join(chain[:used])}, but module {name} "
                    f"has no attribute {chain[used - 1]}"
                )
        if isinstance(value, types.ModuleType):
            raise KernelError(
                f"kernel {where(function)} uses the module {'.'.join(chain[:used])!r} as a value; "
                "write module.name where a name of it is needed"
            )
        # A name that is defined nowhere is left out: compiling or calling the function reports it.
        if value is not MISSING:
            found[chain[:used]] = plain(value)
    return found


def apart(function: Callable) -> Callable:
    """Mark a function that is compiled by itself (flocsim.compiler.units), and called like a
    function of another C file.

    This pays for a function that reaches much code, runs much longer than a call takes, and has
    several callers or engines. It must return numbers.
    """
    function.apart = f"{function.__module__}.{function.__qualname__}"  # type: ignore[attr-defined]
    return function


def loops_apart(function: Callable) -> Callable:
    """Mark a function that is compiled by itself, in vector instructions.

    This pays for loops without branches over many numbers, and for the same arithmetic on four
    numbers side by side. Results are the same to the last bit.
    """
    function.loops = True  # type: ignore[attr-defined]
    return apart(function)


def postponed(stand_in: Callable) -> Callable:
    """Mark a function that few runs reach, and that fills a hook which is compiled apart: until a
    run reaches it, ``stand_in`` is called, which reports that (flocsim.state.clock:
    NOT_COMPILED)."""

    def mark(function: Callable) -> Callable:
        function.stand_in = stand_in  # type: ignore[attr-defined]
        return function

    return mark


@attrs.define
class Linker:
    """Clones functions, with others in the place of hooks.

    Parameters: ``fillings``, {hook: function}; ``finish(clone)`` compiles or not;
    ``replace(value)`` returns what stands for a value or a function; None: itself, or its clone.
    """

    fillings: dict[Callable, Callable]
    finish: Callable[[Any], Any] = lambda clone: clone
    replace: Callable[[Any], Any] = lambda value: None
    clones: dict[Callable, Any] = attrs.field(factory=dict, init=False)

    def link(self, value: Any) -> Any:
        """Return the clone of a function, all that it calls linked as well; other values as they
        are, or replaced."""
        if not isinstance(value, types.FunctionType) or is_library(value):
            other = self.replace(value)
            return value if other is None else other
        # Clone each function once, so that all its callers share what is compiled of it.
        filled = self.fillings.get(value, value)
        if filled not in self.clones:
            if (other := self.replace(filled)) is None:
                other = self.clone(filled)
                if hasattr(value, "apart"):  # what fills a hook goes by its name
                    other.apart = value.apart
                other = self.finish(other)
            self.clones[filled] = other
        return self.clones[filled]

    def clone(self, function: Any) -> Any:
        """Return a copy of the function whose globals are its own, linked: what the user's module
        is given later, or has compiled before, is not seen."""
        refuse_closure(function)
        linked = {"__builtins__": builtins, "__name__": function.__module__}
        for (*modules, name), value in reads(function).items():
            names: dict[str, Any] = linked
            for each in modules:  # stand-ins for modules, with what is read alone
                names = vars(names.setdefault(each, types.ModuleType(each)))
            names[name] = self.link(value)
        # Bytecode finds globals by name in whatever dictionary it is given: it need not be changed.
        copy = types.FunctionType(
            function.__code__, linked, function.__name__, function.__defaults__
        )
        copy.__qualname__ = function.__qualname__
        copy.__module__ = function.__module__
        copy.__dict__.update(function.__dict__)
        return copy
