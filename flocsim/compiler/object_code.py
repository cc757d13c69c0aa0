"""Machine code as an object file: made of what numba compiles, loaded by LLVM alone.

Loading numba, and all that it registers, takes longer than a short run; a compiled function needs
no more of it than an object file and the name of its entry.

A compiled function is called as a C function of two addresses: that at which its answer goes, and
that of its arguments. It returns 0, or 1 where it has raised an exception.
"""

import ctypes
import hashlib
import struct
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from flocsim.compiler.processor import target
from flocsim.errors import KernelError

# How names begin of what numba lends to compiled code, once it is loaded itself.
LENT = "numba_", "NRT_", "Py", "_Py", "__svml"

# LLVM's engines, by the object files that they have loaded.
_loaded: dict[tuple[Any, ...], Any] = {}


class Called(NamedTuple):
    """A unit that another one calls: its ``symbol``, the name of its ``function``, the pickled
    numba ``types`` of its arguments, and the letters (struct) of what it is to have
    ``returned``."""

    symbol: str
    function: str
    types: bytes
    returned: str


class ObjectCode(NamedTuple):
    """``code``, an object file; ``entry``, its symbol; ``returned``, the letters (struct) of its
    answer; ``borrows``, whether it calls what only numba has; the units that it ``calls``."""

    code: bytes
    entry: str
    returned: str
    borrows: bool
    calls: tuple[Called, ...] = ()


def compiler(**machine: Any) -> Any:
    """Return LLVM's context of a process, ready to make and load object files."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_default_triple().create_target_machine(**machine)


def object_of(text: str, entry: str, loops: bool) -> tuple[bytes, set[str]]:
    """Return the object file of a module of LLVM, optimised, and the symbols that it lacks;
    ``loops``: it takes several turns of a loop at once."""
    import llvmlite.binding as llvm

    cpu, features = target(loops)
    machine = compiler(
        cpu=cpu, features=features, opt=3, reloc="static", codemodel="jitdefault", jit=True
    )
    module = llvm.parse_assembly(text)
    # Nothing but the entry is called from outside: LLVM may do what it likes with the others, as
    # with a C program of one file.
    for each in module.functions:
        if not each.is_declaration and each.name != entry:
            each.linkage = "internal"
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    options.loop_vectorization = options.slp_vectorization = loops
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    return machine.emit_object(module), {x.name for x in module.functions if x.is_declaration}


def load(code: ObjectCode, addresses: Mapping[str, int]) -> int:
    """Return the address of an entry; ``addresses`` {symbol: address} of units, those that it calls
    among them. The code stays as long as the process lives, and is loaded once; by one thread at a
    time."""
    import llvmlite.binding as llvm

    called = {each.symbol: addresses[each.symbol] for each in code.calls}
    key = hashlib.blake2b(code.code, digest_size=16).digest(), *called.items()
    if key not in _loaded:
        if code.borrows:
            import numba

            numba.njit("float64()")(lambda: 0.0)  # it lends once it has compiled something
        machine = compiler()
        # For the process as a whole, and yet for this file: those before are linked already.
        for symbol, address in called.items():
            llvm.add_symbol(symbol, address)
        # One of its own: symbols of two object files may have the same names.
        engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
        engine.add_object_file(llvm.ObjectFileRef.from_data(code.code))
        engine.finalize_object()
        _loaded[key] = engine
    return _loaded[key].get_function_address(code.entry)


def function_at(entry: int, returned: str) -> Callable[[bytes], Any]:
    """Return the entry at an address as a function of a table, which runs without the interpreter's
    lock; ``returned`` is the format of the answer."""
    call = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p, ctypes.c_char_p)(entry)
    layout = struct.Struct(f"@{returned}")
    answer_type = ctypes.c_char * max(layout.size, 8)

    def function(table):
        answer = answer_type()
        if call(answer, table):
            raise KernelError(
                "a kernel has raised an exception (run uncompiled, with jit=False, it says which)"
            )
        numbers = layout.unpack_from(answer)
        return numbers if len(numbers) > 1 else next(iter(numbers), None)

    return function
