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
"""

import functools
import os
from collections.abc import Callable
from typing import Any

from flocsim.compiler import disk_cache
from flocsim.compiler.by_pointer import kinds_text, layout_of, table_of
from flocsim.compiler.fingerprint import fingerprint
from flocsim.compiler.linker import Linker
from flocsim.compiler.object_code import function_at
from flocsim.compiler.units import Engine, argument_names, options_text
from flocsim.errors import KernelError

_composed: dict = {}


class Compiled:
    """A linked function that is compiled at its first call, or loaded from the disk; once more for
    arguments of other types. Without what is postponed, unless it is ``complete``."""

    def __init__(self, linked, name, allocates, what, complete=False):
        self.linked, self.name, self.allocates, self.what = linked, name, allocates, what
        self.complete = complete
        self.functions = {}

    @functools.cached_property
    def whole(self):
        """The same with what is postponed."""
        return Compiled(self.linked, self.name, self.allocates, self.what, True)

    def __call__(self, *arguments):
        words, kinds = table_of(arguments)
        if kinds not in self.functions:
            typed = functools.partial(self.typed, kinds)
            engine = Engine(
                self.linked, self.name, kinds_text(kinds), typed, self.allocates, self.complete,
                self.what,
            )  # fmt: skip
            self.functions[kinds] = function_at(*engine.load(), layout_of(words))
        return self.functions[kinds](words)

    def typed(self, kinds):
        """Return the numba type of a table's address, {argument: function that reads it there} and
        {text: numba type} of all that is in it."""
        from flocsim.compiler.table_types import (
            Elements,
            argument_at,
            type_from,
            types,
            types_within,
            words_in,
        )

        more, at, found, readers = iter(kinds), 0, [], {}
        for name in argument_names(self.linked):
            found.append(kind := type_from(more))
            whole = self.allocates and isinstance(kind, Elements)
            readers[name] = argument_at(kind, at, whole)
            at += words_in(kind)
        return (types.int64,), readers, types_within(found)


def compose(
    entry: Callable,
    fillings: dict[Callable, Callable],
    *,
    jit: bool = True,
    allocates: bool = False,
    what: str = "",
) -> Callable:
    """Return the driver ``entry`` with its hooks filled, as one function.

    Parameters: ``entry``, a plain function; ``fillings``, {hook of flocsim.hooks.HOOKS: plain
    function}; ``jit=False`` links the plain Python functions, for debugging and reference;
    ``allocates``, whether any of the functions makes an array, for itself; ``what`` it is in words,
    for who waits while it is compiled; "": nothing is said.
    Raises KernelError for kernels that capture variables or read globals that may change.
    """
    # Cloned at once: what is reached later, compiled or not, is what it is now.
    linked = Linker(fillings).link(entry)
    if not jit:
        return linked
    refuse_no_compiler()
    name = f"flocsim_scene_{fingerprint(entry, fillings, options_text(allocates), linked)}"
    if name not in _composed:
        _composed[name] = Compiled(linked, name, allocates, what)
    return _composed[name]


@functools.cache
def compiled(entry: Callable, *, allocates: bool = False, what: str = "") -> Callable:
    """Return the same of a function without hooks, looked at once: what it reaches is what it was
    then."""
    return compose(entry, {}, allocates=allocates, what=what)


def is_on_disk(driver: Any) -> bool:
    """Return True if a composed driver has been compiled on this machine, for some types of
    arguments."""
    return disk_cache.has(driver.name)


def compile_law(law: Callable, told: str, numbers: int, given: Callable[[], Any]) -> int:
    """Return the address [int] at which an engine calls a plain function that returns so many
    numbers, compiled for ``given()`` numba types, of which ``told`` tells all.

    Raises KernelError for what captures variables, reads globals that may change, or cannot be
    compiled. The compiled function lives as long as the process.
    """
    linked = Linker({}).link(law)
    refuse_no_compiler()
    key = (fingerprint(law, {}, options_text(False), linked), told)
    if key not in _composed:
        name = f"flocsim_law_{key[0]}"

        def typed() -> tuple[Any, dict[str, Any], dict[str, Any]]:
            return given(), {}, {}

        engine = Engine(linked, name, told, typed, what="", returns="d" * numbers)
        _composed[key], _ = engine.load()
    return _composed[key]


def refuse_no_compiler():
    """Raise KernelError where numba is told to compile nothing."""
    if os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
        raise KernelError(
            "NUMBA_DISABLE_JIT is set, so that numba compiles nothing, and flocsim runs "
            "compiled code only: unset it (in Python, jit=False runs a scene uncompiled)"
        )
