"""One compiled function per scene, warm from disk in a new process and never stale.

``compose`` takes a driver written in plain Python and the functions that fill its slots
(flocsim.slots), clones every function that the driver reaches with those slots replaced, and
compiles the whole as one. What goes to disk is named by a hash of all that was reached: bytecode,
constants, Python, numba and numpy versions. An edited kernel therefore has another name; new
parameter values, which are arguments, do not.

Kernels must be plain functions that capture nothing: a closure's variables are invisible to
numba's symbol table, where two of them can collide and silently return each other's answers.
"""

import builtins
import hashlib
import os
import sys
import types
import warnings
from pathlib import Path

from flocsim.errors import KernelError

LITERALS = (bool, int, float, complex, str, bytes, type(None))
"""Types of globals that a kernel may read: their value is part of the hash."""

_composed = {}
_warned = []


def where(function):
    """ "name (file:line)" of a function, for messages."""
    code = function.__code__
    return f"{function.__qualname__} ({code.co_filename}:{code.co_firstlineno})"


def refuse_closure(function):
    """KernelError where the function captures variables."""
    if function.__closure__:
        captured = ", ".join(function.__code__.co_freevars)
        raise KernelError(
            f"kernel {where(function)} captures {captured}; "
            "make it a parameter (a field of the force) or a module constant"
        )


def names_in(code):
    """Global names that the code reads, those of nested code included."""
    names = set(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            names |= names_in(constant)
    return names


def plain(value):
    """The Python function behind a compiled one; anything else as it is."""
    return getattr(value, "py_func", value)


def reached(function):
    """The globals that a function reads: {name: value}."""
    known = function.__globals__
    names = sorted(names_in(function.__code__))
    return {name: plain(known[name]) for name in names if name in known}


def code_digest(code):
    """A hash of what the code does; line numbers and file names do not matter."""
    constants = [
        code_digest(c) if isinstance(c, types.CodeType) else repr(c) for c in code.co_consts
    ]
    parts = (code.co_code, constants, code.co_names, code.co_varnames, code.co_argcount)
    return hashlib.blake2b(repr(parts).encode(), digest_size=16).hexdigest()


def describe(name, value):
    """One line about a global that is no function, for the hash; None for what may change."""
    if isinstance(value, types.ModuleType):
        return f"{name}=module {value.__name__}"
    if isinstance(value, type):
        return f"{name}=class {value.__name__} {getattr(value, '_fields', ())}"
    if isinstance(value, LITERALS) or callable(value):
        return f"{name}={value!r}" if isinstance(value, LITERALS) else f"{name}={value.__name__}"
    return None


class Linker:
    """Clones functions for one scene, with slots replaced, and hashes what it clones."""

    def __init__(self, fillings, transform):
        """``fillings`` {slot function: scene's function}; ``transform(clone)`` compiles or not."""
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

    def clone(self, function):
        """A copy of the function whose globals are its own, linked."""
        linked = {"__builtins__": builtins, "__name__": function.__module__}
        for name, value in reached(function).items():
            linked[name] = self.link(value) if isinstance(value, types.FunctionType) else value
        copy = types.FunctionType(
            function.__code__, linked, function.__name__, function.__defaults__
        )
        copy.__qualname__ = f"{function.__qualname__}_{len(self.clones)}"
        copy.__module__ = function.__module__
        return copy


def fingerprint(entry, fillings):
    """A hash of everything that the composed function does."""
    import numba
    import numpy

    lines = [sys.version, numba.__version__, numpy.__version__]
    seen = set()

    def visit(function):
        function = fillings.get(function, function)
        if function in seen:
            return
        seen.add(function)
        refuse_closure(function)
        lines.append(f"{function.__qualname__} {code_digest(function.__code__)}")
        lines.append(repr(function.__defaults__))
        for name, value in reached(function).items():
            if isinstance(value, types.FunctionType):
                lines.append(f"{name}->{fillings.get(value, value).__qualname__}")
                visit(value)
                continue
            line = describe(name, value)
            if line is None:
                raise KernelError(
                    f"kernel {where(function)} reads the global {name!r}, a "
                    f"{type(value).__name__} that can change; make it a parameter or a number"
                )
            lines.append(line)

    visit(entry)
    return hashlib.blake2b("\n".join(lines).encode(), digest_size=12).hexdigest()


def cache_folder():
    """The folder of compiled scenes, or None where it cannot be written (said once)."""
    import platformdirs

    folder = Path(os.environ.get("FLOCSIM_CACHE") or platformdirs.user_cache_dir("flocsim"))
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".probe-{os.getpid()}"
        probe.write_bytes(b"")
        probe.unlink()
    except OSError as error:
        if not _warned:
            _warned.append(folder)
            warnings.warn(
                f"no compiled code is kept: the cache folder {folder} cannot be written "
                f"({error.strerror}); set FLOCSIM_CACHE to one that can",
                stacklevel=2,
            )
        return None
    return folder


def entry_source(entry):
    """The text of the module that numba caches: one function that calls the driver."""
    code = entry.__code__
    arguments = ", ".join(code.co_varnames[: code.co_argcount])
    return (
        f'"""Made by flocsim.composer from {entry.__module__}.{entry.__qualname__}."""\n\n\n'
        f"def run({arguments}):\n    return driver({arguments})\n"
    )


def write_once(path, text):
    """Write a file that several processes may write at once; all of them write the same."""
    if not path.exists():
        temporary = path.with_suffix(f".{os.getpid()}")
        temporary.write_text(text)
        os.replace(temporary, path)


def compiled(entry, fillings, name):
    """The entry compiled as module ``name``, from the disk where that is possible."""
    import numba

    def transform(clone):
        clone.__module__ = name
        # Nothing outside calls the inner functions: no wrappers for Python or C, which cost time.
        return numba.njit(
            clone, nogil=True, no_cpython_wrapper=True, no_cfunc_wrapper=True, error_model="numpy"
        )

    folder = cache_folder()
    text = entry_source(entry)
    path = (folder or Path("<composed>")) / f"{name}.py"
    if folder is not None:
        write_once(path, text)
    module = types.ModuleType(name)
    module.__file__ = str(path)
    sys.modules[name] = module
    module.driver = Linker(fillings, transform).link(entry)
    exec(compile(text, str(path), "exec"), module.__dict__)
    return numba.njit(module.run, nogil=True, cache=folder is not None, error_model="numpy")


def compose(entry, fillings, *, jit=True):
    """The driver ``entry`` with its slots filled, as one function.

    Parameters: ``entry``, a plain function; ``fillings``, {slot function of flocsim.slots: plain
    function}; ``jit=False`` links the plain Python functions, for debugging and reference.
    Raises KernelError for kernels that capture variables or read globals that may change.
    """
    key = (fingerprint(entry, fillings), jit)
    if key not in _composed:
        name = f"flocsim_scene_{key[0]}"
        if jit:
            _composed[key] = compiled(entry, fillings, name)
        else:
            _composed[key] = Linker(fillings, lambda clone: clone).link(entry)
    return _composed[key]
