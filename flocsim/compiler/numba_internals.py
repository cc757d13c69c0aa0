"""All that flocsim knows of numba's private parts; tests/test_numba_internals.py fails if it errs.

1. ``NO_COUNTING``: kernels that allocate nothing need no counting of references, which costs more
   than most of their work.
2. ``call_by_address``: one compiled function calls another by its address, as numba's own code
   does. numba's first-class functions do the same, but every one that is handed to a compiled
   function costs 70 µs there; a run would be handed ten, and a replicate takes 2 ms.
3. ``compilers``: of an engine's five hundred functions Python calls one. The others are kept as
   they are lowered, and are linked and optimised once, with it, as a program of one file is.
4. ``typed_once``: a function is not compiled anew for every constant that it is called with.
5. ``quick_typing``: while numba compiles, it remembers what it inferred, garbage waits, nobody is
   told of every call of LLVM, and variables are listed by a shorter way; what it says about an
   error is without colours.
6. ``object_code``: what numba makes is taken as an object file, which runs without numba, and may
   be for another processor than the one that numba compiles for.
7. ``refuse_extensions``: what the user has taught numba (@overload and its kin) is found, since no
   hash of a kernel could tell it.

Measured: benchmarks/speed/compile_times.py --without NAME leaves one of 3 to 5 out.
"""

import builtins
import contextlib
import ctypes
import functools
import gc
import inspect
import operator
import os
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

from flocsim.compiler.by_pointer import address_of_data, is_array
from flocsim.compiler.disk_cache import LENT, ObjectCode
from flocsim.compiler.linker import PACKAGE, is_in_library, names_in, where
from flocsim.compiler.processor import BASELINE, baseline
from flocsim.errors import KernelError

WITHOUT = os.environ.get("FLOCSIM_COMPILE_WITHOUT", "").split(",")
"""Names of what to leave out, to measure what it gains."""

NO_COUNTING = {"_nrt": False}
"""Options of numba.njit for functions that allocate nothing."""

PYTHON_CALLS = ("numba_gil_ensure", "__excinfo_unwrap_args")
"""How the names begin of what compiled code has in it where it calls Python, or raises an exception
with numbers in it. Functions that are only linked into others have nothing to do that with."""

COLOURED = ("code", "errmsg", "filename", "highlight", "indicate", "reset")
"""What numba colours in its messages, where colorama is installed."""

MANY = 50
"""Functions that take more than a second and leave some ten MB behind: less garbage waits."""

_one_at_a_time = threading.RLock()


def call_by_address(signature: Any) -> Callable:
    """A function for compiled code: ``call(address, *arguments)`` of a function of a signature.

    The arguments must have just the types of the signature, but that an array is handed to a
    pointer: the seven words that make an array do not fit into registers.
    """
    from numba import types
    from numba.core.errors import TypingError

    def generate(context, builder, typed, values):
        values = [
            address_of_data(context, builder, given, value)
            for given, value in zip(typed.args, values, strict=True)
        ]
        returned, given = signature.return_type, signature.args
        kind = context.call_conv.get_function_type(returned, given)
        function = builder.inttoptr(values[0], kind.as_pointer())
        return call_within(context, builder, function, returned, given, values[1:])

    def as_handed(given):
        return types.CPointer(given.dtype) if is_array(given) else given

    def typed_call(address, *given):
        if tuple(map(as_handed, given)) != signature.args:
            raise TypingError(f"a law takes {signature.args}, found {given}")
        return signature.return_type(address, *given), generate

    return intrinsic_of(
        ("address", *(f"given_{k}" for k in range(len(signature.args)))), typed_call
    )


def call_of_unit(names: tuple[str, ...], unit_for: Callable[[tuple[Any, ...]], Any]) -> Callable:
    """A function for compiled code, of arguments of such names: it calls the unit for which
    ``unit_for(numba types)`` gives (symbol, what it returns), by that symbol."""
    from numba import types
    from numba.core import cgutils

    def typed_call(*given):
        given = tuple(map(types.unliteral, given))
        symbol, returned = unit_for(given)
        kind = type_returned(returned)

        def generate(context, builder, typed, values):
            called = context.call_conv.get_function_type(kind, given)
            function = cgutils.get_or_insert_function(builder.module, called, symbol)
            return call_within(context, builder, function, kind, given, values)

        return kind(*given), generate

    return intrinsic_of(names, typed_call)


def call_within(context, builder, function, kind, given, values):
    """LLVM's call of a function that numba has made; what is raised there is raised here."""
    from numba.core import cgutils

    convention = context.call_conv
    status, result = convention.call_function(builder, function, kind, given, values)
    with cgutils.if_unlikely(builder, status.is_error):
        convention.return_status_propagate(builder, status)
    return result


def intrinsic_of(names, typed_call):
    """numba's intrinsic of arguments of such names: it has as many as its function."""
    from numba.extending import intrinsic

    taken = ", ".join(names)
    known: dict[str, Any] = {"typed_call": typed_call}
    exec(f"def call(typing, {taken}):\n    return typed_call({taken})\n", known)
    return intrinsic(known["call"])


UNWRAPPED: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
"""Options of functions that neither Python nor C calls by numba's wrappers, which take time."""


def letters() -> dict[str, Any]:
    """{letter of struct.unpack: numba type} of what compiled functions return."""
    from numba import types

    return {
        "": types.none, "?": types.boolean, "d": types.float64, "q": types.int64,
        "Q": types.uint64, "f": types.float32, "i": types.int32,
    }  # fmt: skip


def returned_as(kind: Any) -> str:
    """What a numba type that is returned looks like, for struct.unpack; KernelError for what is
    neither a number nor a flat tuple of numbers."""
    from numba import types

    if isinstance(kind, types.BaseTuple):
        parts: Any = kind
        return "".join(map(returned_as, parts))
    for letter, known in letters().items():
        if types.unliteral(kind) == known:
            return letter
    raise KernelError(f"a compiled function returns {kind}: let it return numbers")


def type_returned(told: str) -> Any:
    """The numba type of numbers that are returned, told as ``returned_as`` does."""
    from numba import types

    known = letters()
    return known[told] if len(told) < 2 else types.Tuple.from_types([known[each] for each in told])


def object_code(function: Any, signature: Any, options: dict) -> tuple[ObjectCode, list[str], bool]:
    """The machine code of a function of a signature, the symbols that it lacks, and whether another
    process can use it: not where it holds addresses of this one."""
    import numba
    from numba.core.compiler_lock import global_compiler_lock

    dispatcher: Any = numba.njit(function, **options)
    dispatcher.typingctx.refresh()  # has to hear of new intrinsics
    dispatcher.targetctx.refresh()
    dispatcher.compile(signature)
    [result] = dispatcher.overloads.values()
    library = result.library
    with global_compiler_lock:
        library._ensure_finalized()
    machine = getattr(library, "machine", library._codegen._tm)  # numba's own have none
    declared = [each.name for each in library._final_module.functions if each.is_declaration]
    found = ObjectCode(
        machine.emit_object(library._final_module), result.fndesc.llvm_func_name,
        returned_as(result.signature.return_type),
        any(name.encode().startswith(LENT) for name in declared),
    )  # fmt: skip
    return found, declared, not library.has_dynamic_globals


@functools.cache
def baseline_machine() -> Any:
    """The target machine of the baseline, otherwise as numba's."""
    import llvmlite.binding as llvm
    import numba

    config: Any = numba.config
    target = llvm.Target.from_triple(llvm.get_process_triple())
    return target.create_target_machine(
        cpu=BASELINE, features="", opt=config.OPT, reloc="static", codemodel="jitdefault", jit=True
    )


class NoEnvironment:
    """A numba code generator that sets no environment of a function, for there is nowhere to."""

    def __init__(self, generator):
        self.generator = generator

    def __getattr__(self, name):
        return getattr(self.generator, name)

    def set_env(self, name, environment):
        """Nothing: what Python objects a function needs, its caller in machine code has."""


def libraries():
    """(LinkedLibrary, WholeLibrary, LoopLibrary): numba libraries of functions that are only linked
    into others, of one that is run, with all that it reaches, and of one that is mostly loops."""
    from numba.core.codegen import JITCodeLibrary

    class UnloadedLibrary(JITCodeLibrary):
        """Code that numba does not load."""

        @property
        def codegen(self):
            return NoEnvironment(self._codegen)

        def get_pointer_to_function(self, name):
            """None: there is no machine code of it in this process."""
            return 0

    class LinkedLibrary(UnloadedLibrary):
        """Code as it was lowered: neither optimised, linked nor made machine code of."""

        def _optimize_functions(self, module):
            """Left to the library that this one is linked into."""
            module.data_layout = self._codegen._data_layout

        def finalize(self):
            """Only what linking needs."""
            self._raise_if_finalized()
            self._finalize_dynamic_globals()
            self._finalized = True

    def reached(library, found):
        """All libraries that one is linked to, through others, too."""
        for each in library._linking_libraries:
            if each not in found:
                found[each] = None
                reached(each, found)
        return found

    class WholeLibrary(UnloadedLibrary):
        """Everything that a function reaches, linked and optimised once, as an object file."""

        loops = False

        @property
        def machine(self):
            """What LLVM knows of the processor that the code is for."""
            return self._codegen._tm if self.loops or not baseline() else baseline_machine()

        def finalize(self):
            """Link and optimise."""
            self._linking_libraries = list(reached(self, {}))
            self.own = {each.name for each in self._final_module.functions}
            super().finalize()
            self._linking_libraries = []

        def _optimize_final_module(self):
            """Nothing but its own functions is called from outside: LLVM may then do what it likes
            with the others, as with a C program of one file."""
            module = self._final_module
            for each in module.functions:
                if not (each.is_declaration or each.name in self.own):
                    each.linkage = "internal"
            with replaced(self._codegen, _tm=self.machine):
                passes, builder = self._codegen._module_pass_manager(
                    loop_vectorize=self.loops, slp_vectorize=self.loops
                )
            passes.run(module, builder)

        def _finalize_final_module(self):
            """Ready for an object file: it cannot be loaded before the units that it calls are."""
            self._finalize_dynamic_globals()
            self._verify_declare_only_symbols()
            self._finalized = True

    class LoopLibrary(WholeLibrary):
        """The same, loops taken several turns at a time: a tenth more to compile, were it all."""

        loops = True

    return LinkedLibrary, WholeLibrary, LoopLibrary


NEEDLESS_PASSES = (
    "InlineClosureLikes", "MakeFunctionToJitFunction", "InlineInlinables",
    "FindLiterallyCalls", "LiteralUnroll", "LiteralPropagationSubPipelinePass", "NopythonRewrites",
    "InlineOverloads",
)  # fmt: skip
"""Passes of numba's that find nothing in functions on scalars that define no others inside."""

ANNOTATIONS = "AnnotateTypes"
"""The pass that keeps all that numba thought of a function, to be looked at."""


@functools.cache
def compilers() -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
    """{option: value} of numba.njit for functions that are only linked into others, for one that is
    run, and for one that is mostly loops."""
    if "compilers" in WITHOUT:
        return {}, {}, {}
    from numba.core.compiler import CompilerBase, DefaultPassBuilder
    from numba.core.compiler_machinery import register_pass
    from numba.core.errors import UnsupportedError
    from numba.core.typed_passes import NativeLowering

    linked, whole, loops = libraries()

    def lowering(library_class):
        @register_pass(mutates_CFG=True, analysis_only=False)
        class Lowering(NativeLowering):
            """numba's last pass, into a library of ours."""

            _name = f"flocsim_{library_class.__name__}"

            def run_pass(self, state):
                name = state.func_id.func_qualname
                state.library = library_class(state.targetctx.codegen(), name)
                changed = super().run_pass(state)
                made = state.library._final_module.functions
                # Whether it takes the interpreter's lock, or makes Python objects.
                if library_class is linked and any(
                    each.name.startswith(PYTHON_CALLS) for each in made
                ):
                    raise UnsupportedError(
                        "it calls Python while it runs, or raises an exception with numbers in it",
                        state.func_ir.loc,
                    )
                return changed

        class Compiler(CompilerBase):
            """numba's usual passes with another last one."""

            def define_pipelines(self):
                code = self.state.func_id.code
                # It allocates no arrays and defines no other function inside.
                is_plain = not self.state.flags.nrt and not any(
                    hasattr(each, "co_code") for each in code.co_consts
                )
                passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
                passes.passes = [
                    (Lowering if each is NativeLowering else each, what)
                    for each, what in passes.passes
                    if each.__name__ != ANNOTATIONS
                    and not (each.__name__ in NEEDLESS_PASSES and is_plain)
                ]
                passes.finalize()
                return [passes]

        return {"pipeline_class": Compiler}

    return lowering(linked), lowering(whole), lowering(loops)


def typed_once(dispatcher: Any) -> Any:
    """The function, not compiled anew for every constant that it is called with."""
    from numba import types

    if "typed_once" in WITHOUT:
        return dispatcher
    template = dispatcher.get_call_template

    def without_literals(arguments, keywords):
        plain = tuple(types.unliteral(each) for each in arguments)
        return template(plain, {name: types.unliteral(v) for name, v in keywords.items()})

    dispatcher.get_call_template = without_literals
    return dispatcher


def forget(dispatchers: Sequence[Any]) -> None:
    """Give back what numba keeps of functions that have been linked into another one, and, of many,
    what C's library keeps of the memory that they took."""
    for each in dispatchers:
        for result in each.overloads.values():
            each.targetctx.remove_user_function(result.entry_point)
        each.overloads.clear()
    if len(dispatchers) > MANY:
        gc.collect()
        with contextlib.suppress(OSError, AttributeError):  # glibc's alone has that
            ctypes.CDLL(None).malloc_trim(0)


@contextlib.contextmanager
def garbage_waits():
    """No garbage collection inside, unless it was off before: numba makes millions of objects that
    live until it is done, through which the collector walks again and again."""
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
def replaced(owner: Any, **others: Any) -> Iterator[None]:
    """Attributes of a class or module are others inside."""
    own = {name: vars(owner)[name] for name in others if name in vars(owner)}
    for name, value in others.items():
        setattr(owner, name, value)
    try:
        yield
    finally:
        for name in others:
            if name in own:
                setattr(owner, name, own[name])
            else:
                delattr(owner, name)


def types_remembered() -> Any:
    """numba's built-in functions remember their types inside: it asks anew for the type of every
    ``+`` and ``sqrt``, though an engine of two hundred functions has some hundred different cases.
    The memory ends with the compilation: it can't outlive the options that it was made under."""
    from numba.core.types import Function

    return replaced(Function, get_call_type=remembering(Function.get_call_type))


def sizes_remembered() -> Any:
    """The sizes of LLVM's types are remembered inside: LLVM is asked for one by parsing a text."""
    from numba.core.base import BaseContext

    real, known = BaseContext.get_abi_sizeof, dict[str, int]()

    def remembered(self, kind):
        found = known.get(text := str(kind))
        if found is None:
            found = known[text] = real(self, kind)
        return found

    return replaced(BaseContext, get_abi_sizeof=remembered)


def unheard() -> Any:
    """numba tells nobody of its events inside: there are two for every call of LLVM, and functions
    that are compiled within others each have listeners of their own, which measure times."""
    from numba.core import event

    def nothing(*arguments, **more):
        """Nobody is told."""

    return replaced(event, start_event=nothing, end_event=nothing)


def variables_listed() -> Any:
    """numba lists the variables of an instruction by a shorter way inside: it does so a million
    times, and most of what it looks at are no variables."""
    from numba.core.ir import Inst, Loc, Var

    real, plain = Inst._rec_list_vars, {str, int, float, bool, type(None), Loc}

    def listed(self, value):
        if type(value) is dict:
            value = value.values()
        elif type(value) not in (list, tuple):
            return [] if type(value) in plain else real(self, value)
        found = []
        for each in value:
            if type(each) is Var:
                found.append(each)
            elif type(each) not in plain:
                found += listed(self, each)
        return found

    return replaced(Inst, _rec_list_vars=listed)


@contextlib.contextmanager
def quick_typing() -> Iterator[None]:
    """Compile in here, one thread at a time, as numba does."""
    with _one_at_a_time, plain_errors():
        if "quick_typing" in WITHOUT:
            yield
            return
        with garbage_waits(), types_remembered(), sizes_remembered(), unheard(), variables_listed():
            yield


@contextlib.contextmanager
def plain_errors() -> Iterator[None]:
    """No colours in numba's messages: with colorama it also wraps the standard streams, until the
    end of the process."""
    from numba.core.errors import termcolor

    # The class, since numba's modules each hold its one instance.
    scheme = type(termcolor())
    with replaced(scheme, **dict.fromkeys(COLOURED, lambda self, text: text)):
        yield


@functools.cache
def is_installed(file: str) -> bool:
    """Whether a file is numba's, another installed package's or flocsim's, and not the user's."""
    import numba

    # numba may be installed anywhere: a cluster's modules set PYTHONPATH.
    known = (PACKAGE, os.path.dirname(numba.__file__) + os.sep, "<")
    return is_in_library(file) or file.startswith(known) or "-packages" in file


def is_users(function: Any) -> bool:
    """Whether something is a function of the user's."""
    return inspect.isfunction(function) and not is_installed(function.__code__.co_filename)


@functools.lru_cache(maxsize=1)
def taught(sizes: tuple[int, ...]) -> list[tuple[Any, str, Any]]:
    """(key, attribute or "", function) of all that the user has taught numba.

    ``sizes`` of numba's lists, which only grow, tell whether there is anything new.
    """
    from numba.core.imputils import builtin_registry as lowering
    from numba.core.typing.templates import builtin_registry as typing

    found = [
        (getattr(template, "key", None), getattr(template, "_attr", ""), function)
        for template in (*typing.functions, *typing.attributes)
        for each in vars(template).values()
        if is_users(function := getattr(each, "__func__", each))
    ]
    for function, key, _ in (*lowering.functions, *lowering.getattrs):
        if is_users(behind := inspect.unwrap(function)):
            found.append((key, key if isinstance(key, str) else "", behind))
    return found


def refuse_extensions(functions: Iterable[Any], values: Iterable[Any]) -> None:
    """KernelError where numba was taught what these functions may use.

    ``values``: what they read beside functions. What a function of the user's own is taught for
    (@overload of it, @register_jitable) does not matter: such a function is compiled as it stands.
    """
    if "numba" not in sys.modules:
        return
    from numba.core.imputils import builtin_registry as lowering
    from numba.core.typing.templates import builtin_registry as typing

    lists = (typing.functions, typing.attributes, lowering.functions, lowering.getattrs)
    extensions = taught(tuple(map(len, lists)))
    if not extensions:
        return
    names = set().union(*(names_in(each.__code__) for each in functions))
    used = [*values, *(getattr(builtins, name, None) for name in names)]
    operators = set(map(id, vars(operator).values()))
    for key, attribute, function in extensions:
        if inspect.isfunction(key):
            continue
        if attribute in names or id(key) in operators or any(key is each for each in used):
            what = attribute or getattr(key, "__name__", key)
            raise KernelError(
                f"{where(function)} teaches numba another {what!r}, which the kernels use and no "
                "hash follows; call a plain function of another name"
            )
