"""A force's kernels tried once, uncompiled, so that a wrong one is named before it is compiled."""

import difflib
import functools
import inspect
import math
import traceback
import types
from collections.abc import Callable, Iterable, Iterator, Sequence
from numbers import Real
from typing import Any

import attrs
import numpy as np

from flocsim.arrays import BodyView, ContactView, OrientedView, OutlineView, PairView
from flocsim.body import Fluid
from flocsim.compiler.fingerprint import globals_read, tell
from flocsim.compiler.reads import names_in, refuse_closure, where
from flocsim.errors import KernelError
from flocsim.forces.base import BodyForce, ContactForce, Force, PairForce
from flocsim.forces.kernel_code import made_by, wrong_return

SAMPLE_BODIES = (
    BodyView(
        1e-3,
        2e-6,
        -3e-6,
        0.5,
        1e-4,
        -2e-4,
        3.0,
        2e-10,
        1e-10,
        2e-21,
        5e-6,
        0.6,
        0.3,
        10.0,
        -20.0,
        30.0,
    ),
    BodyView(
        0.0,
        -2e-6,
        3e-6,
        -0.5,
        -1e-4,
        2e-4,
        -3.0,
        2e-10,
        1e-10,
        2e-21,
        5e-6,
        0.0,
        0.0,
        -10.0,
        20.0,
        -30.0,
    ),
)
SAMPLE_CONTACTS = tuple(
    ContactView(1e-8, rate, slip, -1e5 * slip, 1e-10, 1e-6, 2e-6)
    for rate in (1e-4, -1e-4) for slip in (1e-9, -1e-9)
)  # fmt: skip
SAMPLE_GAPS = (-1e-9, 1e-10, 1e-7)
"""Gaps [m] of the sample pairs: in contact, nearly so, apart."""


def sample_pairs(reach: float) -> tuple[PairView, ...]:
    """PairViews with gaps of either sign, within the reach of the force [m]."""
    gaps = [min(gap, 0.5 * reach) for gap in SAMPLE_GAPS]
    return tuple(
        PairView(1e-3, gap, rate, gap + 3e-6, 1e-6, 2e-6, 2e-6 / 3.0, 1e-10)
        for gap in gaps for rate in (-1e-4, 1e-4)
    )  # fmt: skip


def sample_points(force: PairForce) -> tuple[OutlineView, ...]:
    """OutlineViews with gaps of either sign, within the reach of a force between outlines [m]."""
    gaps = [min(gap, 0.5 * reach_of(force)) for gap in SAMPLE_GAPS]
    return tuple(
        OutlineView(
            1e-3, gap, gap, max(gap, 1e-10), max(gap, 1e-10), 2e-6, 1e-6, 2e-6, 2e-6 / 3.0, 1e-10
        )
        for gap in gaps
    )


def sample_orientations(force: PairForce) -> tuple[OrientedView, ...]:
    """OrientedViews with gaps of either sign, within the reach of an oriented force [m]."""
    gaps = [min(gap, 0.5 * reach_of(force)) for gap in SAMPLE_GAPS]
    return tuple(
        OrientedView(1e-3, gap, gap + 3e-6, angle, 1.0 - 2.0 * angle, 1e-6, 2e-6, 2e-6 / 3.0, 1e-10)
        for gap in gaps for angle in (-2.0, 0.0, 1.0)
    )  # fmt: skip


def refusal(force, function, finding):
    """A KernelError that names the force, the kernel, and its file and line."""
    return KernelError(f"{type(force).__name__}: kernel {where(function)} {finding}")


def require_plain(force, kernel):
    """KernelError where a kernel is not a plain function that captures nothing."""
    name = type(force).__name__
    if inspect.ismethod(kernel):
        raise refusal(force, kernel, "is a method; put @staticmethod above it and drop `self`")
    if hasattr(kernel, "py_func"):
        raise refusal(force, kernel.py_func, "is compiled already; leave its @njit out")
    if not isinstance(kernel, types.FunctionType):
        raise KernelError(f"{name}: its kernel is {kernel!r}; write a function with `def`")
    if kernel.__name__ == "<lambda>":
        raise refusal(force, kernel, "is a lambda; write it with `def`")
    refuse_closure(kernel)
    if words := made_by(kernel):
        raise refusal(
            force, kernel, f"{words}: compiled kernels allocate nothing; write its numbers out"
        )
    if words := why_untold(kernel):
        raise KernelError(f"{name}: {words}")


@functools.lru_cache(maxsize=256)
def why_untold(kernel):
    """Why no hash could follow what a kernel reads, in words; "" where one can."""
    try:
        tell(kernel, {})
    except KernelError as error:
        return str(error)
    return ""


def parameter_value(force, fluid, name, kernel):
    """The force's own value of a parameter, else the fluid's; KernelError where neither has it."""
    for owner in (force, fluid):
        if hasattr(type(owner), name) or name in getattr(owner, "__dict__", ()):
            return computed(force, owner, name)
    known = ", ".join(f.name for f in attrs.fields(type(force))) or "it has none"
    lacking = f"no field or property of the force ({known}) or of the fluid"
    raise refusal(force, kernel, f"asks for {name!r}, which is {lacking}")


def computed(force, owner, name):
    """The value of an attribute; KernelError where its property fails."""
    try:
        return getattr(owner, name)
    except Exception as error:
        raise KernelError(
            f"{type(force).__name__}: its {name!r} cannot be computed ({failing_line(error)}: "
            f"{type(error).__name__}: {error})"
        ) from None


def as_numbers(value):
    """A number, or a tuple of numbers, as the compiled kernel will see it."""
    if isinstance(value, tuple):
        return tuple(as_numbers(each) for each in value)
    return float(value)


def kernel_arguments(force: Force, fluid: Fluid, kernel: Callable) -> list:
    """What a kernel is called with after its view; KernelError for what is no number."""
    arguments = []
    for name in list(inspect.signature(kernel).parameters)[1:]:
        value = parameter_value(force, fluid, name, kernel)
        try:
            arguments.append(as_numbers(value))
        except (TypeError, ValueError):
            raise refusal(
                force, kernel, f"asks for {name!r}, which is {value!r}; a kernel takes numbers only"
            ) from None
        # Rows could not be repeated: every pair of bodies asks anew.
        if repr(again := parameter_value(force, fluid, name, kernel)) != repr(value):
            raise refusal(
                force, kernel,
                f"asks for {name!r}, which is {value!r} once and {again!r} then; compute it from "
                "the force's fields alone",
            )  # fmt: skip
    return arguments


def failing_line(error):
    """ "file:line" of the innermost Python line that raised."""
    frame = traceback.extract_tb(error.__traceback__)[-1]
    return f"{frame.filename}:{frame.lineno}"


def is_arithmetic(error):
    """Whether the numbers are to blame, which the compiled code answers with inf or nan."""
    unpacking = "unpack" in str(error)
    return isinstance(error, ArithmeticError) or (isinstance(error, ValueError) and not unpacking)


def results(
    force: Force, kernel: Callable, samples: Iterable, arguments: Sequence
) -> Iterator[Any]:
    """What a kernel returns for the samples, those beyond its arithmetic left out."""
    for view in samples:
        try:
            result = kernel(view, *arguments)
        except Exception as error:
            if not is_arithmetic(error):
                raise refusal(force, kernel, failure(view, error)) from None
            continue
        refuse_complex(force, kernel, view, result)
        yield result


def failure(view, error):
    """What a kernel did wrong, in words, from the exception that it raised for a sample."""
    if isinstance(error, AttributeError) and error.obj is view:
        fields = type(view)._fields
        near = difflib.get_close_matches(error.name, fields, n=1)
        advice = f"did you mean {near[0]!r}?" if near else f"it has {', '.join(fields)}"
        lacks = f"{type(view).__name__} has no attribute {error.name!r}"
        return f"fails in {failing_line(error)}: {lacks}; {advice}"
    what = " ".join(f"{type(error).__name__}: {error}".split())
    return f"fails in {failing_line(error)}: {what}"


def asked_at(view: Any) -> str:
    """Where a force was asked, in words."""
    if hasattr(view, "gap"):
        return f"a gap of {view.gap:.3g} m"
    if hasattr(view, "overlap"):
        return f"an overlap of {view.overlap:.3g} m"
    return f"t = {view.time:.3g} s and an angle of {view.angle:.3g} rad"


def refuse_complex(force, kernel, view, result):
    """KernelError for complex numbers, which uncompiled code has where compiled code has nan."""
    for part in result if isinstance(result, tuple) else (result,):
        if isinstance(part, complex):
            raise refusal(
                force, kernel,
                f"gives no real number at {asked_at(view)}: what is below zero has no power with a "
                "fractional exponent; bound its base, as in max(x, 0.0)",
            )  # fmt: skip


def are_numbers(result):
    """Whether a result is a tuple of numbers."""
    return isinstance(result, tuple) and all(isinstance(part, Real) for part in result)


def check_results(force, fluid, kernel, samples, *parts):
    """KernelError unless a kernel can be called and returns the named parts, each a number."""
    require_plain(force, kernel)
    arguments = kernel_arguments(force, fluid, kernel)
    wanted = f"({', '.join(parts)})" if len(parts) > 1 else f"one number, the {parts[0]}"
    for result in results(force, kernel, samples, arguments):
        several = are_numbers(result) and len(result) == len(parts)
        if not (several if len(parts) > 1 else isinstance(result, Real)):
            raise refusal(force, kernel, f"returns {result!r}; it must return {wanted}")
    check_code(force, kernel, len(parts), wanted)


def check_code(force, kernel, parts, wanted):
    """KernelError for returns of other numbers in branches where no sample may come."""
    if words := wrong_return(kernel, parts):
        raise refusal(force, kernel, f"{words}; it must return {wanted}")


class Watched:
    """A view that notes which of its fields are read, by name, by index, or by unpacking."""

    def __init__(self, view):
        self.view, self.read = view, set()

    def __getattr__(self, name):
        self.read.add(name)
        return getattr(self.view, name)

    def __getitem__(self, index):
        self.read.update(np.atleast_1d(self.view._fields[index]).tolist())
        return self.view[index]


def fields_read(force: Force, fluid: Fluid, kernel: Callable, samples: Iterable) -> set[str]:
    """Names that a kernel reads of its view: those in its code and its helpers', and those that
    it is seen to read without a name."""
    names, pending, known = set(), [kernel], set()
    while pending:
        function = pending.pop()
        known.add(function)
        names |= names_in(function.__code__)
        called = [value for _, value in globals_read(function) if inspect.isfunction(value)]
        pending += [each for each in called if each not in known]
    watched = [Watched(view) for view in samples]
    for _ in results(force, kernel, watched, kernel_arguments(force, fluid, kernel)):
        pass
    return names.union(*(each.read for each in watched))


def reach_of(force: PairForce) -> float:
    """The force's reach; KernelError unless it is a number."""
    reach = computed(force, force, "reach")
    if not isinstance(reach, Real) or math.isnan(reach):
        raise KernelError(f"{type(force).__name__}: its reach is {reach!r}; it must be a gap [m]")
    return float(reach)


def check_pair_force(force, fluid):
    if force.acts_on == "outlines":
        check_results(force, fluid, force.kernel_in(fluid), sample_points(force), "pressure [Pa]")
        return
    if force.acts_on == "orientations":
        check_results(force, fluid, force.kernel, sample_orientations(force), "energy [J]")
        return
    samples = sample_pairs(reach_of(force))
    check_results(force, fluid, force.kernel, samples, "repulsion [N]")
    if force.slope is not None:
        check_results(force, fluid, force.slope, samples, "slope [N/m]")


def check_contact_force(force, fluid):
    check_results(force, fluid, force.kernel, SAMPLE_CONTACTS, "normal", "tangential")
    if force.slides:
        check_results(force, fluid, force.slip_limit, SAMPLE_CONTACTS, "largest slip [m]")
    if inspect.isfunction(getattr(force, "kink", None)):
        raise refusal(
            force, force.kink, "is called kink: name it events and return a tuple, one a kink"
        )
    if force.has_events:
        check_events(force, fluid)


def check_events(force, fluid):
    """KernelError unless the events of a contact force are a tuple of always as many numbers."""
    require_plain(force, force.events)
    arguments = kernel_arguments(force, fluid, force.events)
    found = list(results(force, force.events, SAMPLE_CONTACTS, arguments))
    for result in found:
        if not are_numbers(result) or len(result) != len(found[0]) or not result:
            raise refusal(
                force, force.events,
                f"returns {result!r}; it must return a tuple of numbers, always as many",
            )  # fmt: skip
    parts = len(found[0]) if found else None
    check_code(force, force.events, parts, "a tuple of numbers, always as many")


def event_count(force: ContactForce, fluid: Fluid) -> int:
    arguments = kernel_arguments(force, fluid, force.events)
    return len(next(results(force, force.events, SAMPLE_CONTACTS, arguments), ()))


def check_kernel(force: Force, fluid: Fluid) -> None:
    """KernelError, with force, file and line, unless all kernels of a force can be used.

    Each is called uncompiled on samples of the view that it will get, which finds misspelt
    attributes, unknown parameters, and results of the wrong kind.
    """
    if isinstance(force, BodyForce):
        kernel = force.kernel_in(fluid)
        check_results(force, fluid, kernel, SAMPLE_BODIES, "fx", "fy", "torque")
    elif isinstance(force, ContactForce):
        check_contact_force(force, fluid)
    elif isinstance(force, PairForce):
        check_pair_force(force, fluid)
