"""Which code a scene has: a line for every force, and for every piece of machinery.

The lines are read off the force objects and off the slots that the composer really fills, so that
they cannot disagree with what is compiled.

Which functions the driver of a scene reaches: the report says what is really compiled.
"""

import math
import types
from itertools import combinations

from flocsim import hooks as slots
from flocsim.fingerprint import reached
from flocsim.forces.base import BodyForce, ContactForce, PairForce
from flocsim.forces.check import (
    SAMPLE_BODIES,
    SAMPLE_CONTACTS,
    fields_read,
    kernel_arguments,
    results,
    sample_pairs,
)
from flocsim.integrators.loop.driver import advance
from flocsim.integrators.overdamped import Overdamped
from flocsim.integrators.rhs.jacobian import assemble_jacobian


def functions_of(system):
    """All plain functions that the system's driver reaches, its slots filled."""
    fillings, found, pending = system.fillings(), set(), [advance]
    while pending:
        function = pending.pop()
        function = fillings.get(function, function)
        if function not in found:
            found.add(function)
            values = reached(function).values()
            pending += [value for value in values if isinstance(value, types.FunctionType)]
    return found


def differentiates(system):
    """Whether the method needs the Jacobian of the forces."""
    return assemble_jacobian in functions_of(system)


PLACES = {"x", "y", "angle", "time"}
SPEEDS = {"vx", "vy", "spin"}


def force_lines(system):
    """ "in: …" or "out: …" for every force object, two of one class each by itself."""
    implicit = differentiates(system)
    lines = [
        f"in:  {force}: {'; '.join(about(system, force, implicit))}"
        for force in system.forces
        if not force.absent
    ]
    lines += [
        f"out: {type(force).__name__}: {force.absent}" for force in system.forces if force.absent
    ]
    return lines or ["out: forces: none is given, bodies fly free"]


def about(system, force, implicit):
    """Where a force acts and, for an implicit method, whence its derivatives come."""
    if isinstance(force, BodyForce):
        parts, derivative = ["on every body"], body_derivative(system, force)
    elif len(system.bodies) == 1:
        return ["never called, a single body has no partner"]
    elif isinstance(force, ContactForce):
        parts = ["at every overlapping pair", sliding(system, force)]
        derivative = "derivatives from differences of its kernel"
    else:
        parts, derivative = [pair_place(system, force)], pair_derivative(system, force)
    return [*parts, derivative] if implicit else parts


def body_derivative(system, force):
    """By what a body force has to be differentiated."""
    reads = fields_read(force, system.fluid, force.kernel_in(system.fluid), SAMPLE_BODIES)
    by = [name for name, fields in (("velocity", SPEEDS), ("place", PLACES)) if reads & fields]
    if not by:
        return "constant, nothing to differentiate"
    return f"derivative by {' and '.join(by)} from differences of its kernel"


def pair_place(system, force):
    """Where a pair force acts, and how far."""
    place = "along the line of centres" if force.acts_on == "centres" else "at the closest points"
    return f"{place}, {reach_words(system, force)}"


def pair_derivative(system, force):
    """Whence the derivatives of a pair force come."""
    samples = sample_pairs(force.reach)
    damped = "gap_rate" in fields_read(force, system.fluid, force.kernel, samples)
    slope = "from differences of its kernel" if force.slope is None else "analytic"
    rate = ", by the gap's rate from differences" if damped else ""
    return f"derivative by the gap {slope}{rate}"


def reach_words(system, force):
    """How far a pair force reaches, and whether it does so at the start."""
    if not force.reach < math.inf:
        return "at every gap"
    words = f"not called at gaps from {force.reach:.3g} m on"
    nearest = least_gap(system.bodies, force)
    if nearest >= force.reach:
        words += f" (out of range at the start, where gaps are at least {nearest:.3g} m)"
    return words


def least_gap(bodies, force):
    """The least gap [m] at the start: of equivalent spheres, or of bounding circles."""
    size = "equivalent_radius" if force.acts_on == "centres" else "bounding_radius"
    return min((gap_between(a, b, size) for a, b in combinations(bodies, 2)), default=math.inf)


def gap_between(a, b, size):
    """Distance of two bodies' circles of the given size [m]."""
    distance = math.dist(a.position, b.position)
    return distance - getattr(a.shape, size) - getattr(b.shape, size)


def sliding(system, force):
    """Whether the tangential displacement of a contact force has a limit."""
    if force.slip_limit is None:
        return "no sliding"
    limits = tried(system, force, force.slip_limit, SAMPLE_CONTACTS)
    return "slides at its limit" if min(limits) < math.inf else "no sliding, its limit is infinite"


def machinery_lines(system):
    """ "in: …" or "out: …" for every piece of machinery around the forces."""
    filled = system.fillings()
    touching = slots.has_contact in filled or slots.surface_force in filled
    lines = [search_line(system, touching)]
    if system.spheres_only:
        lines.append("out: vertex-edge pairs, rotation of vertices: no body has an edge")
    lines += [spin_line(system), history_line(system)]
    lines += [f"out: {what}: {why}" for slot, what, why in UNFILLED if slot not in filled]
    return lines + derivative_lines(system, filled) + inertia_lines(system)


def derivative_lines(system, filled):
    """Which derivatives an implicit method does not need, or that an explicit one needs none."""
    if not differentiates(system):
        return ["out: Jacobian of the forces: the method is explicit"]
    return [f"out: {what}: {why}" for slot, what, why in UNDERIVED if slot not in filled]


def inertia_lines(system):
    """Whether the method moves bodies that have no inertia."""
    if not isinstance(system.integrator, Overdamped):
        return []
    return ["out: inertia: the method balances forces and drag at every instant"]


def plain_run_lines(system):
    """What System.run adds to that, or does not."""
    return [
        "in:  recording: every accepted step; run(record=False) keeps start and end only",
        "out: events and observer: a plain run awaits none; an ensemble puts its own",
    ]


UNFILLED = (
    (slots.centre_force, "forces along lines of centres", "none is given"),
    (slots.surface_force, "forces at closest points", "none is given, no closest pair is sought"),
    (slots.slip_limit, "sliding", "no contact force limits its slip"),
    (slots.kink, "search for kinks of the contact law", "it has none with these parameters"),
)
"""(slot, what is left out where a scene does not fill it, why)."""

UNDERIVED = (
    (slots.position_force, "derivative by the place", "no body force reads a place or the time"),
    (slots.velocity_force, "derivative by the velocity", "no body force reads a velocity"),
)
"""The same for the derivatives that an implicit method would take."""


def search_line(system, touching):
    """Whether contacts are looked for, and how long they are not."""
    if not touching:
        return "out: contact search: no force acts at contacts or closest points"
    far = [gap_between(a, b, "bounding_radius") for a, b in combinations(system.bodies, 2)]
    if not far:
        return "out: contact search: a single body has no partner"
    words = "in:  contact search, left out for every two bodies whose bounding circles are apart"
    return f"{words} (at the start {sum(gap > 0.0 for gap in far)} of {len(far)} pairs)"


def spin_line(system):
    """Whether anything can turn the bodies."""
    turning = [type(force).__name__ for force in system.forces if exerts_torque(system, force)]
    if turning:
        return f"in:  rotation of bodies: torques come from {', '.join(dict.fromkeys(turning))}"
    if system.spheres_only:
        return "idle: rotation of spheres: no force exerts a torque, spins stay as they are"
    return "in:  rotation of bodies: no force exerts a torque, but outlines turn with their spin"


def history_line(system):
    """Whether tangential displacements are carried, and matter."""
    forces = [force for force in system.forces if isinstance(force, ContactForce)]
    if not forces:
        return "out: tangential history: no contact force"
    if any(holds_slip(system, force) for force in forces):
        return "in:  tangential history: displacements are kept while a contact lasts"
    return "idle: tangential history: no tangential stiffness, displacements carry no force"


def exerts_torque(system, force):
    """Whether a force may turn a body: by its own torque, or by a lever."""
    if force.absent:
        return False
    if isinstance(force, BodyForce):
        kernel = force.kernel_in(system.fluid)
        return any(result[2] != 0.0 for result in tried(system, force, kernel, SAMPLE_BODIES))
    if len(system.bodies) == 1:
        return False
    if isinstance(force, PairForce):
        return force.acts_on == "surfaces" and not system.spheres_only
    sideways = tried(system, force, force.kernel, SAMPLE_CONTACTS)
    return not system.spheres_only or any(result[1] != 0.0 for result in sideways)


def holds_slip(system, force):
    """Whether a contact force's tangential part depends on the tangential displacement."""
    views = [SAMPLE_CONTACTS[0]._replace(slip_rate=0.0, slip=slip) for slip in (1e-9, -1e-9)]
    one, other = tried(system, force, force.kernel, views)
    return one[1] != other[1]


def tried(system, force, kernel, views):
    """What a kernel, uncompiled, returns for some views."""
    arguments = kernel_arguments(force, system.fluid, kernel)
    return list(results(force, kernel, views, arguments))
