"""How numba compiles the inner functions of a scene: to be linked into the outermost, no further.

numba optimises every function and makes machine code of it, at once, as if Python were to call it.
Of a scene's two hundred functions Python calls one. The others are kept as they are lowered, and
optimised once, where they end up: that halves the time that a scene takes to compile.

This leans on numba's insides; where they are not what they were, ``pipeline`` is None and scenes
compile the usual way.

While numba compiles a scene, it remembers what it inferred, and Python's garbage waits.

numba asks anew for the type of every ``+`` and ``sqrt``, trying dozens of templates each time,
though a scene of two hundred functions has some hundred different cases. And it makes millions of
objects that live until it is done, which the garbage collector walks through again and again.
Together they are a fifth of the time that a scene takes to compile.

The memory ends with the compilation: it can't outlive the options that it was made under. Where
numba's insides are not what they were, nothing is remembered.
"""

import contextlib
import functools
import gc
import threading
import weakref

NEEDED = (
    "_optimize_final_module", "_finalize_final_module", "_finalize_dynamic_globals",
    "get_pointer_to_function",
)  # fmt: skip
"""What numba's library of compiled code must have for us to leave it out."""


class NoEnvironment:
    """A numba code generator that sets no environment of a function, for there is nowhere to."""

    def __init__(self, generator):
        """Stands for ``generator`` in all else."""
        self.generator = generator

    def __getattr__(self, name):
        return getattr(self.generator, name)

    def set_env(self, name, environment):
        """Nothing: what Python objects a function needs, its caller in machine code has."""


def linked_library(base):
    """A kind of numba library whose code is linked into others but is not run by itself."""

    class LinkedLibrary(base):
        """Code as it was lowered: neither optimised nor made machine code of."""

        @property
        def codegen(self):
            """The code generator, without what it does for functions that Python calls."""
            return NoEnvironment(self._codegen)

        def _optimize_final_module(self):
            """Left to the library that this one is linked into."""

        def _finalize_final_module(self):
            """Only what linking needs."""
            self._finalize_dynamic_globals()
            self._final_module.__library = weakref.proxy(self)
            self._finalized = True

        def get_pointer_to_function(self, name):
            """None: there is no machine code."""
            return 0

    return LinkedLibrary


def lowering_pass(library_class):
    """numba's last pass, into a library of the given kind."""
    from numba.core.compiler_machinery import register_pass
    from numba.core.typed_passes import NativeLowering

    @register_pass(mutates_CFG=True, analysis_only=False)
    class LinkedLowering(NativeLowering):
        """Lowers a function into a library that is linked only."""

        _name = "flocsim_linked_lowering"

        def run_pass(self, state):
            """Prepare the library, then lower as usual."""
            name = state.func_id.func_qualname
            state.library = library_class(state.targetctx.codegen(), name)
            return super().run_pass(state)

    return LinkedLowering


@functools.cache
def pipeline():
    """The compiler class for inner functions, to hand to numba.njit; None where it cannot be."""
    try:
        from numba.core.codegen import JITCodeLibrary
        from numba.core.compiler import CompilerBase, DefaultPassBuilder
        from numba.core.typed_passes import NativeLowering
    except ImportError:
        return None
    if not all(hasattr(JITCodeLibrary, name) for name in NEEDED):
        return None
    lowering = lowering_pass(linked_library(JITCodeLibrary))

    class InnerCompiler(CompilerBase):
        """numba's usual passes with another last one."""

        def define_pipelines(self):
            """The one pipeline of compiled code."""
            passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
            passes.passes = [
                (lowering if each is NativeLowering else each, what) for each, what in passes.passes
            ]
            passes.finalize()
            return [passes]

    return InnerCompiler


_one_at_a_time = threading.RLock()


@contextlib.contextmanager
def garbage_waits():
    """No garbage collection inside, unless it was off before."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()


def remembering(real):
    """numba's ``get_call_type(function, context, arguments, keywords)``, asked once a case."""
    known = {}

    def remembered(function, context, arguments, keywords):
        case = (id(function), arguments, tuple(keywords.items()))
        if case not in known:
            # The function is kept too: nothing else takes its id while this memory lives.
            known[case] = real(function, context, arguments, keywords), function
        return known[case][0]

    return remembered


@contextlib.contextmanager
def types_remembered():
    """numba's built-in functions remember their types inside."""
    from numba.core import types

    kind, name = types.Function, "get_call_type"
    own, real = vars(kind).get(name), getattr(kind, name, None)
    if real is None:
        yield
        return
    setattr(kind, name, remembering(real))
    try:
        yield
    finally:
        delattr(kind, name) if own is None else setattr(kind, name, own)


@contextlib.contextmanager
def quick_typing():
    """Compile in here: see the module's text. One thread at a time, as numba compiles."""
    with _one_at_a_time, garbage_waits(), types_remembered():
        yield
