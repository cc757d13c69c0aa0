"""All that flocsim knows of numba's private parts. Optional: without it everything works, slower.

1. ``compilers``: Python calls one of an engine's five hundred functions. The others are stored as
   they are lowered; the whole is optimised once, as a program of one file is (units.object_of).

2. ``typed_once``: a function is not compiled anew for every constant that it is called with.
3. ``quick_typing``: while numba compiles, it remembers what it has inferred, garbage waits, nobody
   is notified of every call of LLVM, and variables are listed by a shorter way.

A numba without one of these parts, or FLOCSIM_ACCELERATOR=0, turns all of it off. Cold starts then
take several times as long.
Measured: benchmarks/speed/compile_times.py --private.
"""

import contextlib
import ctypes
import functools
import gc
import inspect
import os
from collections.abc import Callable, Iterator, Sequence
from typing import Any

# Names of what to leave out, to measure what it gains: compilers, typed_once, quick_typing.
WITHOUT = os.environ.get("FLOCSIM_COMPILE_WITHOUT", "").split(",")

# Passes of numba's that find nothing in functions on scalars that define no others inside.
NEEDLESS_PASSES = (
    "InlineClosureLikes", "MakeFunctionToJitFunction", "InlineInlinables",
    "FindLiterallyCalls", "LiteralUnroll", "LiteralPropagationSubPipelinePass", "NopythonRewrites",
    "InlineOverloads",
)  # fmt: skip

# The pass that stores all that numba inferred of a function, to be looked at.
ANNOTATIONS = "AnnotateTypes"

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
            twice = typed_once(numba.njit(lambda x: 2.0 * x, **pipelines(False, True)))
            whole = numba.cfunc("f8(f8)", **pipelines(True, True))
            text = whole(lambda x: twice(x) + twice(1.0)).inspect_llvm()
        forget([twice])
        return text.count("\ndefine") >= 3  # the unit, its wrapper and what it calls
    except Exception:
        return False


def options(unit: bool, allocates: bool) -> dict[str, Any]:
    """Return options of numba.cfunc for the function that a unit begins with, else of numba.njit
    for those that are only linked into it."""
    if not is_on() or "compilers" in WITHOUT:
        return {}
    # Where nothing is allocated no references are counted, which would take most of the time.
    return {**pipelines(unit, not allocates), **({} if allocates else {"_nrt": False})}


def by_units() -> bool:
    """Return True if units are compiled by themselves: numba alone cannot load one before those
    that it calls."""
    return is_on() and "compilers" not in WITHOUT


@functools.cache
def pipelines(unit: bool, scalar: bool) -> dict[str, Any]:
    """Return the options that `options` gives; ``scalar``: the function makes no arrays."""
    from numba.core.codegen import JITCodeLibrary
    from numba.core.compiler import CompilerBase, DefaultPassBuilder
    from numba.core.compiler_machinery import register_pass
    from numba.core.typed_passes import NativeLowering

    class Codegen:
        """numba's code generator, but that it sets no Python objects in code that is not loaded."""

        def __init__(self, real):
            self.real = real

        def __getattr__(self, name):
            return getattr(self.real, name)

        def set_env(self, name, environment):
            """Do nothing."""

    class Library(JITCodeLibrary):
        """Code as it was lowered, neither optimised nor loaded."""

        @property
        def codegen(self):
            return Codegen(self._codegen)

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
            found = dict.fromkeys(self._linking_libraries)
            more = list(found)
            for each in more:  # grows
                new = dict.fromkeys(x for x in each._linking_libraries if x not in found)
                found |= new
                more += new
            for each in more:
                self._final_module.link_in(each._get_module_for_linking(), preserve=True)
            super().finalize()

    @register_pass(mutates_CFG=True, analysis_only=False)
    class Lowering(NativeLowering):
        """numba's last pass, into a library of ours."""

        _name = f"flocsim_lowering_{unit}_{scalar}"

        def run_pass(self, state):
            name = state.func_id.func_qualname
            state.library = (Unit if unit else Library)(state.targetctx.codegen(), name)
            return super().run_pass(state)

    class Compiler(CompilerBase):
        """numba's usual passes with another last one."""

        def define_pipelines(self):
            plain = scalar and not any(map(inspect.iscode, self.state.func_id.code.co_consts))
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
    return {"pipeline_class": Compiler, **unwrapped}


def typed_once(dispatcher: Any) -> Any:
    """Return the function, not compiled anew for every constant that it is called with."""
    from numba import types

    template = dispatcher.get_call_template

    def without_literals(arguments, keywords):
        plain = tuple(types.unliteral(each) for each in arguments)
        return template(plain, {name: types.unliteral(v) for name, v in keywords.items()})

    dispatcher.get_call_template = without_literals
    return dispatcher


def inner(dispatcher: Any) -> Any:
    """Return a function that is only linked into others, quicker to compile."""
    return typed_once(dispatcher) if is_on() and "typed_once" not in WITHOUT else dispatcher


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
    from numba.core import event
    from numba.core.base import BaseContext
    from numba.core.ir import Inst, Loc, Var
    from numba.core.types import Function

    listed_by_numba, plain = Inst._rec_list_vars, {str, int, float, bool, type(None), Loc}

    def listed(self, value):
        """List the variables of an instruction: most of a million values are none."""
        if type(value) is dict:
            value = value.values()
        elif type(value) not in (list, tuple):
            return [] if type(value) in plain else listed_by_numba(self, value)
        found = []
        for each in value:
            if type(each) is Var:
                found.append(each)
            elif type(each) not in plain:
                found += listed(self, each)
        return found

    # The types of every `+` and `sqrt`; sizes of LLVM's types, each asked for by parsing a text;
    # listeners of two events for every call of LLVM.
    typed = remembering(
        Function.get_call_type, lambda f, context, given, more: (id(f), given, *more.items())
    )
    sized = remembering(BaseContext.get_abi_sizeof, lambda context, kind: str(kind))
    others: tuple[tuple[Any, str, Any], ...] = (
        (Function, "get_call_type", typed), (BaseContext, "get_abi_sizeof", sized),
        (Inst, "_rec_list_vars", listed),
        (event, "start_event", lambda *_, **__: None), (event, "end_event", lambda *_, **__: None),
    )  # fmt: skip
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
    on = is_on() and "quick_typing" not in WITHOUT
    return replacements() if on else contextlib.nullcontext()
