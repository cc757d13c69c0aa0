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
from flocsim.compiler.by_pointer import argument_at, table_of, told_kinds, type_of, words_in
from flocsim.compiler.constants import Intrinsic
from flocsim.compiler.fingerprint import fingerprint
from flocsim.compiler.interpreter_calls import refuse_interpreter
from flocsim.compiler.object_code import ObjectCode, function_at
from flocsim.compiler.processor import compiled_for, numba_settings, versions
from flocsim.compiler.reads import is_users_module, module_reads, reached, refuse_closure
from flocsim.compiler.waiting import compiling
from flocsim.errors import FlocsimError, KernelError
from flocsim.limits import COMPILING, lacking

INLINED_SIZE = 400
"""Functions of less bytecode [bytes] are always inlined; of the others LLVM decides."""


def apart(function: Callable) -> Callable:
    """Mark a function that is compiled by itself, however short it is: one that reaches much and is
    called from several places, into each of which all of that would be put."""
    function.apart = True  # type: ignore[attr-defined]
    return function


MADE = re.compile(r"<flocsim_(scene|law)_[0-9a-f]+>$")
"""Code that is made here, and says nothing to a user."""

_composed: dict = {}


class Linker:
    """Clones functions, with others in the place of hooks."""

    def __init__(self, fillings, transform, made=lambda value: value):
        """``fillings`` {hook: function}; ``transform(clone)`` compiles or not; ``made(value)``:
        what stands for what is no function."""
        self.fillings = fillings
        self.transform = transform
        self.made = made
        self.clones = {}

    def link(self, function):
        """The clone of a function, all that it calls linked as well."""
        function = self.fillings.get(function, function)
        if function not in self.clones:
            refuse_closure(function)
            self.clones[function] = self.transform(self.clone(function))
        return self.clones[function]

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


class Code:
    """A linked entry and how it is compiled: as module ``name``; ``what`` it is in words;
    ``allocates``, whether it makes arrays for itself."""

    def __init__(self, entry, name, allocates=False, what="its kernels"):
        self.entry, self.name, self.allocates, self.what = entry, name, allocates, what
        if numba_settings()["DISABLE_JIT"] != "0":
            raise KernelError(
                "NUMBA_DISABLE_JIT is set, so that numba compiles nothing, and flocsim runs "
                "compiled code only: unset it (in Python, jit=False runs a scene uncompiled)"
            )

    def key(self, told):
        """What the machine code depends on beside the name: types, processor, versions."""
        return repr((told, compiled_for(), versions()))

    def loaded(self, told, typed):
        """(address of its machine code, what it returns), from the disk or compiled; ``told`` tells
        all that ``typed()``, the signature and the readers of arguments (see run_of), follow from.
        """
        key = self.key(told)
        data = disk_cache.read(self.name, key)
        if data is not None:
            # What fails was written by this code, and yet is of no use: it is compiled anew.
            with contextlib.suppress(Exception):
                found = ObjectCode.unpacked(data)
                return found.load(), found.returned
        found, lasts = self.compiled(*typed())
        if lasts:
            disk_cache.write(self.name, key, found.packed())
        return found.load(), found.returned

    def compiled(self, signature, readers):
        """(its ObjectCode, whether another process can use it); KernelError where it cannot be
        compiled."""
        import numba

        from flocsim.compiler import numba_internals as internals

        # Without the interpreter's lock, dividing by zero as numpy does.
        options = {"nogil": True, "error_model": "numpy", **internals.UNWRAPPED}
        options |= {} if self.allocates else internals.NO_COUNTING
        for_inner, for_entry = internals.compilers()
        parts = []

        def transform(clone):
            clone.__module__ = self.name
            small = len(clone.__code__.co_code) < INLINED_SIZE and not hasattr(clone, "apart")
            inner = numba.njit(clone, **options, **for_inner, forceinline=small)
            parts.append(internals.typed_once(inner))
            return parts[-1]

        if text := lacking(COMPILING, "compiling"):
            raise FlocsimError(text)  # LLVM ends the process where it gets no memory
        module = types.ModuleType(self.name)
        sys.modules[self.name] = module  # where numba looks for its name
        run = run_of(module, self.entry, **readers)
        run.__globals__["driver"] = Linker({}, transform, made).link(self.entry)
        try:
            with compiling(self.what, len(parts)), internals.quick_typing():
                return internals.object_code(run, signature, {**options, **for_entry})
        except internals.compiler_error() as error:
            raise KernelError(compiler_complaint(str(error))) from None
        finally:
            del sys.modules[self.name]
            internals.forget(parts)


def made(value):
    """What numba is to see in the place of a value."""
    return value.make() if isinstance(value, Intrinsic) else value


class Compiled:
    """A Code that is compiled at its first call, or loaded from the disk; once more for arguments
    of other types."""

    def __init__(self, code):
        self.code = code
        self.functions = {}

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
            names = code.entry.__code__.co_varnames
            return (int64,), dict(zip(names, map(argument_at, found, places), strict=False))

        return function_at(*code.loaded(told_kinds(kinds), typed))


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
    ``allocates``, whether any of the functions makes an array, for itself; ``what`` it is in words,
    for who waits while it is compiled.
    Raises KernelError for kernels that capture variables or read globals that may change.
    """
    if jit:
        refuse_interpreter(entry, fillings)
    key = (fingerprint(entry, fillings, options_text(allocates)), jit)
    if key not in _composed:
        # Cloned at once: what is reached later, compiled or not, is what it is now.
        linked = Linker(fillings, lambda clone: clone).link(entry)
        name = f"flocsim_scene_{key[0]}"
        _composed[key] = Compiled(Code(linked, name, allocates, what)) if jit else linked
    return _composed[key]


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
        _composed[key], _ = code.loaded(told, lambda: (signature().args, {}))
    return _composed[key]


@functools.cache
def options_text(allocates):
    """How functions are compiled, for the hash: options, and the code that says how."""
    from flocsim.compiler import by_pointer, numba_internals

    source = b"".join(Path(each.__file__).read_bytes() for each in (by_pointer, numba_internals))
    digest = hashlib.blake2b(source, digest_size=8).hexdigest()
    return f"{INLINED_SIZE} {allocates} {digest}"
