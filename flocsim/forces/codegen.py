"""From force objects to the scene's laws: generated source that adds up their kernels.

The text is short and has no numbers in it: a force's values travel in one flat array, so that new
values never recompile. What a scene does not need (absent forces, forces out of reach,
derivatives of what no kernel reads) is not written, and is no law of the scene.
"""

import functools
import math

import attrs

from flocsim.arrays import PairView
from flocsim.errors import UsageError
from flocsim.forces.base import BodyForce, ContactForce, Force, PairForce
from flocsim.forces.check import (
    SAMPLE_BODIES,
    check_kernel,
    event_count,
    fields_read,
    kernel_arguments,
    reach_of,
    sample_pairs,
)
from flocsim.laws import LAWS

VELOCITIES = {"vx", "vy", "spin"}
PLACES = {"x", "y", "angle", "time"}


@attrs.define
class Pieces:
    """What forces make of a scene: its laws {name of flocsim.laws.LAWS: plain function}, their
    numbers, the gap up to which surface forces reach (−1: there are none), how many events its
    contact forces have, and which forces are used and left out."""

    laws: dict = attrs.Factory(dict)
    parameters: list = attrs.Factory(list)
    surface_reach: float = -1.0
    events: int = 0
    used: dict = attrs.Factory(dict)
    left_out: dict = attrs.Factory(dict)


def append_value(parameters, value):
    """Append a number or a tuple of numbers; the source text that reads it back."""
    if isinstance(value, tuple):
        return "(" + "".join(append_value(parameters, each) + ", " for each in value) + ")"
    parameters.append(value)
    return f"parameters[{len(parameters) - 1}]"


def call_text(pieces, namespace, force, fluid, kernel, view):
    """Source of a call of the kernel with its parameters read from the array."""
    name = f"{type(force).__name__}_{kernel.__name__}_{len(namespace)}"
    namespace[name] = kernel
    arguments = kernel_arguments(force, fluid, kernel)
    values = [append_value(pieces.parameters, value) for value in arguments]
    return name, f"{name}({', '.join([view, *values])})"


def sum_function(name, view, terms, zeros):
    """Source of a function that adds up the given terms (tuples of as many parts as zeros)."""
    lines = [f"def {name}({view}, parameters):"]
    totals = [f"total_{k}" for k in range(zeros)]
    parts = [f"part_{k}" for k in range(zeros)]
    lines += [f"    {total} = 0.0" for total in totals]
    for condition, term in terms:
        indent = "    "
        if condition:
            lines.append(f"    if {condition}:")
            indent = "        "
        lines.append(f"{indent}{', '.join(parts)} = {term}")
        lines += [f"{indent}{t} += {p}" for t, p in zip(totals, parts, strict=True)]
    lines.append(f"    return {', '.join(totals)}")
    return "\n".join(lines) + "\n"


def difference_text(call, name, field, size):
    """Source of a central difference of a pair kernel by one field of its view."""
    index = PairView._fields.index(field)
    shifted = []
    for sign in "+-":
        fields = [f"pair.{each}" for each in PairView._fields]
        fields[index] = f"pair.{field} {sign} {size}"
        shifted.append(call.replace("(pair", f"(PairView({', '.join(fields)})", 1))
    return f"({shifted[0]} - {shifted[1]}) / (2.0 * {size})"


def body_text(pieces, namespace, forces, fluid):
    """Source of the body forces and of the parts that the implicit integrators differentiate."""
    terms = {"body_force": [], "velocity_force": [], "position_force": []}
    for force in forces:
        kernel = force.kernel_in(fluid)
        _, call = call_text(pieces, namespace, force, fluid, kernel, "body")
        reads = fields_read(force, fluid, kernel, SAMPLE_BODIES)
        terms["body_force"].append(("", call))
        if reads & VELOCITIES:
            terms["velocity_force"].append(("", call))
        if reads & PLACES:
            terms["position_force"].append(("", call))
    return [sum_function(name, "body", some, 3) for name, some in terms.items() if some]


def pair_text(pieces, namespace, forces, fluid, kind):
    """Source of the centre forces or of the surface forces, and of their derivatives."""
    force_terms, slope_terms, damping_terms = [], [], []
    for force in forces:
        reach = append_value(pieces.parameters, reach_of(force))
        condition = f"pair.gap < {reach}"
        name, call = call_text(pieces, namespace, force, fluid, force.kernel, "pair")
        force_terms.append((condition, call))
        if force.slope is None:
            size = "(1e-4 * abs(pair.gap) + 1e-13)"
            slope_terms.append((condition, difference_text(call, name, "gap", size)))
        else:
            _, slope = call_text(pieces, namespace, force, fluid, force.slope, "pair")
            slope_terms.append((condition, slope))
        samples = sample_pairs(reach_of(force))
        if "gap_rate" in fields_read(force, fluid, force.kernel, samples):
            size = "(1e-3 * abs(pair.gap_rate) + 1e-9)"
            change = difference_text(call, name, "gap_rate", size)
            damping_terms.append((condition, f"-({change})"))
    return [
        sum_function(f"{kind}_force", "pair", force_terms, 1),
        sum_function(f"{kind}_slope", "pair", slope_terms, 1),
        sum_function(f"{kind}_damping", "pair", damping_terms, 1),
        f"def {kind}_derivatives(pair, parameters):\n"
        f"    return {kind}_slope(pair, parameters), {kind}_damping(pair, parameters)\n",
    ]


def contact_text(pieces, namespace, forces, fluid):
    """Source of the contact forces, the limit of their tangential displacement, their events."""
    terms, limits, events = [], [], []
    for force in forces:
        _, call = call_text(pieces, namespace, force, fluid, force.kernel, "contact")
        terms.append(("", call))
        if force.slip_limit is not None:
            _, limit = call_text(pieces, namespace, force, fluid, force.slip_limit, "contact")
            limits.append(limit)
        if force.has_events:
            _, call = call_text(pieces, namespace, force, fluid, force.events, "contact")
            events.append((event_count(force, fluid), call))
    text = [sum_function("contact_force", "contact", terms, 2)]
    if limits:
        least = f"min({', '.join(limits)})" if len(limits) > 1 else limits[0]
        text.append(f"def slip_limit(contact, parameters):\n    return {least}\n")
    if events:
        text.append(event_text(events))
    pieces.events = sum(count for count, _ in events)
    return text


def event_text(events):
    """Source of the function that gives the event of a number, those of all forces in a row."""
    lines, first = ["def contact_event(contact, parameters, which):"], 0
    for count, call in events:
        for each in range(count):
            lines += [f"    if which == {first + each}:", f"        return {call}[{each}]"]
        first += count
    return "\n".join([*lines, "    return 1.0"]) + "\n"


def sort_forces(pieces, forces, fluid):
    """Forces by kind, absent ones noted as left out.

    UsageError for what is no force, KernelError for a force whose kernel cannot be used.
    """
    kinds = {"body": [], "centre": [], "surface": [], "contact": []}
    for force in forces:
        if not isinstance(force, Force):
            raise UsageError(f"a force must be a flocsim Force object, found {force!r}")
        name = type(force).__name__
        if force.absent:
            pieces.left_out[name] = force.absent
            continue
        check_kernel(force, fluid)
        pieces.used[name] = force
        if isinstance(force, BodyForce):
            kinds["body"].append(force)
        elif isinstance(force, ContactForce):
            kinds["contact"].append(force)
        elif isinstance(force, PairForce):
            kinds["centre" if force.acts_on == "centres" else "surface"].append(force)
        else:
            raise UsageError(
                f"{name} must subclass BodyForce, CentreForce, SurfaceForce or ContactForce"
            )
    return kinds


def laws_of(forces, fluid):
    """The Pieces of a scene with these forces in this fluid."""
    pieces = Pieces()
    kinds = sort_forces(pieces, forces, fluid)
    namespace = {}
    text = body_text(pieces, namespace, kinds["body"], fluid)
    for kind in ("centre", "surface"):
        if kinds[kind]:
            text += pair_text(pieces, namespace, kinds[kind], fluid, kind)
    if kinds["contact"]:
        text += contact_text(pieces, namespace, kinds["contact"], fluid)
    if kinds["surface"]:
        pieces.surface_reach = max(map(reach_of, kinds["surface"]))
    pieces.laws = made_laws("\n\n".join(text), tuple(namespace.items()))
    return pieces


@functools.lru_cache(maxsize=256)
def made_laws(text, kernels):
    """{law: function} of a source text; the same functions for the same text and kernels."""
    namespace = {"PairView": PairView, "max": max, "min": min, "abs": abs, "math": math}
    namespace |= dict(kernels)
    exec(compile(text, "<scene>", "exec"), namespace)
    return {name: namespace[name] for name in LAWS if name in namespace}
