"""Machine code as numba has made it: object files, kept as they are and loaded by LLVM alone.

Loading numba, and all that it registers, takes longer than a short run; a function that allocates
nothing needs no more of it than an object file and the name of its entry. What such a function
returns is numbers: numba's way of calling puts them where a first pointer says, a second one tells
what was raised, and the answer is whether anything was.
"""

import ctypes
import hashlib
import json
import pickle
import struct
import threading
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

LENT = b"numba_", b"NRT_", b"Py", b"_Py", b"__svml"
"""How names begin of what numba lends to compiled code, once it is loaded itself."""

_lock = threading.Lock()
_engines: list[Any] = []
_linked: dict[tuple[Any, ...], int] = {}


class Called(NamedTuple):
    """A unit that another one calls: its ``symbol``, the name of its ``function``, the ``types`` of
    its arguments in words, and what it is to have ``returned``, as for struct.unpack."""

    symbol: str
    function: str
    types: list[str]
    returned: str


class ObjectCode(NamedTuple):
    """``code``, an object file; ``entry``, its symbol; ``returned``, what it returns, as for
    struct.unpack; ``borrows``, whether it calls what only numba has; the units that it ``calls``.
    """

    code: bytes
    entry: str
    returned: str
    borrows: bool
    calls: tuple[Called, ...] = ()

    def packed(self) -> bytes:
        """As the disk has it."""
        return json.dumps(self[1:]).encode() + b"\n" + self.code

    @classmethod
    def unpacked(cls, data: bytes) -> "ObjectCode":
        head, code = data.split(b"\n", 1)
        entry, returned, borrows, calls = json.loads(head)
        return cls(code, entry, returned, borrows, tuple(Called(*each) for each in calls))

    def load(self, called: Mapping[str, int] = MappingProxyType({})) -> int:
        """The address of the entry; ``called`` {symbol: address} of the units that it calls. The
        code stays as long as the process lives."""
        import llvmlite.binding as llvm

        if self.borrows:
            import numba

            numba.njit("float64()")(lambda: 0.0)  # it lends once it has compiled something
        with _lock:
            llvm.initialize_native_target()
            llvm.initialize_native_asmprinter()
            # For the process as a whole, and yet for this file: those before are linked already.
            for symbol, address in called.items():
                llvm.add_symbol(symbol, address)
            machine = llvm.Target.from_default_triple().create_target_machine()
            # One of its own: symbols of two object files may have the same names.
            engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
            engine.add_object_file(llvm.ObjectFileRef.from_data(self.code))
            engine.finalize_object()
            _engines.append(engine)
            return engine.get_function_address(self.entry)


def link(code: ObjectCode, units: dict[str, ObjectCode]) -> int:
    """The address of a unit, linked with ``units`` {symbol: ObjectCode}, as far as it calls them;
    what is linked with the same ones is loaded once.

    ValueError where one returns another thing than its caller was compiled for.
    """
    if any(units[each.symbol].returned != each.returned for each in code.calls):
        raise ValueError("a unit was compiled for another one than it is linked with")
    called = {each.symbol: link(units[each.symbol], units) for each in code.calls}
    key = hashlib.blake2b(code.code, digest_size=16).digest(), code.entry, *called.items()
    if key not in _linked:
        _linked[key] = code.load(called)
    return _linked[key]


def function_at(entry: int, returned: str) -> Callable[[int], Any]:
    """The entry at an address as a function of an address, which runs without the interpreter's
    lock; ``returned`` as in ObjectCode."""
    kind = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64)
    call, layout = kind(entry), struct.Struct(f"@{returned}")

    def function(address):
        answer, raised = ctypes.create_string_buffer(layout.size or 8), ctypes.c_void_p()
        if call(ctypes.addressof(answer), ctypes.addressof(raised), address):
            raise exception_at(raised.value or 0)
        numbers = layout.unpack_from(answer)
        return numbers if len(numbers) > 1 else next(iter(numbers), None)

    return function


def exception_at(address: int) -> BaseException:
    """The exception that numba's compiled code tells of: a pickle (class, arguments, place)."""
    data = ctypes.c_void_p.from_address(address)
    size = ctypes.c_int32.from_address(address + ctypes.sizeof(data))
    kind, arguments, _ = pickle.loads(ctypes.string_at(data.value or 0, size.value))
    return kind(*(arguments or ()))
