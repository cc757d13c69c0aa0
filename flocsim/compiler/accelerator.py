"""All that flocsim knows of numba's private parts. Optional: without it everything works, slower.

1. ``compilers``: Python calls one of an engine's five hundred functions. The others are stored as
   they are lowered; the whole is optimised once, as a program of one file is (units.object_of).

2. ``typed_once``: a function is not compiled anew for every constant that it is called with.
3. ``quick_typing``: while numba compiles, it remembers what it has inferred, garbage waits, and
   nobody is notified of every call of LLVM.

A numba without one of these parts, or FLOCSIM_ACCELERATOR=0, turns all of it off. Cold starts then
take several times as long.
"""

import contextlib
import ctypes
import functools
import gc
import inspect
import os
from collections.abc import Callable, Iterator, Sequence
from types import SimpleNamespace
from typing import Any

# Passes of numba's that find nothing in functions on scalars that define no others inside.
NEEDLESS_PASSES = (
    "InlineClosureLikes", "MakeFunctionToJitFunction", "InlineInlinables",
    "FindLiterallyCalls", "LiteralUnroll", "LiteralPropagationSubPipelinePass", "NopythonRewrites",
    "InlineOverloads",
)  # fmt: skip

# The pass that stores all that numba inferred of a function, to be looked at.
ANNOTATIONS = "AnnotateTypes"

# What numba writes in colours, in messages for each attempt at a type.
COLOURED = "code", "errmsg", "filename", "indicate", "highlight", "reset"

# Functions that take more than a second and leave some ten MB behind.
MANY = 50


@functools.cache
def is_on() -> bool:
    """Return True unless it is turned off, or this numba lacks a part: a small unit is compiled by
    all of them."""
    if os.environ.get("FLOCSIM_ACCELERATOR") == "0":
        return False
    try:
        import numba

        with replacements():
            twice = typed_once(numba.njit(lambda x: 2.0 * x, **pipelines(False)))
            whole = numba.cfunc("f8(f8)", **pipelines(True))
            text = whole(lambda x: twice(x) + twice(1.0)).inspect_llvm()
        forget([twice])
        return text.count("\ndefine") >= 3  # the unit, its wrapper and what it calls
    except Exception:
        return False


def options(unit: bool) -> dict[str, Any]:
    """Return options of numba.cfunc for the function that a unit begins with, else of numba.njit
    for those that are only linked into it."""
    return pipelines(unit) if is_on() else {}


@functools.cache
def pipelines(unit: bool) -> dict[str, Any]:
    """Return the options that `options` gives where the accelerator is on."""
    from numba.core.codegen import JITCodeLibrary
    from numba.core.compiler import CompilerBase, DefaultPassBuilder
    from numba.core.compiler_machinery import register_pass
    from numba.core.typed_passes import NativeLowering

    class Library(JITCodeLibrary):
        """Code as it was lowered, neither optimised nor loaded."""

        # What is not loaded has no place for Python's objects.
        codegen = SimpleNamespace(set_env=lambda name, environment: None)

        def get_pointer_to_function(self, name):
            """Return 0: there is no machine code of it in this process."""
            self._ensure_finalized()
            return 0

        def _optimize_functions(self, module):
            module.data_layout = self._codegen._data_layout

        def finalize(self):
            """Mark it as complete; it is linked by the unit."""
            self._raise_if_finalized()
            self._finalized = True

    class Unit(Library):
        """A function linked with all that it reaches."""

        def finalize(self):
            reached = list(dict.fromkeys(self._linking_libraries))
            for each in reached:  # grows
                new = dict.fromkeys(each._linking_libraries)
                reached += [other for other in new if other not in reached]
                self._final_module.link_in(each._get_module_for_linking(), preserve=True)
            super().finalize()

    @register_pass(mutates_CFG=True, analysis_only=False)
    class Lowering(NativeLowering):
        """numba's last pass, into a library of ours."""

        _name = f"flocsim_lowering_{unit}"

        def run_pass(self, state):
            name = state.func_id.func_qualname
            state.library = (Unit if unit else Library)(state.targetctx.codegen(), name)
            return super().run_pass(state)

    class Compiler(CompilerBase):
        """numba's usual passes with another last one."""

        def define_pipelines(self):
            plain = not any(map(inspect.iscode, self.state.func_id.code.co_consts))
            needless = (ANNOTATIONS, *(NEEDLESS_PASSES if plain else ()))
            passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
            passes.passes = [
                (Lowering if each is NativeLowering else each, what)
                for each, what in passes.passes
                if each.__name__ not in needless
            ]
            passes.finalize()
            return [passes]

    unwrapped = {} if unit else {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    # As nothing is allocated no references are counted, which would take most of the time.
    return {"pipeline_class": Compiler, "_nrt": False, **unwrapped}


def typed_once(dispatcher: Any) -> Any:
    """Return the function, not compiled anew for every constant that it is called with."""
    from numba import types

    template = dispatcher.get_call_template

    def without_literals(arguments, keywords):
        plain = tuple(types.unliteral(each) for each in arguments)
        return template(plain, {name: types.unliteral(v) for name, v in keywords.items()})

    dispatcher.get_call_template = without_literals
    return dispatcher


def forget(dispatchers: Sequence[Any]) -> None:
    """Free what numba stores of functions that have been linked into another one, and, of many,
    what C's library keeps of the memory that they took."""
    for each in dispatchers:
        for result in each.overloads.values():
            each.targetctx.remove_user_function(result.entry_point)
        each.overloads.clear()
    if len(dispatchers) > MANY:
        gc.collect()
        with contextlib.suppress(OSError, AttributeError):  # glibc's alone has that
            ctypes.CDLL(None).malloc_trim(0)


def remembering(real: Callable, case_of: Callable) -> Callable:
    """Return a function that calls the real one once for each case of its arguments."""
    known: dict[Any, Any] = {}

    def remembered(*arguments):
        case = case_of(*arguments)
        if case not in known:
            # The arguments are stored, too: nothing else takes their id while this memory lives.
            known[case] = real(*arguments), arguments
        return known[case][0]

    return remembered


@contextlib.contextmanager
def replacements() -> Iterator[None]:
    """Exchange functions of numba inside; garbage waits, as millions of objects live until the end,
    through which the collector would walk again and again."""
    from numba.core import errors, event
    from numba.core.base import BaseContext
    from numba.core.types import Function

    # The types of every `+` and `sqrt`; sizes of LLVM's types, each asked for by parsing a text;
    # listeners of two events for every call of LLVM; colours of messages that nobody sees.
    errors.termcolor()  # made at the first call
    typed = remembering(
        Function.get_call_type, lambda f, context, given, more: (id(f), given, *more.items())
    )
    sized = remembering(BaseContext.get_abi_sizeof, lambda context, kind: str(kind))
    others: tuple[tuple[Any, str, Any], ...] = (
        (Function, "get_call_type", typed),
        (BaseContext, "get_abi_sizeof", sized),
        (event, "start_event", lambda *_, **__: None),
        (event, "end_event", lambda *_, **__: None),
        (errors, "_termcolor_inst", SimpleNamespace(**dict.fromkeys(COLOURED, str))),
    )
    collecting, before = gc.isenabled(), [vars(owner).get(name) for owner, name, _ in others]
    gc.disable()
    try:
        for owner, name, other in others:
            setattr(owner, name, other)
        yield
    finally:
        for (owner, name, _), own in zip(others, before, strict=True):
            setattr(owner, name, own) if own else delattr(owner, name)
        if collecting:
            gc.enable()


def quick_typing() -> Any:
    """Return a context in which numba compiles quicker."""
    return replacements() if is_on() else contextlib.nullcontext()
