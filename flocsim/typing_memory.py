"""While numba compiles a scene, it remembers what it inferred, and Python's garbage waits.

numba asks anew for the type of every ``+`` and ``sqrt``, trying dozens of templates each time,
though a scene of two hundred functions has some hundred different cases. And it makes millions of
objects that live until it is done, which the garbage collector walks through again and again.
Together they are a fifth of the time that a scene takes to compile.

The memory ends with the compilation: it can't outlive the options that it was made under. Where
numba's insides are not what they were, nothing is remembered.
"""

import contextlib
import gc
import threading

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
