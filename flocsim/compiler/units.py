"""Units of machine code: what is compiled by itself, kept on the disk, and linked where it is used.

The first unit of an engine is its driver; each function marked @apart (flocsim.compiler.linker) is
another. A unit knows those that it calls by the names of their functions alone, as a C file knows
what it includes no body of; which ones these are is settled when they are loaded. Engines of
spheres and of polygons, of two bodies and of many, of one observer and of another therefore share
most of their machine code, and an edited function compiles its own unit. What is @postponed is
compiled, with all that it alone reaches, when a run first gets there: until then a stand-in goes by
its name.

A unit's file is named by a hash of what it does up to the units that it calls, and of the types
that it is given; it says what these have to return. The first unit's is named by a hash of
everything that the engine does.
"""

import contextlib
import functools
import hashlib
import pickle
import re
import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import attrs

from flocsim.compiler import accelerator, disk_cache
from flocsim.compiler.by_pointer import kinds_text, table_of
from flocsim.compiler.fingerprint import Intrinsic, describe, hashed
from flocsim.compiler.linker import Linker
from flocsim.compiler.object_code import LENT, Called, ObjectCode, function_at, load, object_of
from flocsim.compiler.processor import compiled_for
from flocsim.errors import FlocsimError, KernelError
from flocsim.process import COMPILING, lacking

# Functions of less bytecode [bytes] are always inlined; of the others LLVM decides. Up to 1,200
# would gain 7 % of throughput for 1.5 times the compile time.
INLINED_SIZE = 400

SCALARS_ONLY = "use plain arithmetic on scalars, without arrays and lists"

# Nothing is said: in processes of which another one speaks.
quiet = False

_said: set[str] = set()
_one_at_a_time = threading.RLock()


@functools.cache
def options_text() -> str:
    """Return how functions are compiled, for the hash: the code that says how."""
    files = sorted(Path(__file__).parent.glob("*.py"))
    return hashlib.blake2b(b"".join(map(Path.read_bytes, files)), digest_size=8).hexdigest()


def symbol_of(function: Callable, types: str) -> str:
    """Return the symbol of a unit for arguments of such types."""
    told = repr((getattr(function, "apart", ""), types))
    return f"flocsim_{hashlib.blake2b(told.encode(), digest_size=12).hexdigest()}"


@attrs.define(eq=False, slots=False)
class Engine:
    """A linked function with all units that it calls: found on the disk or compiled at its first
    call, and once more for arguments of other types.

    Parameters: ``entry``, the function, in the file called ``name``; ``what`` it is, for who waits;
    ``complete``: with what is postponed.
    """

    entry: Callable
    name: str
    what: str = ""
    complete: bool = False
    functions: dict[tuple[Any, ...], Callable] = attrs.field(factory=dict, init=False)
    units: dict[str, ObjectCode] = attrs.field(factory=dict, init=False)
    addresses: dict[str, int] = attrs.field(factory=dict, init=False)
    calls: dict[str, Called] = attrs.field(factory=dict, init=False)
    parts: list[Any] = attrs.field(factory=list, init=False)

    @functools.cached_property
    def whole(self) -> "Engine":
        """The same with what is postponed."""
        return Engine(self.entry, self.name, self.what, True)

    def __call__(self, *arguments: Any) -> Any:
        table, kinds = table_of(arguments)
        if kinds not in self.functions:

            def given() -> list[Any]:
                from flocsim.compiler.table_types import type_of

                return type_of(arguments).types

            address, returned = self.load(kinds_text(kinds), given, table=True)
            self.functions[kinds] = function_at(address, returned)
        return self.functions[kinds](table)

    def load(
        self, told: str, given: Callable[[], Sequence[Any]], table: bool = False
    ) -> tuple[int, str]:
        """Return the address of the machine code for ``given()`` numba types, of which ``told``
        tells all, and the letters (struct) of its answer; ``table``: it is given a table."""
        with _one_at_a_time, contextlib.ExitStack() as self.stack:
            self.linker, self.parts = Linker({}, self.inner, self.replace), []
            self.table = table
            symbol = symbol_of(self.entry, told)
            returned = self.unit(symbol, self.entry, given).returned
        return self.addresses[symbol], returned

    def unit(self, symbol: str, function: Any, given: Callable[[], Sequence[Any]]) -> ObjectCode:
        """Return the code of a unit for ``given()`` numba types, loaded after those that it
        calls."""
        if symbol in self.units:
            return self.units[symbol]
        if not self.complete:
            function = getattr(function, "stand_in", function)
        name = self.name
        if function is not self.entry:
            name = f"flocsim_unit_{hashed(describe(function).lines, options_text())}"
        file = name, repr((symbol, compiled_for(hasattr(function, "loops"))))
        # Nobody else can have written what is read (disk_cache).
        data = disk_cache.read(*file)
        code = pickle.loads(data) if data else None
        if code is None or not self.calls_fit(code, function):
            code = self.compiled(function, given())
            disk_cache.write(*file, pickle.dumps(code))
        self.units[symbol] = code
        self.addresses[symbol] = load(code, self.addresses)
        return code

    def calls_fit(self, code: ObjectCode, function: Callable) -> bool:
        """Return True if all units that a unit calls return what it expects."""
        for each in code.calls:
            called = describe(function).calls[each.function]
            given = functools.partial(pickle.loads, each.types)
            if self.unit(each.symbol, called, given).returned != each.returned:
                return False
        return True

    def compiled(self, function: Callable, given: Sequence[Any]) -> ObjectCode:
        """Return the code of a unit, compiled."""
        if not self.parts:
            self.begin()
        import numba

        from flocsim.compiler.table_types import letters_of, put, reader

        read = reader(given, self.table and function is self.entry)
        driver = self.inner(self.linker.clone(function))

        def run(answer, arguments):
            try:
                put(answer, driver(*read(arguments)))
            except Exception:
                return 1
            return 0

        options = accelerator.options(True)
        try:
            made = numba.cfunc("i8(i8, i8)", error_model="numpy", **options)(run)
        except numba.errors.NumbaError as error:
            raise KernelError(compiler_complaint(str(error))) from None
        letters = letters_of(driver.nopython_signatures[-1].return_type)
        entry, loops = made.native_name, hasattr(function, "loops")
        code, missing = object_of(made.inspect_llvm(), entry, loops)
        calls = tuple(self.calls[each] for each in sorted(missing) if each in self.calls)
        return ObjectCode(code, entry, letters, any(x.startswith(LENT) for x in missing), calls)

    def begin(self) -> None:
        """Prepare for compiling, until all units are there."""
        if text := lacking(COMPILING, "compiling"):
            raise FlocsimError(text)  # LLVM ends the process where it gets no memory
        say(self.what)
        self.stack.enter_context(accelerator.quick_typing())
        self.stack.callback(accelerator.forget, self.parts)

    def inner(self, clone: Any) -> Any:
        """Return what numba is to compile of a function, and to put into those that call it."""
        import numba

        small = len(clone.__code__.co_code) < INLINED_SIZE
        options = accelerator.options(False)
        # Dividing by zero gives what it does in numpy.
        made = numba.njit(clone, error_model="numpy", forceinline=small, **options)
        if accelerator.is_on():
            accelerator.typed_once(made)
        self.parts.append(made)
        return made

    def replace(self, value: Any) -> Any:
        """Return what numba is to see in the place of an intrinsic, or of a function that is
        compiled apart; None for others."""
        if isinstance(value, Intrinsic):
            return self.inner(value.make())
        if not hasattr(value, "apart") or not accelerator.is_on():
            return None
        from flocsim.compiler.table_types import call_of

        def target(given):
            symbol = symbol_of(value, str(given))
            returned = self.unit(symbol, value, lambda: given).returned
            self.calls[symbol] = Called(symbol, value.apart, pickle.dumps(given), returned)
            return symbol, returned

        return self.inner(call_of(target))


def say(what: str) -> None:
    """Say on stderr, once, what is compiled; nothing of ""."""
    if what and not quiet and what not in _said:
        _said.add(what)
        text = f"flocsim: first run: compiling {what}, once (up to a minute)"
        print(text, file=sys.stderr, flush=True)


def compiler_complaint(text: str) -> str:
    """Return "file:line: what is wrong" from numba's many lines: the innermost place of a
    kernel."""
    # Without colours; errors inside of others are quoted.
    text = re.sub(r"(\x1b|\\x1b)\[[0-9;]*m", "", text).replace("\\n", "\n")
    lines = [each.strip() for each in text.splitlines() if each.strip()]
    words = next((each for each in lines if not each.startswith("Failed in nopython")), lines[0])
    # The first place that is no file of a package, nor this one; errors of `return` name it in
    # other words.
    place = re.search(r"During: .* at (?!.*-packages|.*units\.py)([^<\n].*) \((\d+)\)", text)
    place = place or re.search(r'File "([^<\n"]+)", line (\d+)', text)
    where = f"{place[1]}:{place[2]}: " if place else ""
    return f"a kernel cannot be compiled: {where}{words[:300]}; {SCALARS_ONLY}"
