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
import re
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from flocsim.compiler import accelerator, disk_cache
from flocsim.compiler.fingerprint import Intrinsic, describe, hashed
from flocsim.compiler.linker import Linker
from flocsim.compiler.object_code import LENT, Called, ObjectCode, load, object_of
from flocsim.compiler.processor import compiled_for
from flocsim.errors import FlocsimError, KernelError
from flocsim.process import COMPILING, lacking

# Functions of less bytecode [bytes] are always inlined; of the others LLVM decides. Up to 1,200
# would gain 7 % of throughput for 1.5 times the compile time.
INLINED_SIZE = 400

# How names of functions begin that allocate memory.
ALLOCATORS = "NRT_MemInfo", "NRT_Allocate"

SCALARS_ONLY = "use plain arithmetic on scalars, without arrays and lists"

# Seconds after which a line says what is compiled.
WORTH_SAYING = 3.0

# Nothing is said: in processes of which another one speaks.
quiet = False

_said: set[str] = set()
_one_at_a_time = threading.RLock()


def argument_names(function: Any) -> tuple[str, ...]:
    """Return the names of a function's arguments."""
    return function.__code__.co_varnames[: function.__code__.co_argcount]


@functools.cache
def options_text(allocates: bool) -> str:
    """Return how functions are compiled, for the hash: the code that says how."""
    files = sorted(Path(__file__).parent.glob("*.py"))
    digest = hashlib.blake2b(b"".join(each.read_bytes() for each in files), digest_size=8)
    return f"{allocates} {digest.hexdigest()}"


class Engine:
    """A linked function with all units that it calls, found on the disk or compiled.

    Parameters: ``entry``, the function, in the file called ``name``; ``words``, which tell the
    types of its arguments; ``typed()`` returns these: numba types, those of the words of a table at
    an address, or of others where ``readers`` {argument: function of an address} is {}.
    ``allocates``: it makes arrays for itself. ``whole``: with what is postponed. ``what`` it is,
    for who waits. ``returns``: the letters (struct) of its answer, else as numba infers them.
    """

    def __init__(
        self,
        entry: Callable,
        name: str,
        words: str,
        typed: Callable[[], tuple[tuple[Any, ...], dict[str, Any], dict[str, Any]]],
        allocates: bool = False,
        whole: bool = False,
        what: str = "",
        returns: str | None = None,
    ) -> None:
        self.entry, self.name, self.words, self.typed = entry, name, words, typed
        self.allocates, self.whole, self.what, self.returns = allocates, whole, what, returns
        self.options = options_text(allocates)
        self.linker = Linker({}, self.inner, self.replace)
        self.units: dict[str, ObjectCode] = {}
        self.addresses: dict[str, int] = {}
        self.calls: dict[str, Called] = {}
        self.parts: list[Any] = []
        self.known: dict[str, Any] = {}

    def load(self) -> tuple[int, str]:
        """Return the address of the machine code, and the letters (struct) of its answer."""
        with _one_at_a_time, contextlib.ExitStack() as self.stack:
            symbol, code = self.unit(self.entry, (self.words,))
        assert code is not None
        return self.link(symbol), code.returned

    def link(self, symbol: str) -> int:
        """Return the address of a unit, loaded after those that it calls."""
        if symbol not in self.addresses:
            code = self.units[symbol]
            called = {each.symbol: self.link(each.symbol) for each in code.calls}
            self.addresses[symbol] = load(code, called)
        return self.addresses[symbol]

    def unit(
        self, function: Callable, words: tuple[str, ...], given: Any = None
    ) -> tuple[str, ObjectCode | None]:
        """Return the symbol and the code of a unit for arguments of types of such names; None where
        it has to be compiled, and the types are not known."""
        name = getattr(function, "apart", "")
        symbol = f"flocsim_{hashlib.blake2b(repr((name, words)).encode()).hexdigest()[:24]}"
        if symbol in self.units:
            return symbol, self.units[symbol]
        made = function if self.whole else getattr(function, "stand_in", function)
        file_name = self.name
        if function is not self.entry:
            file_name = f"flocsim_unit_{hashed(describe(made).lines, self.options)}"
        file = file_name, repr((words, compiled_for(hasattr(made, "loops"))))
        code = self.from_disk(made, *file)
        if code is None:
            if function is not self.entry and given is None:
                self.known = self.known or self.typed()[2]
                if not self.known.keys() >= set(words):
                    return symbol, None
                given = [self.known[each] for each in words]
            code = self.compiled(made, given)
            disk_cache.write(*file, code.packed())
        self.units[symbol] = code
        return symbol, code

    def from_disk(self, function: Callable, name: str, key: str) -> ObjectCode | None:
        """Return a unit as the disk has it, if what it calls returns what it expects."""
        if (data := disk_cache.read(name, key)) is None:
            return None
        code = ObjectCode.unpacked(data)
        for each in code.calls:
            _, found = self.unit(describe(function).calls[each.function], each.types)
            if found is None or found.returned != each.returned:
                return None
        return code

    def compiled(self, function: Callable, given: Any) -> ObjectCode:
        """Return the code of a unit, compiled."""
        if not self.parts:
            self.begin()
        import numba

        from flocsim.compiler.table_types import answer_to, letters_of, types_within

        readers: dict[str, Any] = {}
        if function is self.entry:
            given, readers, within = self.typed()
            self.known |= within
        self.known |= types_within(given)
        names = argument_names(function)
        taken = "address" if readers else ", ".join(names)
        handed = ", ".join(f"read_{name}(address)" if readers else name for name in names)
        returned: list[Any] = []
        driver = self.inner(self.linker.clone(function))
        put = answer_to(returned.append, self.returns if function is self.entry else None)
        known = {f"read_{name}": each for name, each in readers.items()}
        known |= {"driver": driver, "put": put}
        exec(
            f"def run(answer, {taken}):\n    try:\n        put(answer, driver({handed}))\n"
            "    except Exception:\n        return 1\n    return 0\n",
            known,
        )
        options = accelerator.options(True, self.allocates)
        kind = numba.types.int64(numba.types.int64, *given)
        try:
            made = numba.cfunc(kind, error_model="numpy", **options)(known["run"])
        except numba.errors.NumbaError as error:
            raise KernelError(compiler_complaint(str(error))) from None
        letters = letters_of(returned[-1])
        if letters is None:
            raise KernelError(f"a compiled function returns {returned[-1]}: let it return numbers")
        entry, loops = made.native_name, hasattr(function, "loops")
        code, missing = object_of(made.inspect_llvm(), entry, loops)
        # Without the accelerator, numba compiles kernels that make arrays or lists.
        if not self.allocates and any(x.startswith(ALLOCATORS) for x in missing):
            raise KernelError(f"a kernel cannot be compiled: {SCALARS_ONLY}")
        calls = tuple(self.calls[each] for each in sorted(missing) if each in self.calls)
        return ObjectCode(code, entry, letters, any(x.startswith(LENT) for x in missing), calls)

    def begin(self) -> None:
        """Prepare for compiling, until all units are there."""
        if text := lacking(COMPILING, "compiling"):
            raise FlocsimError(text)  # LLVM ends the process where it gets no memory
        import numba  # noqa: F401  (takes its time, before that is counted)

        self.stack.enter_context(announced(self.what))
        self.stack.enter_context(accelerator.quick_typing())
        self.stack.callback(accelerator.forget, self.parts)

    def inner(self, clone: Any) -> Any:
        """Return what numba is to compile of a function, and to put into those that call it."""
        import numba

        small = len(clone.__code__.co_code) < INLINED_SIZE
        options = accelerator.options(False, self.allocates)
        # Dividing by zero gives what it does in numpy.
        made = numba.njit(clone, error_model="numpy", forceinline=small, **options)
        self.parts.append(accelerator.inner(made))
        return made

    def replace(self, value: Any) -> Any:
        """Return what numba is to see in the place of an intrinsic, or of a function that is
        compiled apart; None for others."""
        if isinstance(value, Intrinsic):
            return self.inner(value.make())
        if not hasattr(value, "apart") or self.allocates or not accelerator.by_units():
            return None
        from flocsim.compiler.table_types import call_of

        def target(given):
            words = tuple(map(str, given))
            symbol, code = self.unit(value, words, given)
            self.calls[symbol] = Called(symbol, value.apart, words, code.returned)
            return symbol, code.returned

        return self.inner(call_of(argument_names(value), target))


def say(what: str) -> None:
    """Say on stderr what is compiled."""
    _said.add(what)
    text = f"flocsim: first run: compiling {what}, once (up to a minute)"
    print(text, file=sys.stderr, flush=True)


@contextlib.contextmanager
def announced(what: str) -> Iterator[None]:
    """Say on stderr what is compiled inside, if it takes more than a moment and has not been said;
    nothing of ""."""
    timer = threading.Timer(WORTH_SAYING, say, [what])
    timer.daemon = True
    if what and not quiet and what not in _said:
        timer.start()
    try:
        yield
    finally:
        timer.cancel()


def compiler_complaint(text: str) -> str:
    """Return "file:line: what is wrong" from numba's many lines: the innermost place of a
    kernel."""
    # Without colours; errors inside of others are quoted.
    text = re.sub(r"(\x1b|\\x1b)\[[0-9;]*m", "", text).replace("\\n", "\n")
    lines = [each.strip() for each in text.splitlines() if each.strip()]
    words = next((each for each in lines if not each.startswith("Failed in nopython")), lines[0])
    # The first place that is no file of a package; errors of `return` name it in other words.
    place = re.search(r"During: .* at (?!.*-packages)([^<\n].*) \((\d+)\)", text)
    place = place or re.search(r'File "([^<\n"]+)", line (\d+)', text)
    where = f"{place[1]}:{place[2]}: " if place else ""
    return f"a kernel cannot be compiled: {where}{words[:300]}; {SCALARS_ONLY}"
