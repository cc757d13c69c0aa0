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
import functools
import hashlib
import itertools
import re
import sys
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

from flocsim.compiler.by_pointer import argument_at, table_of, type_of, words_in
from flocsim.compiler.fingerprint import fingerprint
from flocsim.compiler.interpreter_calls import refuse_interpreter
from flocsim.compiler.reads import is_users_module, module_reads, reached, refuse_closure
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


def entry_source(entry, given="{}"):
    """The text of a module with one function that calls the driver: ``run``, of the same arguments,
    or of the address of a table in which they lie (by_pointer), ``given`` "argument_{}(address)".
    """
    code = entry.__code__
    names = code.co_varnames[: code.co_argcount]
    handed = ", ".join(map(given.format, names))
    taken = ", ".join(names) if given == "{}" else "address"
    return (
        f'"""Made by flocsim from {entry.__module__}.{entry.__qualname__}."""\n\n\n'
        f"def run({taken}):\n    return driver({handed})\n"
    )


def linked_module(entry, fillings, name, options):
    """The module ``name``, whose ``driver`` is the linked entry."""
    import numba

    from flocsim.compiler.numba_internals import compilers, typed_once

    inner = {**options, **UNWRAPPED, **compilers()[0]}

    def transform(clone):
        clone.__module__ = name
        # Nothing outside calls the inner functions: no wrappers for Python or C, which cost time.
        small = len(clone.__code__.co_code) < INLINED_SIZE and not hasattr(clone, "apart")
        return typed_once(numba.njit(clone, **inner, forceinline=small))

    module = types.ModuleType(name)
    sys.modules[name] = module  # where numba looks for it when it loads compiled code
    module.driver = Linker(fillings, transform).link(entry)
    return module


def run_of(module, entry, **arguments):
    """The function of a linked module that numba compiles, and keeps."""
    source = entry_source(entry, "argument_{}(address)" if arguments else "{}")
    names = vars(module) | {f"argument_{name}": each for name, each in arguments.items()}
    exec(compile(source, f"<{module.__name__}>", "exec"), names)
    return names["run"]


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
    """An entry compiled as module ``name`` at its first call, from the disk where it is there; once
    more for arguments of other types."""

    def __init__(self, entry, fillings, name, allocates):
        self.entry, self.allocates = entry, allocates
        self.options = options_of(allocates)
        self.module = linked_module(entry, fillings, name, self.options)
        self.made = {}

    def __call__(self, *arguments):
        table, kinds = table_of(arguments)
        if kinds not in self.made:
            self.made[kinds] = self.made_for(arguments)
        return self.made[kinds](table.__array_interface__["data"][0])

    def made_for(self, arguments):
        """The machine code for arguments of such types."""
        import numba

        from flocsim.compiler.numba_internals import (
            compiler_error,
            compilers,
            kept_on_disk,
            quick_typing,
        )

        types = [type_of(each, arrays=self.allocates) for each in arguments]
        places = itertools.accumulate(map(words_in, types), initial=0)
        readers = map(argument_at, types, places)
        names = self.entry.__code__.co_varnames
        run = run_of(self.module, self.entry, **dict(zip(names, readers, strict=False)))
        name = self.module.__name__
        dispatcher = kept_on_disk(
            numba.njit(run, **self.options, **compilers()[1]), name, repr(types)
        )
        try:
            with quick_typing():
                dispatcher.typingctx.refresh()  # has to hear of new intrinsics
                dispatcher.compile((numba.int64,))
        except compiler_error() as error:
            raise KernelError(compiler_complaint(str(error))) from None
        return dispatcher


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
) -> Callable:
    """The driver ``entry`` with its hooks filled, as one function.

    Parameters: ``entry``, a plain function; ``fillings``, {hook of flocsim.hooks.HOOKS: plain
    function}; ``jit=False`` links the plain Python functions, for debugging and reference;
    ``allocates``, whether any of the functions makes an array.
    Raises KernelError for kernels that capture variables or read globals that may change.
    """
    if jit:
        refuse_interpreter(entry, fillings)
    key = (fingerprint(entry, fillings, options_text(allocates)), jit)
    if key not in _composed:
        name = f"flocsim_scene_{key[0]}"
        if jit:
            _composed[key] = Compiled(entry, fillings, name, allocates)
        else:
            _composed[key] = Linker(fillings, lambda clone: clone).link(entry)
    return _composed[key]


def compile_law(law: Callable, signature: Any) -> int:
    """The address [int] at which an engine calls a plain function, compiled for a numba signature.

    Raises KernelError for what captures variables, reads globals that may change, or cannot be
    compiled. The compiled function lives as long as the process.
    """
    import numba

    from flocsim.compiler.numba_internals import (
        address_of,
        compiler_error,
        compilers,
        kept_on_disk,
        quick_typing,
    )

    refuse_interpreter(law)
    key = (fingerprint(law, {}, options_text(False)), str(signature))
    if key not in _composed:
        name = f"flocsim_law_{key[0]}"
        module = linked_module(law, {}, name, options_of(False))
        options = {**options_of(False), **UNWRAPPED, **compilers()[1]}
        dispatcher = kept_on_disk(numba.njit(run_of(module, law), **options), name)
        try:
            with quick_typing():
                dispatcher.compile(signature)
        except compiler_error() as error:
            raise KernelError(compiler_complaint(str(error))) from None
        _composed[key] = dispatcher, address_of(dispatcher, signature)
    return _composed[key][1]


@functools.cache
def options_text(allocates):
    """How functions are compiled, for the hash: options, and the code that calls laws."""
    from flocsim.compiler import numba_internals

    source = Path(numba_internals.__file__).read_bytes()
    digest = hashlib.blake2b(source, digest_size=8).hexdigest()
    return f"{INLINED_SIZE} {allocates} {digest}"
