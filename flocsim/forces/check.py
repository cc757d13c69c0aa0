"""Trial calls of a force's kernels, uncompiled, to report errors before compilation.

A KernelError names the force, the kernel, and its file and line.
"""

import inspect
import math
import traceback
import types
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import product
from numbers import Real
from typing import Any

import attrs
import numpy as np

from flocsim.body import Fluid
from flocsim.compiler.fingerprint import describe
from flocsim.compiler.linker import names_in, reads, refuse_closure, where
from flocsim.errors import KernelError, closest
from flocsim.forces.base import ContactForce, Force, PairForce
from flocsim.state.views import BodyView, ContactView, OrientedView, OutlineView, PairView

# A body, and its reverse at time zero and without a long axis.
SAMPLE_BODIES = tuple(
    BodyView(
        1e-3 * later, 2e-6 * sign, -3e-6 * sign, 0.5 * sign, 1e-4 * sign, -2e-4 * sign, 3.0 * sign,
        2e-10, 1e-10, 2e-21, 5e-6, 0.6 * later, 0.3 * later, 10.0 * sign, -20.0 * sign, 30.0 * sign,
    )
    for sign, later in ((1.0, 1.0), (-1.0, 0.0))
)  # fmt: skip
SAMPLE_CONTACTS = tuple(
    ContactView(1e-8, rate, slip, -1e5 * slip, 1e-10, 1e-6, 2e-6, 1e-5)
    for rate in (1e-4, -1e-4) for slip in (1e-9, -1e-9)
)  # fmt: skip


SIZES = 1e-6, 2e-6, 2e-6 / 3.0, 1e-10
"""Sizes at the end of the sample views of pairs: radii, reduced radius [m], effective mass [kg]."""


def sample_gaps(reach):
    """Return gaps [m] in overlap, just touching, nearly so, and apart, within a reach."""
    # Half of the reach is well inside: no sample is beyond the end of a force.
    return [min(gap, 0.5 * reach) for gap in (-1e-9, -1e-12, 0.0, 1e-12, 1e-10, 1e-7)]


def sample_pairs(reach: float) -> tuple[PairView, ...]:
    """Return PairViews with gaps and gap rates of both signs, within the reach of a force [m]."""
    gaps, rates = sample_gaps(reach), (-1e-4, 1e-4)
    return tuple(
        PairView(1e-3, gap, rate, gap + 3e-6, *SIZES) for gap, rate in product(gaps, rates)
    )


def samples_of(force: Any) -> tuple:
    """Return sample views of the kind that a force's kernels receive."""
    if force.acts_on == "bodies":
        return SAMPLE_BODIES
    if force.acts_on == "contacts":
        return SAMPLE_CONTACTS
    reach = reach_of(force)
    if force.acts_on == "outlines":
        # Outlines count as d_min or more apart; 1e-10 m stands for it.
        gaps = [(gap, max(gap, 1e-10)) for gap in sample_gaps(reach)]
        return tuple(OutlineView(1e-3, gap, gap, apart, apart, 2e-6, *SIZES) for gap, apart in gaps)
    if force.acts_on == "orientations":
        turned = product(sample_gaps(reach), (-2.0, 0.0, 1.0))
        return tuple(
            OrientedView(1e-3, gap, gap + 3e-6, angle, 1.0 - 2.0 * angle, *SIZES)
            for gap, angle in turned
        )
    return sample_pairs(reach)


def kernel_error(force, function, finding):
    """Return a KernelError that names the force, the kernel, and its file and line."""
    return KernelError(f"{type(force).__name__}: kernel {where(function)} {finding}")


def require_plain(force, kernel):
    """Raise KernelError unless a kernel is a plain function that captures nothing."""
    name = type(force).__name__
    # Each mistake has its own message, which says what to write instead.
    if inspect.ismethod(kernel):
        raise kernel_error(force, kernel, "is a method; put @staticmethod above it and drop `self`")
    if hasattr(kernel, "py_func"):
        raise kernel_error(force, kernel.py_func, "is compiled already; leave its @njit out")
    if not isinstance(kernel, types.FunctionType):
        raise KernelError(f"{name}: its kernel is {kernel!r}; write a function with `def`")
    if kernel.__name__ == "<lambda>":
        raise kernel_error(force, kernel, "is a lambda; write it with `def`")
    refuse_closure(kernel)
    try:
        describe(kernel)
    except KernelError as error:
        raise KernelError(f"{name}: {error}") from None


def parameter_value(force, fluid, name, kernel):
    """Return the force's value of a parameter, else the fluid's; raise KernelError without
    either."""
    # The class is asked first: a property that fails raises its own error in `read_attribute`.
    for owner in (force, fluid):
        if hasattr(type(owner), name) or name in getattr(owner, "__dict__", ()):
            return read_attribute(force, owner, name)
    known = ", ".join(f.name for f in attrs.fields(type(force))) or "it has none"
    lacking = f"no field or property of the force ({known}) or of the fluid"
    raise kernel_error(force, kernel, f"asks for {name!r}, which is {lacking}")


def read_attribute(force, owner, name):
    """Return an attribute; raise KernelError if its property fails."""
    try:
        return getattr(owner, name)
    except Exception as error:
        raise KernelError(
            f"{type(force).__name__}: its {name!r} cannot be computed ({failing_line(error)}: "
            f"{type(error).__name__}: {error})"
        ) from None


def as_numbers(value):
    """Return a number, or a (named) tuple of numbers, as floats: the compiled kernel's view of
    it."""
    if isinstance(value, tuple):
        numbers = tuple(map(as_numbers, value))
        return type(value)(*numbers) if hasattr(value, "_fields") else numbers
    # Integers and bools, too: compiled laws read floats from one array.
    return float(value)


def kernel_arguments(force: Force, fluid: Fluid, kernel: Callable) -> list:
    """Return a kernel's arguments after the view; raise KernelError for any that is no number."""
    arguments = []
    for name in list(inspect.signature(kernel).parameters)[1:]:
        value = parameter_value(force, fluid, name, kernel)
        try:
            arguments.append(as_numbers(value))
        except (TypeError, ValueError):
            raise kernel_error(
                force, kernel, f"asks for {name!r}, which is {value!r}; a kernel takes numbers only"
            ) from None
        # Parameters are evaluated anew for every pair of bodies: one that changes from call to call
        # would make rows irreproducible.
        if repr(repeated := parameter_value(force, fluid, name, kernel)) != repr(value):
            raise kernel_error(
                force, kernel,
                f"asks for {name!r}, which is {value!r} once and {repeated!r} then; compute it "
                "from the force's fields alone",
            )  # fmt: skip
    return arguments


def failing_line(error):
    """Return "file:line" of the innermost Python line that raised."""
    frame = traceback.extract_tb(error.__traceback__)[-1]
    return f"{frame.filename}:{frame.lineno}"


def results(
    force: Force, kernel: Callable, samples: Iterable, arguments: Sequence
) -> Iterator[Any]:
    """Yield the results of a kernel for the samples.

    Samples with an ArithmeticError are skipped: compiled code returns inf or nan there.
    """
    for view in samples:
        try:
            result = kernel(view, *arguments)
        except ArithmeticError:
            continue
        except Exception as error:
            # math.sqrt(−1) and the like: compiled code returns nan. A failed unpacking is a
            # mistake, though.
            if isinstance(error, ValueError) and "unpack" not in str(error):
                continue
            raise kernel_error(force, kernel, describe_failure(view, error)) from None
        parts = result if isinstance(result, tuple) else (result,)
        # Python turns a negative base with a fractional exponent into a complex number; numba does
        # not.
        if any(isinstance(part, complex) for part in parts):
            raise kernel_error(
                force, kernel,
                f"gives no real number at {describe_sample(view)}: what is below zero has no power "
                "with a fractional exponent; bound its base, as in max(x, 0.0)",
            )  # fmt: skip
        yield result


def describe_failure(view, error):
    """Describe the exception that a kernel raised for a sample."""
    if isinstance(error, AttributeError) and error.obj is view:
        fields = type(view)._fields
        near = closest(error.name, fields)
        advice = f"did you mean {near!r}?" if near else f"it has {', '.join(fields)}"
        lacks = f"{type(view).__name__} has no attribute {error.name!r}"
        return f"fails in {failing_line(error)}: {lacks}; {advice}"
    description = " ".join(f"{type(error).__name__}: {error}".split())
    return f"fails in {failing_line(error)}: {description}"


def describe_sample(view: Any) -> str:
    """Describe the sample at which a kernel was called."""
    if hasattr(view, "gap"):
        return f"a gap of {view.gap:.3g} m"
    if hasattr(view, "overlap"):
        return f"an overlap of {view.overlap:.3g} m"
    return f"t = {view.time:.3g} s and an angle of {view.angle:.3g} rad"


def check_results(force, fluid, kernel, *parts):
    """Raise KernelError unless a kernel returns the named parts, each a number.

    Without names it must return a tuple of numbers, always of the same length.
    """
    require_plain(force, kernel)
    arguments, count = kernel_arguments(force, fluid, kernel), len(parts) or None
    wanted = f"({', '.join(parts)})" if parts else "a tuple of numbers, always as many"
    if len(parts) == 1:
        wanted = f"one number, the {parts[0]}"
    for result in results(force, kernel, samples_of(force), arguments):
        found = (result,) if len(parts) == 1 else result
        numbers = isinstance(found, tuple) and all(isinstance(part, Real) for part in found)
        # Without given names the first sample sets the number of results.
        count = count or (len(found) if numbers else None)
        if not numbers or not found or len(found) != count:
            raise kernel_error(force, kernel, f"returns {result!r}; it must return {wanted}")


class RecordingView:
    """A view that records the fields read from it, by name, by index, or by unpacking."""

    def __init__(self, view):
        self.view, self.read = view, set()

    def __getattr__(self, name):
        self.read.add(name)
        return getattr(self.view, name)

    def __getitem__(self, index):
        # Fields may be read by position, or by a slice.
        self.read.update(np.atleast_1d(self.view._fields[index]).tolist())
        return self.view[index]


def fields_read(force: Force, fluid: Fluid, kernel: Callable) -> set[str]:
    """Return the names of the fields that a kernel reads.

    They are the names in its code and in its helpers' code, and those observed in trial calls
    (fields read by index or by unpacking have no name in the code).
    """
    names, pending, known = set(), [kernel], set()
    # Walk the helpers reachable through globals; ``known`` guards against recursion.
    while pending:
        function = pending.pop()
        known.add(function)
        names |= names_in(function.__code__)
        called = [value for value in reads(function).values() if inspect.isfunction(value)]
        pending += [each for each in called if each not in known]
    watched = [RecordingView(view) for view in samples_of(force)]
    for _ in results(force, kernel, watched, kernel_arguments(force, fluid, kernel)):
        pass
    return names.union(*(each.read for each in watched))


def reach_of(force: PairForce) -> float:
    """Return the reach of a force; raise KernelError unless it is a number."""
    reach = read_attribute(force, force, "reach")
    if not isinstance(reach, Real) or math.isnan(reach):
        raise KernelError(f"{type(force).__name__}: its reach is {reach!r}; it must be a gap [m]")
    return float(reach)


def event_count(force: ContactForce, fluid: Fluid) -> int:
    arguments = kernel_arguments(force, fluid, force.events)
    return len(next(results(force, force.events, SAMPLE_CONTACTS, arguments), ()))


RESULTS = {
    "bodies": ("fx", "fy", "torque"), "contacts": ("normal", "tangential"),
    "centres": ("repulsion [N]",), "surfaces": ("repulsion [N]",),
    "outlines": ("pressure [Pa]",), "orientations": ("energy [J]",),
}  # fmt: skip
"""{where a force acts: what its kernel returns}."""


def check_kernel(force: Any, fluid: Fluid) -> None:
    """Raise KernelError unless all kernels of a force are usable.

    Each is called uncompiled on sample views, which finds misspelt attributes, unknown parameters,
    and results of the wrong kind.
    """
    check_results(force, fluid, force.kernel_in(fluid), *RESULTS[force.acts_on])
    if force.acts_on in ("centres", "surfaces") and force.slope is not None:
        check_results(force, fluid, force.slope, "slope [N/m]")
    elif force.acts_on == "contacts":
        if force.slides:
            check_results(force, fluid, force.slip_limit, "largest slip [m]")
        if force.has_events:
            check_results(force, fluid, force.events)
