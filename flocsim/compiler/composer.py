"""Compiled functions that are warm from disk in a new process and never stale.

``compose`` takes a driver written in plain Python and the functions that stand in for its hooks
(flocsim.hooks), clones every function that the driver reaches with those replaced, and compiles the
whole (flocsim.compiler.units): an engine, the same for all scenes of a family (method, spheres or
polygons, observer). ``compile_law`` does the same for what a scene's forces add up to
(flocsim.hooks), and gives the address at which the engine calls it, so that other forces never
compile an engine.

What goes to disk is named by a hash of all that was reached: bytecode, constants, Python, numba and
numpy versions. An edited kernel therefore has another name; new parameter values, which are
arguments, do not.

Kernels must be plain functions that capture nothing: a closure's variables are invisible to
numba's symbol table, where two of them can collide and silently return each other's answers.
"""

import functools
import itertools
from collections.abc import Callable
from typing import Any

from flocsim.compiler import disk_cache
from flocsim.compiler.by_pointer import (
    argument_at,
    table_of,
    told_kinds,
    type_of,
    types_within,
    words_in,
)
from flocsim.compiler.disk_cache import function_at
from flocsim.compiler.fingerprint import fingerprint, refuse_interpreter
from flocsim.compiler.linker import Linker
from flocsim.compiler.units import Code, argument_names, options_text

_composed: dict = {}


class Compiled:
    """A Code that is compiled at its first call, or loaded from the disk; once more for arguments
    of other types. Without what is postponed, unless it is ``complete``."""

    def __init__(self, code, complete=False):
        self.code, self.complete = code, complete
        self.functions = {}

    @functools.cached_property
    def whole(self):
        """The same with what is postponed."""
        return Compiled(self.code, True)

    def __call__(self, *arguments):
        table, kinds = table_of(arguments)
        if kinds not in self.functions:
            self.functions[kinds] = self.function_for(kinds, arguments)
        return self.functions[kinds](table.__array_interface__["data"][0])

    def function_for(self, kinds, arguments):
        """The function of a table's address for arguments of such types."""
        code = self.code

        def typed():
            from numba import int64

            found = [type_of(each, arrays=code.allocates) for each in arguments]
            places = itertools.accumulate(map(words_in, found), initial=0)
            readers = dict(
                zip(argument_names(code.entry), map(argument_at, found, places), strict=False)
            )
            return (int64,), readers, types_within(found)

        return function_at(*code.loaded(told_kinds(kinds), typed, self.complete))


def compose(
    entry: Callable,
    fillings: dict[Callable, Callable],
    *,
    jit: bool = True,
    allocates: bool = False,
    what: str = "its kernels",
) -> Callable:
    """The driver ``entry`` with its hooks filled, as one function.

    Parameters: ``entry``, a plain function; ``fillings``, {hook of flocsim.hooks.HOOKS: plain
    function}; ``jit=False`` links the plain Python functions, for debugging and reference;
    ``allocates``, whether any of the functions makes an array, for itself; ``what`` it is in words,
    for who waits while it is compiled.
    Raises KernelError for kernels that capture variables or read globals that may change.
    """
    if jit:
        refuse_interpreter(entry, fillings)
    key = (fingerprint(entry, fillings, options_text(allocates)), jit)
    if key not in _composed:
        # Cloned at once: what is reached later, compiled or not, is what it is now.
        linked = Linker(fillings).link(entry)
        name = f"flocsim_scene_{key[0]}"
        _composed[key] = Compiled(Code(linked, name, allocates, what)) if jit else linked
    return _composed[key]


@functools.cache
def compiled(entry: Callable, *, allocates: bool = False, what: str = "its kernels") -> Callable:
    """The same of a function without hooks, looked at once: what it reaches is what it was then."""
    return compose(entry, {}, allocates=allocates, what=what)


def is_on_disk(driver: Any) -> bool:
    """Whether a composed driver has been compiled on this machine, for some types of arguments."""
    return disk_cache.has(driver.code.name)


def compile_law(law: Callable, told: str, signature: Callable[[], Any]) -> int:
    """The address [int] at which an engine calls a plain function, compiled for a numba signature,
    of which ``told`` tells all.

    Raises KernelError for what captures variables, reads globals that may change, or cannot be
    compiled. The compiled function lives as long as the process.
    """
    refuse_interpreter(law)
    key = (fingerprint(law, {}, options_text(False)), told)
    if key not in _composed:
        code = Code(law, f"flocsim_law_{key[0]}")
        _composed[key], _ = code.loaded(told, lambda: (signature().args, {}, {}))
    return _composed[key]
