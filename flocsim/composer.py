"""One compiled function per scene, warm from disk in a new process and never stale.

``compose`` takes a driver written in plain Python and the functions that fill its slots
(flocsim.hooks), clones every function that the driver reaches with those slots replaced, and
compiles the whole as one. What goes to disk is named by a hash of all that was reached: bytecode,
constants, Python, numba and numpy versions. An edited kernel therefore has another name; new
parameter values, which are arguments, do not.

Kernels must be plain functions that capture nothing: a closure's variables are invisible to
numba's symbol table, where two of them can collide and silently return each other's answers.
"""

import builtins
import os
import re
import sys
import types
import warnings
from pathlib import Path

from flocsim.errors import KernelError
from flocsim.fingerprint import fingerprint, reached, refuse_closure
from flocsim.numba_internals import pipeline, quick_typing

INLINED_SIZE = 800
"""Functions of less bytecode [bytes] are always inlined: a call hands over some hundred numbers."""

_composed = {}
_warned = []


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


def cache_folder():
    """The folder of compiled scenes, or None where it cannot be written (said once)."""
    folder = cache_path()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".probe-{os.getpid()}"
        probe.write_bytes(b"")
        probe.unlink()
    except OSError as error:
        warn_uncached(error)
        return None
    return folder


def warn_uncached(error):
    """Say once that compiled code cannot be kept."""
    if not _warned:
        _warned.append(error)
        warnings.warn(
            f"no compiled code is kept: the cache folder {cache_path()} cannot be written "
            f"({error.strerror}); set FLOCSIM_CACHE to one that can",
            stacklevel=2,
        )


def cache_path():
    """Where compiled scenes should go."""
    import platformdirs

    return Path(os.environ.get("FLOCSIM_CACHE") or platformdirs.user_cache_dir("flocsim"))


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


def compiled(entry, fillings, name, allocates):
    """The entry compiled as module ``name``, from the disk where that is possible."""
    import numba

    # Kernels that allocate nothing need no counting of references, which costs more than most work.
    options = {"nogil": True, "error_model": "numpy", "_nrt": allocates}

    def transform(clone):
        clone.__module__ = name
        # Nothing outside calls the inner functions: no wrappers for Python or C, which cost time.
        small = len(clone.__code__.co_code) < INLINED_SIZE
        inner = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "forceinline": small}
        if pipeline() is not None:
            inner["pipeline_class"] = pipeline()
        return compiled_once(numba.njit(clone, **options, **inner))

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
    dispatcher = numba.njit(module.run, cache=folder is not None, **options)
    return guarded(dispatcher, numba.core.errors.NumbaError)


def compiled_once(dispatcher):
    """The function, not compiled anew for every constant that it is called with."""
    from numba import types

    template = dispatcher.get_call_template

    def without_literals(arguments, keywords):
        plain = tuple(types.unliteral(each) for each in arguments)
        return template(plain, {name: types.unliteral(v) for name, v in keywords.items()})

    dispatcher.get_call_template = without_literals
    return dispatcher


def guarded(dispatcher, compiler_error):
    """The compiled function; code that cannot be compiled gives a KernelError, one line."""

    def call(*arguments):
        try:
            if not dispatcher.signatures:
                with quick_typing():
                    dispatcher.compile(tuple(map(dispatcher.typeof_pyval, arguments)))
            return dispatcher(*arguments)
        except compiler_error as error:
            raise KernelError(compiler_complaint(str(error))) from None
        except OSError as error:
            # Compiled, but the disk took no copy: go on with what is in memory.
            warn_uncached(error)
            return dispatcher(*arguments)

    return call


def compiler_complaint(text):
    """ "file:line: what is wrong" from numba's many lines: the innermost place that it names."""
    words, complaint = "", ""
    for line in text.splitlines():
        found = re.match(r'\s*File "(.+)", line (\d+)', line)
        if found:
            complaint = f"{found[1]}:{found[2]}: {words}"
        elif line.strip():
            words = line.strip()
    complaint = complaint or text.strip().splitlines()[0]
    return f"a kernel cannot be compiled: {complaint[:300]}; use plain arithmetic on scalars"


def compose(entry, fillings, *, jit=True, allocates=False):
    """The driver ``entry`` with its slots filled, as one function.

    Parameters: ``entry``, a plain function; ``fillings``, {slot function of flocsim.hooks: plain
    function}; ``jit=False`` links the plain Python functions, for debugging and reference;
    ``allocates``, whether any of the functions makes an array.
    Raises KernelError for kernels that capture variables or read globals that may change.
    """
    key = (fingerprint(entry, fillings, f"{INLINED_SIZE} {allocates}"), jit)
    if key not in _composed:
        name = f"flocsim_scene_{key[0]}"
        if jit:
            _composed[key] = compiled(entry, fillings, name, allocates)
        else:
            _composed[key] = Linker(fillings, lambda clone: clone).link(entry)
    return _composed[key]
