"""What the equivalent spheres of a study would do, by integrals: settle, touch, coagulate.

Of a brownian study: how often they would touch, and how much their interaction slows down their
coagulation. In the plane, of two spheres released at a distance r, ln(b/r)/ln(b/(r_i + r_j)) touch
before they are b apart, without forces between them. The stability ratio W is that of three
dimensions. Of settling and flows, by paths in three dimensions without inertia: the share of the
rectilinear kernel that touches, with the water that they push at each other, and without
(flocsim.hydrodynamics). The effect of shape is the difference from these.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from flocsim.brownian import repulsion, splitting_probability, stability_ratio
from flocsim.constants import MINIMUM_GAP
from flocsim.ensembles.collision.encounter import Encounter
from flocsim.ensembles.collision.equivalent import sphere_pairs
from flocsim.ensembles.collision.flocs import Floc
from flocsim.ensembles.collision.mechanisms import Brownian
from flocsim.ensembles.config.pair_scene import BROWNIAN, SETTLING
from flocsim.ensembles.config.schema import Config
from flocsim.errors import UsageError
from flocsim.forces import VanDerWaals
from flocsim.forces.body_forces import thermal_forces
from flocsim.forces.drag import solid_radius
from flocsim.hydrodynamics import Meeting, SpherePair
from flocsim.plausibility import settled


def settling_facts(config: Config, flocs: Sequence[Floc] | None = None) -> list[dict]:
    """Return [{type, body, radius [m], speed [m/s], reynolds, stokes}] of every free sphere.

    It is the same at every N: a floc settles as the sphere of its area. Of measured sizes the
    largest. None where bodies meet by thermal motion alone, without their weight.
    """
    return [
        {"type": name, "body": letter, **found._asdict()}
        for name, pair in sphere_pairs(config, flocs, "largest")
        if pair.meeting != BROWNIAN
        for letter, body in zip("ij", pair.system.bodies, strict=True)
        if (found := settled(pair.system, body)) is not None
    ]


def sphere_facts(config: Config, flocs: Sequence[Floc] | None = None) -> list[dict]:
    """Return [{type, release, escape [m], diffusion [m²/s], free, touch, stability}] of a brownian
    study, [] of others.

    ``free`` and ``touch``: probabilities to touch without and with the forces between the spheres;
    None for what is not a number, as for a potential beyond all bounds.
    """
    facts = []
    for name, pair in sphere_pairs(config, flocs):
        if not isinstance(pair, Brownian):
            continue
        forces, ends = pair.system.forces, pair.ends
        radius_i, radius_j = (shape.equivalent_radius for shape in pair.shapes)
        radii = radius_i, radius_j
        [thermal] = thermal_forces(forces)
        known: dict[str, Any] = {"temperature": thermal.temperature, "fluid": pair.system.fluid}
        with np.errstate(all="ignore"):
            found = {
                "free": splitting_probability([], radii, *ends, **known),
                "touch": splitting_probability(forces, radii, *ends, **known),
                "stability": stability_ratio(forces, radii, **known),
            }
        plain = {each: value if math.isfinite(value) else None for each, value in found.items()}
        about = {"type": name, "release": ends[0], "escape": ends[1], "diffusion": pair.diffusion}
        facts.append(about | plain)
    return facts


def water_facts(config: Config) -> list[dict]:
    """Return [{type, water, alone}] of the types that settling or a flow brings together.

    The share of the rectilinear kernel of their equivalent spheres that touches, with the water
    that they push at each other, and without. UsageError for what the resistance functions do not
    reach.
    """
    found = []
    for name, pair in sphere_pairs(config):
        if pair.meeting == BROWNIAN:
            continue
        try:
            shares = {"water": share_in(pair, True), "alone": share_in(pair, False)}
        except UsageError as error:
            raise UsageError(f"{name}: {error}") from error
        found.append({"type": name, **shares})
    return found


def share_in(pair: Encounter, water: bool) -> float:
    """Return the share of one pair, with the water between the two or without."""
    system = pair.system
    if words := unknown_in_water(pair):
        raise UsageError(f"the collision efficiency of spheres in water cannot be computed {words}")
    first, second = (shape.equivalent_radius for shape in pair.shapes)
    # Of flocs that water passes through the solid spheres that resist as much.
    inner = solid_radius(first, system.forces), solid_radius(second, system.forces)
    spheres = SpherePair(inner, system.fluid.viscosity)
    passed = first + second - sum(inner)
    force = repulsion(system.forces, (first, second), system.fluid)
    cuts = [each.d_min for each in system.forces if isinstance(each, VanDerWaals)]
    meeting = Meeting(spheres, force, min(cuts, default=MINIMUM_GAP), water, passed)
    if pair.rate is not None:
        return meeting.in_flow(pair.meeting, pair.rate)
    # The weights of spheres that settle alone, by Stokes's law, as fast as these do.
    speeds = [-float(velocity[1]) for velocity, _ in pair.settling]
    drag = 6.0 * math.pi * system.fluid.viscosity
    return meeting.settling((drag * inner[0] * speeds[0], drag * inner[1] * speeds[1]))


def unknown_in_water(pair: Encounter) -> str:
    """Return why the effect of water on two spheres is not known; "" where it is."""
    if thermal_forces(pair.system.forces):
        return "with thermal kicks: leave [forces.thermal] out"
    if any(body.fixed for body in pair.system.bodies):
        return "with a fixed receiver: choose scene.receiver = 'free'"
    if pair.meeting == SETTLING and any(pair.system.fluid.flow):
        return "when they settle in a flow: leave fluid.velocity and fluid.gradient out"
    return ""
