"""What a function does, as a hash of bytecode, constants and all that it reaches through globals;
and what a kernel may not do, as its code shows before it is compiled, with file and line.

The hash names what the composer files on disk: an edited kernel has another name, whoever calls it.
Whatever reaches machine code has to be in its hash. Numbers, texts, tuples of them, enums of them
and named tuples are told by value; what Python, numpy and numba have is told by name, for their
versions are in the hash. All else is refused by name: what could change without another hash would
be computed with today and be stale tomorrow.

A kernel may not call Python, for kernels run without the interpreter's lock. Inner functions have
no environment in which numba's ``print`` finds what it needs of Python: it fails while it holds the
lock, never gives it back, and the process hangs with all of its threads, deaf to signals. Nor may
it return None on some of its ways, or make arrays: samples never reach every branch, and what they
leave out numba would compile to a None or refuse in words of its own.
"""

import builtins
import dis
import enum
import functools
import hashlib
import inspect
import sys
import types
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from flocsim.compiler.linker import (
    ATTRIBUTE_LOADS,
    PACKAGE,
    chains,
    is_versioned,
    module_reads,
    reached,
    refuse_closure,
    where,
)
from flocsim.compiler.processor import compilers, numba_settings
from flocsim.errors import KernelError

LITERALS = (bool, int, float, complex, str, bytes, type(None))
"""Types whose values are told by ``repr``."""

RANDOM = ("random", "numpy.random")
"""Modules whose numbers are others in each run."""

OF_NUMBA = ("prange", "literally", "literal_unroll")
"""What a kernel may call of numba itself, beside its types as conversions."""

OBJECT_MODE = "objmode"
"""numba's name for a way back into Python."""

CONTAINERS = {
    "BUILD_LIST": "a list", "BUILD_SET": "a set", "BUILD_MAP": "a dict",
    "BUILD_CONST_KEY_MAP": "a dict", "LIST_APPEND": "a list", "SET_ADD": "a set",
    "MAP_ADD": "a dict",
}  # fmt: skip
"""Instructions that make what Python allocates, and its name."""

ARRAY_MAKERS = {
    "arange", "array", "asanyarray", "asarray", "ascontiguousarray", "asfortranarray",
    "atleast_1d", "atleast_2d", "column_stack", "concatenate", "copy", "cross", "diag",
    "dstack", "empty", "empty_like", "eye", "fromiter", "full", "full_like", "geomspace",
    "hstack", "identity", "linspace", "logspace", "meshgrid", "ndarray", "ones", "ones_like",
    "outer", "repeat", "stack", "tile", "vstack", "zeros", "zeros_like",
}  # fmt: skip
"""Functions of numpy that give an array whatever they are given."""


class Intrinsic(NamedTuple):
    """What compiled code calls and numba has yet to make: its ``name``, and ``make()`` it."""

    name: str
    make: Callable[[], Any]


class Untold(Exception):
    """A value that cannot be told; the words say what it is and what to do."""


def told(value: Any) -> str:
    """One line that tells a value wholly; Untold where there is none."""
    if type(value) in LITERALS:
        return repr(value)
    if isinstance(value, Intrinsic):
        return f"intrinsic {value.name}"
    if type(value) is tuple:
        return f"({', '.join(map(told, value))})"
    if isinstance(value, type):
        return told_class(value)
    if isinstance(value, enum.Enum):
        return f"{value.name} of {told_class(type(value))}"
    if is_named_tuple(type(value)):
        return f"{told_class(type(value))}({', '.join(map(told, value))})"
    if isinstance(value, np.number | np.bool_):
        return f"{value.dtype.str} {value.tobytes().hex()}"
    line = told_by_name(value) or told_of_numba(value)
    if line is None:
        raise Untold(complaint(value))
    return line


def is_named_tuple(kind):
    """Whether a class is a named tuple as Python makes them, without more to it."""
    return kind.__mro__[1:] == (tuple, object) and hasattr(kind, "_fields")


def told_class(kind):
    """The line of a class; Untold for one that is no named tuple, enum or exception."""
    if is_named_tuple(kind):
        defaults = ", ".join(f"{name}={told(v)}" for name, v in kind._field_defaults.items())
        return f"class {kind.__name__}{kind._fields} {defaults}"
    if issubclass(kind, enum.Enum):
        bases = [base.__name__ for base in kind.__mro__[1:]]
        members = ", ".join(f"{name}={told(m.value)}" for name, m in kind.__members__.items())
        return f"class {kind.__name__}{bases} {members}"
    # What is raised ends a run; which numbers come before that does not hang on its class.
    if issubclass(kind, BaseException):
        return f"class {kind.__name__}"
    line = told_by_name(kind)
    if line is None:
        raise Untold(
            f"the class {kind.__name__}, which no hash follows; make what it holds a parameter, a "
            "named tuple, an enum of numbers or a module constant"
        )
    return line


def told_by_name(value):
    """The line of what Python or numpy have under a name of their own; None for anything else."""
    module, name = getattr(value, "__module__", None), getattr(value, "__name__", None)
    if not isinstance(module, str) or not isinstance(name, str) or module in RANDOM:
        return None
    for owner in (module, module.partition(".")[0]):
        known = sys.modules.get(owner)
        if getattr(known, name, None) is value and owner != "__main__" and is_versioned(known):
            return f"{owner}.{name}"
    return None


def told_of_numba(value):
    """The line of a type of numba's, or of the few of its functions that a kernel may call."""
    numba = sys.modules.get("numba")
    if numba is None:
        return None
    if isinstance(value, numba.types.Type) and getattr(numba.types, str(value), None) == value:
        return f"numba {value}"
    for name in OF_NUMBA:
        if getattr(numba, name) is value:
            return f"numba {name}"
    return None


def complaint(value):
    """What a value is that cannot be told, and what to do about it."""
    kind = type(value).__name__
    module = getattr(value, "__module__", None) or ""
    owner = getattr(value, "__self__", None)
    if module in RANDOM or type(owner).__module__.partition(".")[0] in ("random", "_random"):
        return "which draws random numbers: no run could be repeated; leave them out"
    makers = (type(value).__module__ or "").partition("._")[0], type(owner).__name__
    if makers[0] in RANDOM or makers[1] == "RandomState":
        return "which draws random numbers: no run could be repeated; leave them out"
    if module.partition(".")[0] == "numba" and not callable(value):
        return f"a {kind} of numba, which no hash follows; leave it out"
    if callable(value):
        return (
            f"a {kind}, whose code no hash follows; write a plain function with `def`, or put "
            "@numba.njit above it"
        )
    return f"a {kind} that can change; make it a parameter, a number or a tuple of numbers"


def code_digest(code):
    """A hash of what the code does; docstrings, line numbers and file names do not matter."""
    constants = [constant_text(each) for each in code.co_consts]
    if has_docstring(code):
        constants[0] = "docstring"
    counts = (code.co_argcount, code.co_kwonlyargcount, code.co_posonlyargcount, code.co_flags)
    names = (code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)
    parts = (code.co_code, constants, *names, *counts, getattr(code, "co_exceptiontable", b""))
    return hashlib.blake2b(repr(parts).encode(), digest_size=16).hexdigest()


def constant_text(value):
    """A constant of the code as text that is the same in every process."""
    if isinstance(value, types.CodeType):
        return code_digest(value)
    if isinstance(value, frozenset):
        return f"set {sorted(map(constant_text, value))}"
    return repr(value)


def has_docstring(code):
    """Whether the first constant of the code is its docstring."""
    if sys.version_info >= (3, 13):
        return bool(code.co_flags & inspect.CO_HAS_DOCSTRING)
    # Before, that place was None without one.
    return bool(code.co_consts) and isinstance(code.co_consts[0], str)


@functools.cache
def compiler_text() -> str:
    """What compiles: Python, numba, LLVM, numpy and numba's settings."""
    return f"{compilers()}\n{numba_settings()}"


def globals_read(function: Any) -> Iterable[tuple[str, Any]]:
    """(name, value) of all that a function reads, attributes of modules by their dotted names."""
    for name, value in reached(function).items():
        if not isinstance(value, types.ModuleType):
            yield name, value
    for chain, value in module_reads(function).items():
        yield ".".join(chain), value


def told_defaults(function):
    """The line of a function's default arguments; KernelError for one that could change."""
    defaults = {"": function.__defaults__ or (), **(function.__kwdefaults__ or {})}
    try:
        return " ".join(f"{name}={told(value)}" for name, value in defaults.items())
    except Untold as error:
        raise KernelError(f"kernel {where(function)} has a default argument, {error}") from None


class Told(NamedTuple):
    """What a function does, in ``lines``, the ``functions`` that it reaches and what they ``read``;
    ``calls`` {name: function} what of that is compiled apart, where that is left out."""

    lines: list[str]
    functions: list[Callable]
    read: list[Any]
    calls: dict[str, Callable]


def tell(entry: Any, fillings: dict[Callable, Callable], *, within: bool = False) -> Told:
    """All that a function does; ``within``: but for functions that are compiled apart from it,
    which it knows by name.

    KernelError, with the kernel's file and line and the name, for what cannot be told.
    """
    lines: list[str] = []
    seen: dict[Callable, int] = {}
    read: list[Any] = []
    calls: dict[str, Callable] = {}

    def visit(function):
        function = fillings.get(function, function)
        if function in seen:
            return seen[function]
        seen[function] = len(seen)
        if not isinstance(function, types.FunctionType):
            raise KernelError(
                f"{function!r} is no plain function; write one with `def` and leave @njit out"
            )
        refuse_closure(function)
        lines.append(f"{function.__qualname__} {code_digest(function.__code__)}")
        lines.append(told_defaults(function))
        for name, value in globals_read(function):
            if within and hasattr(value, "apart"):
                lines.append(f"{name}->{value.apart}")
                calls[value.apart] = value
                continue
            if isinstance(value, types.FunctionType):
                # Two functions may share a name, so that a number has to tell which is called.
                lines.append(f"{name}->{visit(value)}")
                continue
            try:
                line = told(value)
            except Untold as error:
                if "." in name or any(chain[0] == name for chain in chains(function.__code__)):
                    raise KernelError(
                        f"kernel {where(function)} reads the global {name!r}, {error}"
                    ) from None
                line = "an attribute of that name is read, not the global"
            lines.append(f"{name}={line}")
            read.append(value)
        return seen[function]

    visit(entry)
    return Told(lines, list(seen), read, calls)


def fingerprint(entry: Any, fillings: dict[Callable, Callable], options: str = "") -> str:
    """A hash of everything that the composed function does, and of how it is compiled.

    KernelError, with the kernel's file and line and the name, for what no hash can follow.
    """
    from flocsim.compiler.numba_internals import refuse_extensions

    found = tell(entry, fillings)
    refuse_extensions(found.functions, found.read)
    return hashed(found.lines, options)


def hashed(lines: Iterable[str], options: str) -> str:
    """The hash of what lines tell, and of how it is compiled."""
    text = "\n".join([compiler_text(), options, *lines])
    return hashlib.blake2b(text.encode(), digest_size=12).hexdigest()


@functools.lru_cache(maxsize=4096)
def instructions(code: types.CodeType) -> tuple[tuple[str, Any, int], ...]:
    """(name, argument, line) of every instruction of a code and of the codes in it; kept, for
    disassembly takes longer than a short run."""
    found = [(each.opname, each.argval, line_of(each, code)) for each in dis.get_instructions(code)]
    nested = [each for each in code.co_consts if isinstance(each, types.CodeType)]
    return tuple(found) + sum(map(instructions, nested), ())


def line_of(instruction, code):
    """The line of an instruction, or of its code."""
    line = instruction.positions.lineno if instruction.positions else None
    return line or code.co_firstlineno


def refuse_interpreter(entry: Any, fillings: Mapping[Callable, Callable] | None = None) -> None:
    """KernelError where a function, or one that it reaches, calls Python while it runs compiled.

    ``fillings`` {hook: function}: what stands in the place of hooks.
    """
    numba = sys.modules.get("numba")  # where it is not loaded, nothing of it can be called
    forbidden = [print, getattr(numba, OBJECT_MODE, print)]
    fillings = fillings or {}
    pending, seen = [entry], set()
    while pending:
        function = pending.pop()
        function = fillings.get(function, function)
        if function in seen or not isinstance(function, types.FunctionType):
            continue
        seen.add(function)
        pending += [each for each in reached(function).values() if callable(each)]
        if function.__code__.co_filename.startswith(PACKAGE):
            continue  # flocsim's own do not, and are many
        for opname, name, line in instructions(function.__code__):
            calls = opname in ATTRIBUTE_LOADS and name == OBJECT_MODE
            if opname in ("LOAD_GLOBAL", "LOAD_NAME"):
                value = function.__globals__.get(name, getattr(builtins, name, None))
                calls = any(value is each for each in forbidden)
            if calls:
                raise KernelError(
                    f"kernel {where(function)} calls {name} in line {line}: compiled code cannot "
                    "call Python while it runs; take it out (to look into a kernel, call it from "
                    "Python)"
                )


def parts_left(instruction):
    """How many parts an instruction leaves to be returned: 0 for None, 1 for one number that is
    computed or written there, k for a tuple of k; None where only a call could tell."""
    if instruction.opname == "BUILD_TUPLE":
        return instruction.arg
    if instruction.opname in ("BINARY_OP", "UNARY_NEGATIVE", "COMPARE_OP"):
        return 1
    value = instruction.argval
    if instruction.opname not in ("LOAD_CONST", "RETURN_CONST"):
        return None
    if value is None or isinstance(value, tuple):
        return len(value or ())
    return 1 if isinstance(value, (int, float)) else None


@functools.lru_cache(maxsize=1024)
def wrong_return(kernel: types.FunctionType, parts: int | None) -> str:
    """What a kernel returns somewhere in place of ``parts`` numbers (None: any tuple of them), in
    words; "" where nothing wrong shows."""
    code, before = kernel.__code__, None
    for each in dis.get_instructions(code):
        last = {"RETURN_CONST": each, "RETURN_VALUE": before}.get(each.opname)
        count = parts_left(last) if last else None
        place = f"{code.co_filename}:{line_of(each, code)}"
        if count == 0:
            return f"returns None on the way that ends in {place}"
        if count is not None and parts is not None and count != parts:
            what = "one number" if count == 1 else f"{count} numbers"
            return f"returns {what} in {place}"
        before = each
    return ""


def made_in(function: types.FunctionType) -> Iterator[tuple[str, int]]:
    """(what, line) of every container or array that a function's own code makes."""
    alone = [((name,), value) for name, value in reached(function).items()]
    makers = {
        chain[-1]: ".".join(chain)
        for chain, value in [*module_reads(function).items(), *alone]
        if getattr(value, "__name__", "") in ARRAY_MAKERS
        and (getattr(value, "__module__", None) or "numpy").startswith("numpy")
    }
    for opname, argument, line in instructions(function.__code__):
        if opname in CONTAINERS:
            yield CONTAINERS[opname], line
        elif opname.startswith("LOAD") and argument in makers:
            yield f"an array ({makers[argument]})", line


@functools.lru_cache(maxsize=1024)
def made_by(kernel: Callable) -> str:
    """ "makes an array (np.zeros) in file:line" of a kernel or of a helper of its; "" where none
    does. Numpy's functions, which compiled code has in its own way, and Python's are no helpers."""
    pending, seen = [kernel], set()
    while pending:
        function = pending.pop()
        if not isinstance(function, types.FunctionType) or function in seen:
            continue
        seen.add(function)
        module = sys.modules.get(function.__module__ or "")
        if module is not None and module.__name__ != "__main__" and is_versioned(module):
            continue
        for what, line in made_in(function):
            return f"makes {what} in {function.__code__.co_filename}:{line}"
        pending += [*reached(function).values(), *module_reads(function).values()]
    return ""
