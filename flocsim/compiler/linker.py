"""What a function reads beside its arguments: globals, and attributes of the user's modules. And
clones of functions, with others in the place of hooks: what a scene's driver reaches, as one."""

import builtins
import dis
import functools
import inspect
import os
import sys
import sysconfig
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

from flocsim.errors import KernelError

PACKAGE = str(Path(__file__).parents[1]) + os.sep
"""Where the files of flocsim's own functions lie."""

KNOWN_PACKAGES = {"numpy", "numba"}
"""Packages whose version is part of the hash, as Python's own is."""

ATTRIBUTE_LOADS = ("LOAD_ATTR", "LOAD_METHOD")


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
    """Names of globals and attributes that the code reads, those of nested code included."""
    names = set(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            names |= names_in(constant)
    return names


def is_versioned(module: Any) -> bool:
    """Whether a module is Python's own, numpy's or numba's: its version is part of the hash.

    A file of the user's that has the name of one of Python's modules is the user's.
    """
    root = module.__name__.partition(".")[0]
    if root in KNOWN_PACKAGES:
        return True
    file = getattr(module, "__file__", None)
    return root in sys.stdlib_module_names and (file is None or is_in_library(file))


@functools.cache
def is_in_library(file: str) -> bool:
    """Whether a file belongs to Python's own library."""
    folders = [os.path.realpath(sysconfig.get_path(name)) for name in ("stdlib", "platstdlib")]
    place = os.path.realpath(file)
    within = any(place.startswith(folder + os.sep) for folder in folders)
    return within and "site-packages" not in place and "dist-packages" not in place


def plain(value: Any) -> Any:
    """The Python function behind one of @njit, which is compiled anew; anything else as it is."""
    if not hasattr(value, "py_func"):
        return value
    from numba.extending import is_jitted

    return value.py_func if is_jitted(value) else value


def reached(function: Any) -> dict[str, Any]:
    """The globals that a function reads: {name: value}."""
    known = function.__globals__
    names = sorted({chain[0] for chain in chains(function.__code__)})
    return {name: plain(known[name]) for name in names if name in known}


@functools.lru_cache(maxsize=4096)
def chains(code: types.CodeType) -> tuple[tuple[str, ...], ...]:
    """Every read of a global with the attributes that follow: ``a.b.c`` gives ("a", "b", "c")."""
    found = []
    chain: list[str] = []
    for instruction in dis.get_instructions(code):
        if instruction.opname == "EXTENDED_ARG":
            continue
        if chain and instruction.opname in ATTRIBUTE_LOADS:
            chain.append(instruction.argval)
            continue
        found.append(tuple(chain))
        chain = [instruction.argval] if instruction.opname == "LOAD_GLOBAL" else []
    nested = [each for each in code.co_consts if inspect.iscode(each)]
    return tuple(each for each in found if each) + sum(map(chains, nested), ())


def module_reads(function: Any) -> dict[tuple[str, ...], Any]:
    """What a function reads of modules: {("module", …, "name"): value}.

    A chain ends at the first value that is no module of the user's. Raises KernelError for one that
    the module has not, and for a module that is used as a value, since nobody knows then which of
    its attributes are read.
    """
    modules = {
        name: value for name, value in reached(function).items()
        if isinstance(value, types.ModuleType)
    }  # fmt: skip
    found: dict[tuple[str, ...], Any] = {}
    if not modules:
        return found
    for chain in chains(function.__code__):
        if chain[0] not in modules:
            continue
        value: Any = modules[chain[0]]
        used = 1
        while isinstance(value, types.ModuleType) and used < len(chain):
            if not hasattr(value, chain[used]):
                raise KernelError(
                    f"kernel {where(function)} reads {'.'.join(chain[: used + 1])}, but "
                    f"module {value.__name__} has no attribute {chain[used]}"
                )
            value = plain(getattr(value, chain[used]))
            used += 1
        if isinstance(value, types.ModuleType):
            raise KernelError(
                f"kernel {where(function)} uses the module {'.'.join(chain[:used])!r} as a value; "
                "write module.name where a name of it is needed"
            )
        found[chain[:used]] = value
    return found


def apart(function: Callable) -> Callable:
    """Mark a function that is compiled by itself (flocsim.compiler.units), and called by what
    reaches it as one C file calls another: one that reaches much, takes much longer than a call,
    and is called from several places or by several engines. It returns numbers."""
    function.apart = f"{function.__module__}.{function.__qualname__}"  # type: ignore[attr-defined]
    return function


def loops_apart(function: Callable) -> Callable:
    """Mark a function that is compiled by itself, and is a loop over many numbers without a branch,
    or does to four numbers side by side what it does to one: it takes several of them at once, to
    the same bits."""
    function.loops = True  # type: ignore[attr-defined]
    return apart(function)


def postponed(stand_in: Callable) -> Callable:
    """Mark a function that few runs reach, and that fills a hook which is compiled apart: until it
    is reached, ``stand_in`` is called, which tells so (flocsim.state.clock: NOT_COMPILED)."""

    def mark(function: Callable) -> Callable:
        function.stand_in = stand_in  # type: ignore[attr-defined]
        return function

    return mark


class Linker:
    """Clones functions, with others in the place of hooks."""

    def __init__(
        self,
        fillings: dict[Callable, Callable],
        transform: Callable[[Any], Any] = lambda clone: clone,
        made: Callable[[Any], Any] = lambda value: value,
        called: Callable[[Any], Any] | None = None,
    ) -> None:
        """``fillings`` {hook: function}; ``transform(clone)`` compiles or not; ``made(value)``:
        what stands for what is no function; ``called(function)``: what stands for one that is
        compiled apart and called by another."""
        self.fillings = fillings
        self.transform = transform
        self.made = made
        self.called = called
        self.clones: dict[Callable, Any] = {}

    def link(self, function: Callable) -> Any:
        """The clone of a function, all that it calls linked as well."""
        filled = self.fillings.get(function, function)
        if filled not in self.clones:
            refuse_closure(filled)
            if self.called and hasattr(filled, "apart"):
                self.clones[filled] = self.called(filled)
            else:
                clone = self.clone(filled)
                if hasattr(function, "apart"):  # what fills a hook goes by its name
                    clone.apart = function.apart
                self.clones[filled] = self.transform(clone)
        return self.clones[filled]

    def first(self, function: Callable) -> Any:
        """The clone of the function that a unit begins with, though others call it by its name."""
        refuse_closure(function)
        return self.transform(self.clone(function))

    def linked_value(self, value):
        """A function linked, anything else as it is, or as numba is to see it."""
        return self.link(value) if isinstance(value, types.FunctionType) else self.made(value)

    def put(self, names, chain, value):
        """Put ``module.name`` among a clone's globals: in a module that has what is read alone.

        What the user's module is given later, or has compiled before, is not seen then.
        """
        *modules, name = chain
        for each in modules:
            known = names.get(each)
            if not isinstance(known, types.ModuleType):
                names[each] = known = types.ModuleType(each)
            names = vars(known)
        names[name] = value

    def clone(self, function):
        """A copy of the function whose globals are its own, linked."""
        linked = {"__builtins__": builtins, "__name__": function.__module__}
        for name, value in reached(function).items():
            if not isinstance(value, types.ModuleType) or is_versioned(value):
                linked[name] = self.linked_value(value)
        for chain, value in module_reads(function).items():
            self.put(linked, chain, self.linked_value(value))
        copy = types.FunctionType(
            function.__code__, linked, function.__name__, function.__defaults__
        )
        copy.__qualname__ = function.__qualname__
        copy.__module__ = function.__module__
        copy.__dict__.update(function.__dict__)
        return copy
