"""The time scales of a scene, from its forces' own kernels: how stiff it is.

Stiffness and damping are slopes of the uncompiled kernels by differences, so that a user's own
force counts like the built-in ones. A scale is a name, a time [s], and whether it stands in the
way of explicit steps (decay and vibration do; falling by a radius does not).
"""

import math
from itertools import combinations
from typing import NamedTuple

import numpy as np

from flocsim import hooks as slots
from flocsim.arrays import BodyView, ContactView, PairView

STIFF = 100.0
"""A scale this much shorter than the slowest one is stiff."""

OVERLAP_SHARE = 1e-3
"""Contact stiffness is taken at this share of r_i + r_j, for laws that are not linear."""

GAPS = 10.0 ** np.linspace(-10.0, -5.0, 101)
"""Gaps [m] searched for the steepest pair force."""

STABLE = 2.0
"""Velocity Verlet is stable below 2/ω of a vibration, an explicit step below 2 τ of a decay."""


class Scale(NamedTuple):
    """A time scale [s] of the scene."""

    name: str
    time: float
    limits_steps: bool


def scale_lines(system):
    """The lines of the report: scales, how many are stiff, what an explicit method would need."""
    scales = [scale for scale in all_scales(system) if 0.0 < scale.time < math.inf]
    if not scales:
        return ["time scales: none, nothing pulls back or slows down"]
    slowest = max(scale.time for scale in scales)
    stiff = sum(slowest > STIFF * scale.time for scale in scales)
    words = ", ".join(f"{scale.name} {scale.time:.2g} s" for scale in scales)
    head = f"time scales: {words}; {stiff} of {len(scales)} stiff (over 100 x below the slowest)"
    return [head, *explicit_line(scales, slowest)]


def explicit_line(scales, slowest):
    """What an explicit method would need."""
    limits = [scale.time for scale in scales if scale.limits_steps]
    if not limits:
        return []
    step = STABLE * min(limits)
    return [
        f"an explicit method: unstable from steps of about {step:.2g} s on, "
        f"{slowest / step:.2g} steps for the slowest scale"
    ]


def all_scales(system):
    """Contact, pair forces, drag and settling, the shortest over the bodies or pairs."""
    return [*contact_scales(system), *pair_scales(system), *body_scales(system)]


def pairs_of(system):
    """(bodies a, b, M of the pair) for every two bodies of which one is free."""
    for a, b in combinations(system.bodies, 2):
        inverse = sum(1.0 / body.mass for body in (a, b) if not body.fixed)
        if inverse > 0.0:
            yield a, b, 1.0 / inverse


def slope_of(force, view, field, size, parameters, part=None):
    """Central difference of a scene's force by one field of its view."""
    value = getattr(view, field)
    ends = [force(view._replace(**{field: value + by}), parameters) for by in (size, -size)]
    if part is not None:
        ends = [end[part] for end in ends]
    return (ends[0] - ends[1]) / (2.0 * size)


def contact_scales(system):
    """1/ω0 = √(M/k) of a contact and 1/λ of its damping, the shortest over the pairs."""
    force = system.pieces.fillings.get(slots.contact_force)
    found = [contact_pair(force, system, *pair) for pair in pairs_of(system)] if force else []
    if not found:
        return []
    vibration, decay = (min(times) for times in zip(*found, strict=True))
    return [
        Scale("contact 1/omega0", vibration, True),
        Scale("contact damping 1/lambda", decay, True),
    ]


def contact_pair(force, system, a, b, mass):
    """(1/ω0, 1/λ) [s] of one pair's normal contact; inf where there is none."""
    radii = a.shape.radius, b.shape.radius
    overlap = OVERLAP_SHARE * sum(radii)
    view = ContactView(overlap, 0.0, 0.0, 0.0, mass, *radii)
    known = system.pieces.parameters
    stiffness = slope_of(force, view, "overlap", 1e-3 * overlap, known, 0)
    damping = slope_of(force, view, "overlap_rate", 1e-9, known, 0)
    return vibration_time(mass, stiffness), decay_time(mass, damping)


def vibration_time(mass, stiffness):
    """√(M/|k|) [s]; inf without stiffness."""
    return math.sqrt(mass / abs(stiffness)) if stiffness != 0.0 else math.inf


def decay_time(mass, damping):
    """M/c [s]; inf without damping."""
    return mass / damping if damping > 0.0 else math.inf


def pair_scales(system):
    """√(M/|dF/dd|) where centre or surface forces are steepest, the shortest over the pairs."""
    pieces = system.pieces.fillings
    found = []
    for name in ("centre", "surface"):
        force = pieces.get(getattr(slots, f"{name}_force"))
        times = [steepest(force, system, *pair) for pair in pairs_of(system)] if force else []
        found += [Scale(f"{name} forces at their steepest", min(times), True)] if times else []
    return found


def steepest(force, system, a, b, mass):
    """√(M/|dF/dd|) [s] of one pair at the gap where the force changes most."""
    r_a, r_b = a.shape.equivalent_radius, b.shape.equivalent_radius
    view = PairView(0.0, 0.0, 0.0, r_a + r_b, r_a, r_b, r_a * r_b / (r_a + r_b), mass)
    known = system.pieces.parameters
    slopes = [
        abs(slope_of(force, view._replace(gap=gap), "gap", 1e-3 * gap, known)) for gap in GAPS
    ]
    return vibration_time(mass, max(slopes))


def body_scales(system):
    """Stokes relaxation m/(6πγ r) and the time of settling by a radius, of the free bodies."""
    force = system.pieces.fillings.get(slots.body_force)
    free = [body for body in system.bodies if not body.fixed]
    if force is None or not free:
        return []
    times = [body_times(force, system, body) for body in free]
    relaxation, settling = zip(*times, strict=True)
    return [
        Scale("Stokes relaxation", min(relaxation), True),
        Scale("settling by a radius", max(settling), False),
    ]


def body_times(force, system, body):
    """(relaxation, settling by a radius) [s] of one body that starts from rest; inf without."""
    radius = body.shape.equivalent_radius
    weight = body.buoyant_mass(system.fluid)
    view = BodyView(
        0.0, *body.position, body.angle, 0.0, 0.0, 0.0, body.mass, weight, body.inertia, radius
    )
    known = system.pieces.parameters
    resistance = -slope_of(force, view, "vy", 1e-9, known, 1)
    load = math.hypot(*force(view, known)[:2])
    settling = radius * resistance / load if load > 0.0 and resistance > 0.0 else math.inf
    return decay_time(body.mass, resistance), settling
