"""What a scene is made of: which forces act and where, which do not and why; and how stiff it is.

The lines on forces are read off the force objects that the engine is given. Time scales are slopes
of the uncompiled kernels by differences, so that a user's own force counts like the built-in ones.
"""

import collections
import math
from itertools import combinations
from typing import Any

import numpy as np

from flocsim.errors import plural
from flocsim.forces import check
from flocsim.forces.base import BodyForce, ContactForce, force_names
from flocsim.forces.outline import charge_layer
from flocsim.forces.pair_resistance import PairResistance
from flocsim.forces.settling import lone_view
from flocsim.plausibility import all_settled, plausibility_warnings, settled
from flocsim.state.views import ContactView, PairView

STIFF = 100.0
"""A scale this much shorter than the slowest one is stiff."""

OVERLAP_SHARE = 1e-3
"""Contact stiffness is taken at this share of r_i + r_j, for laws that are not linear."""

GAPS = 10.0 ** np.linspace(-10.0, -5.0, 101)
"""Gaps [m] searched for the steepest pair force."""

RELAXATION, SETTLING = "Stokes relaxation", "settling by a radius"
"""Time scales of bodies; the second is the one that limits no step."""

STABLE = 2.0
"""Velocity Verlet is stable below 2/ω of a vibration, an explicit step below 2 τ of a decay."""


def explain(system: Any) -> str:
    """Return the report of System.explain() as text: forces, settling, time scales, and what is
    implausible."""
    return "\n".join(
        [
            heading(system),
            *force_lines(system),
            *(f"settling: a body of {each.words}" for each in all_settled(system) if each.speed),
            *scale_lines(system),
            *(f"warning: {line}" for line in plausibility_warnings([system])),
        ]
    )


def heading(system):
    bodies = system.bodies
    sizes = sorted({len(body.shape.vertices) for body in bodies})
    kind = "spheres only" if system.spheres_only else "polygons"

    points = " to ".join(map(str, sizes[:: max(len(sizes) - 1, 1)]))
    fixed = sum(body.fixed for body in bodies)
    held = f", {fixed} of them fixed" if fixed else ""
    count = f"{plural(len(bodies), 'body', 'bodies')}, {kind} (core points: {points}){held}"
    return f"{count}; method {system.integrator}"


def force_lines(system):
    """Return "in: …" or "out: …" for every force object, two of one class each by itself."""
    named = [*zip(force_names(system.forces), system.forces, strict=True)]
    lines = [
        f"in:  {force}: {'; '.join(about(system, force))}" for _, force in named if not force.absent
    ]
    lines += [f"out: {name}: {force.absent}" for name, force in named if force.absent]
    return lines or ["out: forces: none are given, so bodies move freely"]


def about(system, force):
    """Return where a force acts, in a few words each."""
    if isinstance(force, BodyForce):
        parts = ["on every body"]
    elif not counting(system.bodies):
        return [f"never called, {no_partner(system)}"]
    elif isinstance(force, PairResistance):
        parts = [f"between the two, up to {force.cut:g} (r_i + r_j) apart"]
    elif isinstance(force, ContactForce):
        parts = ["at every overlapping pair", sliding(system, force)]
    else:
        centres, reach = force.acts_on == "centres", force.reach
        place = "along the line of centres" if centres else "between the outlines"
        if force.acts_on == "orientations":
            place = "depends on the distance of the centres and the angles of both bodies"
        elif force.acts_on == "outlines":
            place = "integrated along the outlines"
            shapes = [body.shape for body in system.bodies]
            if charge_layer([force], shapes) is not None:
                place += ", between charges inside them, as the layer is thicker than the corners"
                if force.boundary == "superposition":
                    reach = system.pieces.layer[2]
        far = f"not called at gaps above {reach:.3g} m" if reach < math.inf else "at every gap"
        parts = [f"{place}, {far}"]
    return [*parts, *force.remarks(system.fluid)]


def no_partner(system):
    """Return why no two bodies act on each other."""
    if len(system.bodies) == 1:
        return "a single body has no partner"
    return "fixed bodies do not act on each other"


def counting(bodies):
    """Return every two bodies that can act on each other: one of them is free."""
    return [(a, b) for a, b in combinations(bodies, 2) if not (a.fixed and b.fixed)]


def sliding(system, force):
    if force.slip_limit is None:
        return "no sliding"
    limits = tried(system, force, force.slip_limit, check.SAMPLE_CONTACTS)
    return "slides at its limit" if min(limits) < math.inf else "no sliding: infinite friction"


def tried(system, force, kernel, views):
    """Return the results of an uncompiled kernel for some views."""
    arguments = check.kernel_arguments(force, system.fluid, kernel)
    return list(check.results(force, kernel, views, arguments))


def scale_lines(system):
    """Return lines on time scales, how many are stiff, and the step of an explicit method."""
    scales = {name: time for name, time in all_scales(system).items() if 0.0 < time < math.inf}
    if not scales:
        return ["time scales: none, because no force restores or damps the motion"]
    slowest = max(scales.values())
    stiff = sum(slowest > STIFF * time for time in scales.values())
    words = ", ".join(f"{name} {time:.2g} s" for name, time in scales.items())
    most = "over 100 times shorter than the slowest"
    head = f"time scales: {words}; {stiff} of {len(scales)} stiff ({most})"
    limits = [time for name, time in scales.items() if name != SETTLING]
    if not limits:
        return [head]
    step = STABLE * min(limits)
    return [
        head,
        f"an explicit method would be unstable with steps above about {step:.2g} s: "
        f"{slowest / step:.2g} steps for the slowest scale",
    ]


def pairs_of(system):
    """Yield (a, b, reduced mass M) of every two bodies of which one is free."""
    for a, b in counting(system.bodies):
        yield a, b, 1.0 / sum(1.0 / body.mass for body in (a, b) if not body.fixed)


def all_scales(system):
    """Return {name: time [s]}, the shortest over the pairs, and those of the bodies.

    1/ω0 = √(M/k) of a contact and 1/λ of its damping, √(M/|dF/dd|) where centre or surface forces
    are steepest.
    """
    laws, known = system.pieces.laws, system.pieces.parameters
    found = collections.defaultdict(list)
    for a, b, mass in pairs_of(system):
        if force := laws.get("contact_force"):
            radii = a.shape.radius, b.shape.radius
            overlap = OVERLAP_SHARE * sum(radii)
            smaller = min(a.shape.equivalent_radius, b.shape.equivalent_radius)
            view = ContactView(overlap, 0.0, 0.0, 0.0, mass, *radii, smaller)
            stiffness = slope_of(force, view, "overlap", 1e-3 * overlap, known, 0)
            damping = slope_of(force, view, "overlap_rate", 1e-9, known, 0)
            found["contact 1/omega0"].append(vibration_time(mass, stiffness))
            found["contact damping 1/lambda"].append(decay_time(mass, damping))
        r_a, r_b = a.shape.equivalent_radius, b.shape.equivalent_radius
        view = PairView(0.0, 0.0, 0.0, r_a + r_b, r_a, r_b, r_a * r_b / (r_a + r_b), mass)
        for name in ("centre", "surface"):
            if force := laws.get(f"{name}_force"):
                views = (view._replace(gap=gap) for gap in GAPS)
                slopes = [slope_of(force, each, "gap", 1e-3 * each.gap, known) for each in views]
                steepest = vibration_time(mass, max(map(abs, slopes)))
                found[f"{name} forces at their steepest"].append(steepest)
    return {name: min(times) for name, times in found.items()} | body_scales(system)


def body_scales(system):
    """Return the same of the free bodies.

    Stokes relaxation m/(6πγ r), at rest, the shortest, and settling by a radius, the longest.
    """
    force, known = system.pieces.laws.get("body_force"), system.pieces.parameters
    free = [body for body in system.bodies if not body.fixed]
    if force is None or not free:
        return {}
    relaxation, settling = [], []
    for body in free:
        view = lone_view(system, body)._replace(x=body.position[0], y=body.position[1])
        resistance = -slope_of(force, view, "vy", 1e-9, known, 1)
        relaxation.append(decay_time(body.mass, resistance))
        alone, radius = settled(system, body), body.shape.equivalent_radius
        settling.append(radius / alone.speed if alone and alone.speed > 0.0 else math.inf)
    return {RELAXATION: min(relaxation), SETTLING: max(settling)}


def slope_of(force, view, field, size, parameters, part=None):
    """Return the central difference of a scene's force by one field of its view."""
    value = getattr(view, field)
    ends = [force(view._replace(**{field: value + by}), parameters) for by in (size, -size)]
    if part is not None:
        ends = [end[part] for end in ends]
    return (ends[0] - ends[1]) / (2.0 * size)


def vibration_time(mass, stiffness):
    """Return √(M/|k|) [s]; inf without stiffness."""
    return math.sqrt(mass / abs(stiffness)) if stiffness != 0.0 else math.inf


def decay_time(mass, damping):
    """Return M/c [s]; inf without damping."""
    return mass / damping if damping > 0.0 else math.inf
