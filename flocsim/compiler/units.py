"""Units of machine code: what is compiled by itself, kept on the disk, and linked where it is used.

The first unit of an engine is its driver; each function marked @apart (flocsim.compiler.linker) is
another. A unit knows those that it calls by the names of their functions alone, as a C file knows
what it includes no body of; which ones these are is settled when they are loaded. Engines of
spheres and of polygons, of two bodies and of many, of one observer and of another therefore share
most of their machine code, and an edited function compiles its own unit. What is @postponed is
compiled, with all that it alone reaches, when a run first gets there: until then a stand-in goes by
its name.

A unit's file is named by a hash of what it does up to the units that it calls, and of the types
that it is given; it says what these have to return. The engine's, named by a hash of everything,
lists them all.
"""

import contextlib
import functools
import hashlib
import json
import re
import sys
import types
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from flocsim.compiler import disk_cache
from flocsim.compiler.by_pointer import types_within
from flocsim.compiler.disk_cache import Called, ObjectCode, link
from flocsim.compiler.fingerprint import Intrinsic, hashed, tell
from flocsim.compiler.linker import Linker
from flocsim.compiler.processor import compiled_for, numba_settings
from flocsim.errors import FlocsimError, KernelError
from flocsim.process import COMPILING, lacking

INLINED_SIZE = 400
"""Functions of less bytecode [bytes] are always inlined; of the others LLVM decides."""

MADE = re.compile(r"<flocsim_(scene|law|unit)_[0-9a-f]+>$")
"""Code that is made here, and says nothing to a user."""


def run_of(module, entry, **readers):
    """The function of a module that numba compiles, and keeps: ``run``, which calls the ``driver``
    of its globals with the same arguments, or with those that ``readers`` find in a table by its
    address (by_pointer)."""
    names = argument_names(entry)
    taken = "address" if readers else ", ".join(names)
    handed = ", ".join(f"read_{name}(address)" if readers else name for name in names)
    source = (
        f'"""Made by flocsim from {entry.__module__}.{entry.__qualname__}."""\n\n\n'
        f"def run({taken}):\n    return driver({handed})\n"
    )
    known = vars(module) | {f"read_{name}": each for name, each in readers.items()}
    exec(compile(source, f"<{module.__name__}>", "exec"), known)
    return known["run"]


def argument_names(function):
    """The names of a function's arguments."""
    return function.__code__.co_varnames[: function.__code__.co_argcount]


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

    def loaded(self, told, typed, whole=False):
        """(address of its machine code, what it returns), from the disk or compiled, ``whole`` or
        without what is postponed; ``told`` tells all that ``typed()`` follows from: the signature,
        the readers of arguments (see run_of) and {words: numba type} of what is in them."""
        begun = key_of(told, self.entry)
        key = f"whole {begun}" if whole else begun
        if (data := disk_cache.read(self.name, key)) is not None:
            # What fails was written by this code, and yet is of no use: it is compiled anew.
            with contextlib.suppress(Exception):
                head, packed = data.split(b"\n", 1)
                code = ObjectCode.unpacked(packed)
                units = {
                    symbol: ObjectCode.unpacked(disk_cache.read(*file) or b"")
                    for symbol, file in json.loads(head).items()
                }
                return link(code, units), code.returned
        build = Build(self, whole)
        code = build.entry(*typed(), disk_cache.read(self.name, begun) if whole else None)
        if build.lasts:
            head = json.dumps(build.files).encode()
            disk_cache.write(self.name, key, head + b"\n" + code.packed())
        return link(code, build.units), code.returned


def key_of(told, function):
    """What the machine code of a function depends on beside the name: types, processor."""
    return repr((told, compiled_for(hasattr(function, "loops"))))


class Build:
    """An engine while it is compiled, unit after unit: ``units`` {symbol: ObjectCode} and ``files``
    {symbol: (name, key)} on the disk; ``lasts``: whether another process can use all of them;
    ``known`` {words: numba type} of arguments. Functions of several units are lowered once.
    ``whole``: with what is postponed."""

    def __init__(self, code, whole=False):
        from flocsim.compiler import numba_internals as internals

        self.code, self.whole = code, whole
        # Without the interpreter's lock, dividing by zero as numpy does.
        self.options = {"nogil": True, "error_model": "numpy", **internals.UNWRAPPED}
        self.options |= {} if code.allocates else internals.NO_COUNTING
        self.for_inner, self.for_entry, self.for_loops = internals.compilers()
        by_units = self.for_entry and not code.allocates
        self.linker = Linker({}, self.inner, made, self.called if by_units else None)
        self.units: dict[str, ObjectCode] = {}
        self.files: dict[str, tuple[str, str]] = {}
        self.calls: dict[str, Called] = {}
        self.lasts = True
        self.known: dict[str, Any] = {}
        self.parts: list[Any] = []

    def entry(self, signature, readers, known, begun=None):
        """The ObjectCode of the first unit, all others made or found; KernelError where one cannot
        be compiled. ``begun``: of the engine without what is postponed, as the disk has it."""
        from numba import NumbaError

        from flocsim.compiler import numba_internals as internals

        if text := lacking(COMPILING, "compiling"):
            raise FlocsimError(text)  # LLVM ends the process where it gets no memory
        code = self.code
        try:
            missing = to_compile(code.entry, self.whole)
            what = f"the rest of {code.what}" if self.whole else code.what
            with compiling(what, missing), internals.quick_typing():
                self.known |= known
                found = self.completed(code.entry, begun.split(b"\n", 1)[1]) if begun else None
                return found or self.compiled(code.entry, code.name, signature, readers)
        except NumbaError as error:
            raise KernelError(compiler_complaint(str(error))) from None
        finally:
            internals.forget(self.parts)

    def inner(self, clone):
        """What numba is to compile of a function, and to put into those that call it."""
        import numba

        from flocsim.compiler import numba_internals as internals

        clone.__module__ = self.code.name
        clone.__qualname__ = f"{clone.__qualname__}_{len(self.parts)}"
        small = len(clone.__code__.co_code) < INLINED_SIZE
        found = numba.njit(clone, **self.options, **self.for_inner, forceinline=small)
        self.parts.append(internals.typed_once(found))
        return self.parts[-1]

    def called(self, function):
        """What calls a function that is compiled apart."""
        from flocsim.compiler import numba_internals as internals

        def unit_for(given):
            symbol, unit = self.unit(function, given)
            types = list(map(str, given))
            self.calls[symbol] = Called(symbol, function.apart, types, unit.returned)
            return symbol, unit.returned

        return internals.call_of_unit(argument_names(function), unit_for)

    def compiled(self, entry, name, signature, readers):
        """The ObjectCode of the unit that begins with a function."""
        from flocsim.compiler import numba_internals as internals

        module = types.ModuleType(name)
        sys.modules[name] = module  # where numba looks for its name
        try:
            run = run_of(module, entry, **readers)
            run.__globals__["driver"] = self.linker.first(entry)
            kind = self.for_loops if hasattr(entry, "loops") else self.for_entry
            options = {**self.options, **kind}
            code, missing, lasts = internals.object_code(run, signature, options)
        finally:
            del sys.modules[name]
        self.lasts &= lasts
        return code._replace(
            calls=tuple(self.calls[each] for each in missing if each in self.calls)
        )

    def unit(self, function, given):
        """(symbol, ObjectCode) of a function marked @apart for arguments of such numba types."""
        self.known |= types_within(given)
        told = list(map(str, given))
        words = " ".join([function.apart, *told])
        symbol = f"flocsim_{hashlib.blake2b(words.encode(), digest_size=12).hexdigest()}"
        function = made_of(function, self.whole)
        if symbol not in self.units:
            name, key = unit_of(function).name, key_of(told, function)
            data = disk_cache.read(name, key)
            code = self.completed(function, data) if data else None
            if code is None:
                code = self.compiled(function, name, given, {})
                if self.lasts:
                    disk_cache.write(name, key, code.packed())
            self.units[symbol], self.files[symbol] = code, (name, key)
        return symbol, self.units[symbol]

    def completed(self, function, data):
        """The ObjectCode of a unit as the disk has it, if what it calls returns what it expects;
        of that, what is not on the disk is compiled."""
        code, calls = ObjectCode.unpacked(data), unit_of(function).calls
        for each in code.calls:
            if not self.known.keys() >= set(each.types):
                return None
            given = tuple(self.known[words] for words in each.types)
            if self.unit(calls[each.function], given)[1].returned != each.returned:
                return None
        return code


SECONDS_OF_A_FUNCTION = 0.035
"""Seconds that one function of an engine takes (benchmarks/speed/compile_times.py): of some 400."""

WORTH_SAYING = 2.0
"""Seconds below which nothing is said: the laws of a scene and the parts of a fit take less."""


@contextlib.contextmanager
def one_line(text: str) -> Iterator[None]:
    """A line on stderr: how a library waits. A command puts another in its place."""
    print(f"flocsim: {text}", file=sys.stderr, flush=True)
    yield


silent = contextlib.nullcontext
"""Nothing is said: for processes of which another one speaks."""

shown: Callable[[str], Any] = one_line
"""How the line is shown: a context that lasts as long as the compiler works."""


def show_by(way: Callable[[str], Any]) -> None:
    """From now on show the line in this way."""
    global shown
    shown = way


def compiling(what: str, functions: int) -> Any:
    """A context in which so many functions are compiled; ``what`` they are, together."""
    seconds = SECONDS_OF_A_FUNCTION * functions
    if seconds < WORTH_SAYING:
        return contextlib.nullcontext()
    about = max(5, 5 * round(seconds / 5))
    return shown(f"first run: compiling {what}, about {about} s, once")


class Unit(NamedTuple):
    """The ``name`` of a unit's file, by what it does up to the units that it ``calls`` {name:
    function}; its ``functions``."""

    name: str
    calls: dict[str, Callable]
    functions: list[Callable]


@functools.lru_cache(maxsize=4096)
def unit_of(function: Callable) -> Unit:
    """The Unit that begins with a function."""
    found = tell(function, {}, within=True)
    name = f"flocsim_unit_{hashed(found.lines, options_text(False))}"
    return Unit(name, found.calls, found.functions)


def made_of(function, whole):
    """What is compiled of a function: its stand-in, where that is all that is asked for."""
    return function if whole else getattr(function, "stand_in", function)


def to_compile(entry, whole=False):
    """How many functions there are in an engine's units that are not on the disk; that of the entry
    is, where ``whole`` is what follows."""
    units, more = {entry}, [entry]
    for each in more:  # grows
        new = {made_of(called, whole) for called in unit_of(each).calls.values()} - units
        units |= new
        more += new
    found = [unit_of(each) for each in units if each is not entry]
    missing = [unit for unit in found if not disk_cache.has(unit.name)]
    missing += [] if whole else [unit_of(entry)]
    return len(set().union(*(unit.functions for unit in missing)))


def made(value):
    """What numba is to see in the place of a value."""
    return value.make() if isinstance(value, Intrinsic) else value


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


@functools.cache
def options_text(allocates: bool) -> str:
    """How functions are compiled, for the hash: options, and the code that says how."""
    from flocsim.compiler import by_pointer, numba_internals

    source = b"".join(
        Path(str(each.__file__)).read_bytes() for each in (by_pointer, numba_internals)
    )
    digest = hashlib.blake2b(source, digest_size=8).hexdigest()
    return f"{INLINED_SIZE} {allocates} {digest}"
