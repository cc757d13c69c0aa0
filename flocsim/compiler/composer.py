"""Compiled functions that are warm from disk in a new process and never stale.

``compose`` takes a driver written in plain Python and the functions that stand in for its hooks
(flocsim.hooks), clones every function that the driver reaches with those replaced, and compiles the
whole as one: an engine, the same for all scenes of a family (method, spheres or polygons,
observer). ``compile_law`` does the same for what a scene's forces add up to (flocsim.laws), and
gives the address at which the engine calls it, so that other forces never compile an engine.

What goes to disk is named by a hash of all that was reached: bytecode, constants, Python, numba and
numpy versions. An edited kernel therefore has another name; new parameter values, which are
arguments, do not.

Kernels must be plain functions that capture nothing: a closure's variables are invisible to
numba's symbol table, where two of them can collide and silently return each other's answers.
"""

import builtins
import contextlib
import functools
import hashlib
import itertools
import re
import sys
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

from flocsim.compiler import disk_cache
from flocsim.compiler.by_pointer import argument_at, table_of, type_of, words_in
from flocsim.compiler.fingerprint import fingerprint
from flocsim.compiler.interpreter_calls import refuse_interpreter
from flocsim.compiler.reads import is_users_module, module_reads, reached, refuse_closure
from flocsim.compiler.waiting import compiling
from flocsim.errors import KernelError

INLINED_SIZE = 400
"""Functions of less bytecode [bytes] are always inlined; of the others LLVM decides."""


def apart(function: Callable) -> Callable:
    """Mark a function that is compiled by itself, however short it is: one that reaches much and is
    called from several places, into each of which all of that would be put."""
    function.apart = True  # type: ignore[attr-defined]
    return function


UNWRAPPED = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Options of functions that only compiled code calls."""

MADE = re.compile(r"<flocsim_(scene|law)_[0-9a-f]+>$")
"""Code that is made here, and says nothing to a user."""

_composed: dict = {}


class Linker:
    """Clones functions, with others in the place of hooks."""

    def __init__(self, fillings, transform):
        """``fillings`` {hook: function}; ``transform(clone)`` compiles or not."""
        self.fillings = fillings
        self.transform = transform
        self.clones = {}

    def link(self, function):
        """The clone of a function, all that it calls linked as well."""
        function = self.fillings.get(function, function)
        if function not in self.clones:
            refuse_closure(function)
            self.clones[function] = self.transform(self.clone(function))
        return self.clones[function]

    def linked_value(self, value):
        """A function linked, anything else as it is."""
        return self.link(value) if isinstance(value, types.FunctionType) else value

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
            if not is_users_module(value):
                linked[name] = self.linked_value(value)
        for chain, value in module_reads(function).items():
            self.put(linked, chain, self.linked_value(value))
        copy = types.FunctionType(
            function.__code__, linked, function.__name__, function.__defaults__
        )
        copy.__qualname__ = f"{function.__qualname__}_{len(self.clones)}"
        copy.__module__ = function.__module__
        copy.__dict__.update(function.__dict__)
        return copy


def run_of(module, entry, **readers):
    """The function of a module that numba compiles, and keeps: ``run``, which calls the ``driver``
    of its globals with the same arguments, or with those that ``readers`` find in a table by its
    address (by_pointer)."""
    names = entry.__code__.co_varnames[: entry.__code__.co_argcount]
    taken = "address" if readers else ", ".join(names)
    handed = ", ".join(f"read_{name}(address)" if readers else name for name in names)
    source = (
        f'"""Made by flocsim from {entry.__module__}.{entry.__qualname__}."""\n\n\n'
        f"def run({taken}):\n    return driver({handed})\n"
    )
    known = vars(module) | {f"read_{name}": each for name, each in readers.items()}
    exec(compile(source, f"<{module.__name__}>", "exec"), known)
    return known["run"]


def machine_code(entry, name, signature, options, readers=None, arguments="", what=""):
    """The entry as a function that numba has compiled for a signature, or loaded from the disk.

    ``name``: of the module in which numba looks for it; ``readers``: see run_of; ``arguments``:
    what the signature does not tell of these; ``what`` it is, for who waits. KernelError where it
    cannot be compiled.
    """
    import numba

    from flocsim.compiler.numba_internals import (
        compiler_error,
        compilers,
        forget,
        kept_on_disk,
        quick_typing,
        typed_once,
    )

    for_inner, for_entry = compilers()
    # Nothing outside calls the inner functions: no wrappers for Python or C, which cost time.
    inner = {**options, **UNWRAPPED, **for_inner}

    parts = []

    def transform(clone):
        clone.__module__ = name
        small = len(clone.__code__.co_code) < INLINED_SIZE and not hasattr(clone, "apart")
        parts.append(typed_once(numba.njit(clone, **inner, forceinline=small)))
        return parts[-1]

    def link():
        run.__globals__["driver"] = Linker({}, transform).link(entry)
        waiting.enter_context(compiling(what, len(parts)))

    module = types.ModuleType(name)
    sys.modules[name] = module  # where numba looks for it when it loads compiled code
    run = run_of(module, entry, **(readers or {}))
    dispatcher = kept_on_disk(numba.njit(run, **options, **for_entry), name, link, arguments)
    try:
        with contextlib.ExitStack() as waiting, quick_typing():
            dispatcher.typingctx.refresh()  # has to hear of new intrinsics
            dispatcher.compile(signature)
    except compiler_error() as error:
        raise KernelError(compiler_complaint(str(error))) from None
    finally:
        run.__globals__.pop("driver", None)
        forget(parts)
    return dispatcher


def options_of(allocates):
    """How kernels are compiled: without the interpreter's lock, dividing by zero as numpy does."""
    from numba import config

    from flocsim.compiler.numba_internals import NO_COUNTING

    if config.DISABLE_JIT:
        raise KernelError(
            "NUMBA_DISABLE_JIT is set, so that numba compiles nothing, and flocsim runs compiled "
            "code only: unset it (in Python, jit=False runs a scene uncompiled)"
        )
    return {"nogil": True, "error_model": "numpy", **({} if allocates else NO_COUNTING)}


class Compiled:
    """A linked entry compiled as module ``name`` at its first call, or loaded from the disk; once
    more for arguments of other types; ``what`` it is in words."""

    def __init__(self, entry, name, allocates, what):
        self.entry, self.name, self.allocates, self.what = entry, name, allocates, what
        self.options = options_of(allocates)
        self.made = {}

    def __call__(self, *arguments):
        table, kinds = table_of(arguments)
        if kinds not in self.made:
            self.made[kinds] = self.made_for(arguments)
        return self.made[kinds](table.__array_interface__["data"][0])

    def made_for(self, arguments):
        """The machine code for arguments of such types."""
        from numba import int64

        kinds = [type_of(each, arrays=self.allocates) for each in arguments]
        places = itertools.accumulate(map(words_in, kinds), initial=0)
        names = self.entry.__code__.co_varnames
        readers = dict(zip(names, map(argument_at, kinds, places), strict=False))
        return machine_code(
            self.entry, self.name, (int64,), self.options, readers, repr(kinds), self.what
        )


def compiler_complaint(text):
    """ "file:line: what is wrong" from numba's many lines: the innermost place of a kernel."""
    words, complaint = "", ""
    for line in text.splitlines():
        found = re.match(r'\s*File "(.+)", line (\d+)', line)
        if found and not (MADE.search(found[1]) or words.startswith("During:")):
            complaint = f"{found[1]}:{found[2]}: {words}"
        elif line.strip():
            words = line.strip()
    complaint = complaint or text.strip().splitlines()[0]
    return f"a kernel cannot be compiled: {complaint[:300]}; use plain arithmetic on scalars"


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
    ``allocates``, whether any of the functions makes an array; ``what`` it is in words, for who
    waits while it is compiled.
    Raises KernelError for kernels that capture variables or read globals that may change.
    """
    if jit:
        refuse_interpreter(entry, fillings)
    key = (fingerprint(entry, fillings, options_text(allocates)), jit)
    if key not in _composed:
        # Cloned at once: what is reached later, compiled or not, is what it is now.
        linked = Linker(fillings, lambda clone: clone).link(entry)
        name = f"flocsim_scene_{key[0]}"
        _composed[key] = Compiled(linked, name, allocates, what) if jit else linked
    return _composed[key]


def is_on_disk(driver: Any) -> bool:
    """Whether a composed driver has been compiled on this machine, for some types of arguments."""
    return disk_cache.has(driver.name)


def compile_law(law: Callable, signature: Any) -> int:
    """The address [int] at which an engine calls a plain function, compiled for a numba signature.

    Raises KernelError for what captures variables, reads globals that may change, or cannot be
    compiled. The compiled function lives as long as the process.
    """
    from flocsim.compiler.numba_internals import address_of

    refuse_interpreter(law)
    key = (fingerprint(law, {}, options_text(False)), str(signature))
    if key not in _composed:
        options = {**options_of(False), **UNWRAPPED}
        dispatcher = machine_code(law, f"flocsim_law_{key[0]}", signature, options)
        _composed[key] = dispatcher, address_of(dispatcher, signature)
    return _composed[key][1]


@functools.cache
def options_text(allocates):
    """How functions are compiled, for the hash: options, and the code that says how."""
    from flocsim.compiler import by_pointer, numba_internals

    source = b"".join(Path(each.__file__).read_bytes() for each in (by_pointer, numba_internals))
    digest = hashlib.blake2b(source, digest_size=8).hexdigest()
    return f"{INLINED_SIZE} {allocates} {digest}"
