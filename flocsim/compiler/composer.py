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
from flocsim.compiler.fingerprint import fingerprint
from flocsim.compiler.linker import Linker
from flocsim.compiler.units import Engine, options_text
from flocsim.errors import KernelError

_composed: dict = {}


def compose(
    entry: Callable, fillings: dict[Callable, Callable], *, jit: bool = True, what: str = ""
) -> Any:
    """Return the driver ``entry`` with its hooks filled, as one function.

    Parameters: ``entry``, a plain function; ``fillings``, {hook of flocsim.hooks.HOOKS: plain
    function}; ``jit=False`` links the plain Python functions, for debugging and reference;
    ``what`` it is in words, for who waits while it is compiled; "": nothing is said.
    Raises KernelError for kernels that capture variables or read globals that may change.
    """
    # Cloned at once: what is reached later, compiled or not, is what it is now.
    if not jit:
        return Linker(fillings).link(entry)
    refuse_no_compiler()
    # flocsim's own functions stay what they are in a process: scenes that differ in laws alone
    # need not be hashed again, which takes tens of milliseconds.
    key = entry, frozenset(fillings.items())
    if key in _composed:
        return _composed[key]
    linked = Linker(fillings).link(entry)
    name = f"flocsim_scene_{fingerprint(entry, fillings, options_text(), linked)}"
    engine = _composed.setdefault(name, Engine(linked, name, what))
    if all(str(each.__module__).startswith("flocsim.") for each in (entry, *fillings.values())):
        _composed[key] = engine
    return engine


@functools.cache
def compiled(entry: Callable, *, what: str = "") -> Callable:
    """Return the same of a function without hooks, looked at once: what it reaches is what it was
    then."""
    return compose(entry, {}, what=what)


def is_on_disk(driver: Any) -> bool:
    """Return True if a composed driver has been compiled on this machine, for some types of
    arguments."""
    return disk_cache.has(driver.name)


def compile_law(law: Callable, told: str, given: Callable[[], Any]) -> int:
    """Return the address [int] at which an engine calls a plain function that returns numbers,
    compiled for ``given()`` numba types, of which ``told`` tells all.

    Raises KernelError for what captures variables, reads globals that may change, or cannot be
    compiled. The compiled function lives as long as the process.
    """
    return compose(law, {}).load(told, given)[0]


def refuse_no_compiler():
    """Raise KernelError where numba is told to compile nothing."""
    if os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
        raise KernelError(
            "NUMBA_DISABLE_JIT is set, so that numba compiles nothing, and flocsim runs "
            "compiled code only: unset it (in Python, jit=False runs a scene uncompiled)"
        )
