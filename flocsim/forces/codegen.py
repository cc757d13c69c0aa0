"""From force objects to the scene's own functions: generated source that calls their kernels.

The text is short and has no numbers in it: a force's values travel in one flat array, so that new
values never recompile. What a scene does not need (absent forces, forces out of reach,
derivatives of what no kernel reads) is not written.
"""

import math

import attrs

from flocsim import hooks as slots
from flocsim.arrays import PairView
from flocsim.errors import UsageError
from flocsim.forces.base import BodyForce, ContactForce, Force, PairForce
from flocsim.forces.check import (
    SAMPLE_BODIES,
    check_kernel,
    fields_read,
    kernel_arguments,
    reach_of,
    sample_pairs,
)

VELOCITIES = {"vx", "vy", "spin"}
PLACES = {"x", "y", "angle", "time"}


@attrs.define
class Pieces:
    """What the scene is made of: functions for the slots, the numbers, and what was left out."""

    fillings: dict = attrs.Factory(dict)
    parameters: list = attrs.Factory(list)
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


def constant_function(name, arguments, value):
    """Source of a function that returns a literal."""
    return f"def {name}({arguments}):\n    return {value}\n"


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
    text = [sum_function(name, "body", some, 3) for name, some in terms.items() if some]
    for name in ("velocity", "position"):
        text.append(constant_function(f"reads_{name}", "", bool(terms[f"{name}_force"])))
    return text


def pair_text(pieces, namespace, forces, fluid, kind):
    """Source of the centre forces or of the surface forces, with slope and damping."""
    force_terms, slope_terms, damping_terms = [], [], []
    reaches = []
    for force in forces:
        reach = append_value(pieces.parameters, reach_of(force))
        reaches.append(reach)
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
    text = [sum_function(f"{kind}_force", "pair", force_terms, 1)]
    text.append(sum_function(f"{kind}_slope", "pair", slope_terms, 1))
    if damping_terms:
        text.append(sum_function(f"{kind}_damping", "pair", damping_terms, 1))
    if kind == "surface":
        largest = f"max({', '.join(reaches)})" if len(reaches) > 1 else reaches[0]
        text.append(constant_function("surface_reach", "parameters", largest))
    else:
        text.append(constant_function("has_centre_force", "", True))
    return text


def contact_text(pieces, namespace, forces, fluid):
    """Source of the contact forces, the limit of their tangential displacement, and their kinks."""
    terms, limits, kinks = [], [], []
    for force in forces:
        _, call = call_text(pieces, namespace, force, fluid, force.kernel, "contact")
        terms.append(("", call))
        if force.slip_limit is not None:
            _, limit = call_text(pieces, namespace, force, fluid, force.slip_limit, "contact")
            limits.append(limit)
        if force.has_kink:
            _, kink = call_text(pieces, namespace, force, fluid, force.kink, "contact")
            kinks.append(kink)
    text = [sum_function("contact_force", "contact", terms, 2)]
    if limits:
        least = f"min({', '.join(limits)})" if len(limits) > 1 else limits[0]
        text.append(constant_function("slip_limit", "contact, parameters", least))
    if kinks:
        text.append(constant_function("kink", "contact, parameters", " * ".join(kinks)))
    text.append(constant_function("has_contact", "", True))
    return text


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


def scene_functions(forces, fluid):
    """Pieces of the scene with these forces in this fluid."""
    pieces = Pieces()
    kinds = sort_forces(pieces, forces, fluid)
    namespace = {"PairView": PairView, "max": max, "min": min, "abs": abs, "math": math}
    text = body_text(pieces, namespace, kinds["body"], fluid)
    for kind in ("centre", "surface"):
        if kinds[kind]:
            text += pair_text(pieces, namespace, kinds[kind], fluid, kind)
    if kinds["contact"]:
        text += contact_text(pieces, namespace, kinds["contact"], fluid)
    before = set(namespace)
    exec(compile("\n\n".join(text), "<scene>", "exec"), namespace)
    made = set(namespace) - before - {"__builtins__"}
    pieces.fillings = {getattr(slots, name): namespace[name] for name in made}
    return pieces
