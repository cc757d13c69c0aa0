"""Families of the stability table that closed forms answer, and these closed forms: settling, and a
linear contact with free flight before and after it."""

import math

import numpy as np
from scipy.optimize import brentq

from benchmarks.stability.case import FASTEST, WATER_DENSITY, Answer, Case
from benchmarks.stability.shapes import random_shape
from flocsim import Body, Fluid, Sphere
from flocsim.constants import DEEPEST_OVERLAP, STANDARD_GRAVITY
from flocsim.forces import Contact, Gravity, StokesDrag

PHASES = np.concatenate([np.geomspace(1e-9, 1e-3, 200), np.linspace(1e-3, 40.0, 20_001)[1:],
                         np.geomspace(40.0, 1e4, 200)[1:]])  # fmt: skip
"""Instants, in 1/ω0, searched for the end of a contact."""


def settle(velocity, terminal, relaxation, time):
    """Distance after a time of ẋ = v, v̇ = −(v − terminal)/relaxation."""
    gained = -relaxation * np.expm1(-time / relaxation)
    return terminal * time + (velocity - terminal) * gained


def oscillate(s, x, v, z):
    """(place, velocity) at s of ẍ = −x − 2 z ẋ from place x and velocity v."""
    root = np.sqrt(abs(1.0 - z * z)) if z != 1.0 else 0.0
    fall = np.exp(-z * s)
    if root * np.max(s) < 1e-6:
        wave, slow = np.ones_like(s), s
    elif z < 1.0:
        wave, slow = np.cos(root * s), np.sin(root * s) / root
    else:
        # e^(−z s) cosh(root s) without overflow.
        up, down = np.exp((root - z) * s), np.exp(-(root + z) * s)
        fall, wave, slow = 1.0, 0.5 * (up + down), 0.5 * (up - down) / root
    place = fall * (x * wave + (v + z * x) * slow)
    return place, fall * (v * wave - (x + z * v) * slow)


def contact_end(x, v, z, tension):
    """The s at which a contact ends (inf if never): overlap 0, or force 0 without tension."""

    def opening(s):
        place, velocity = oscillate(s, x, v, z)
        return place if tension else place + 2.0 * z * velocity

    if tension and z >= 1.0:
        return np.inf
    values = opening(PHASES)
    behind = np.flatnonzero(values < 0.0)
    if not len(behind):
        return np.inf
    k = behind[0]
    return brentq(opening, PHASES[k - 1] if k else 0.0, PHASES[k], xtol=1e-300, rtol=1e-15)


def bounce(gap, speed, omega, z, tension, time):
    """(gap after a time, greatest overlap) of two bodies that close in from a gap at a speed.

    A negative gap is an overlap at the start. ω0 [1/s], z the damping ratio.
    """
    free = gap / speed if gap > 0.0 else 0.0
    if time <= free:
        return gap - speed * time, 0.0
    x, v = max(-gap, 0.0), speed / omega
    scale = max(x, v)
    end = contact_end(x / scale, v / scale, z, tension)
    s = omega * (time - free)
    inside = np.append(PHASES[: np.searchsorted(PHASES, min(s, end))], min(s, end))
    places, velocities = oscillate(inside, x / scale, v / scale, z)
    flight = max(s - end, 0.0)
    return -scale * (places[-1] + flight * velocities[-1]), scale * max(places.max(), x / scale)


def resting_overlap(load, omega, decay, time):
    """(overlap, greatest overlap) of ẍ = load − ω² x − decay ẋ from rest at x = 0."""
    s, z = omega * time, 0.5 * decay / omega
    inside = np.append(PHASES[: np.searchsorted(PHASES, s)], s)
    places, _ = oscillate(inside, -1.0, 0.0, z)
    sunk = load / omega**2 * (1.0 + places)
    return sunk[-1], sunk.max()


DAMPING_RATIOS = (0.0, 0.05, 0.3, 0.7, 0.95, 1.0, 1.5, 3.0)

CANCELLED = 10.0 * np.finfo(float).eps
"""What an overlap may lose to cancellation, as a share of the coordinates."""


def drag_of(viscosity, radius):
    """6πγ r [N s/m]."""
    return 6.0 * math.pi * viscosity * radius


def free_settling(draw, least=1e-4, largest=1e3, vertices=None):
    """One body falls from any velocity and spin."""
    count = vertices or (1 if draw.rng.random() < 0.5 else draw.vertices())
    shape = random_shape(draw, count, draw.log("smaller radius"))
    density, viscosity = draw.density(), draw.log("viscosity")
    fluid = Fluid(viscosity, WATER_DENSITY, buoyancy=True)
    kick = 10.0 ** draw.uniform(-2.0, 1.0) * 1e-3
    direction, turn = draw.angle(), draw.pick(-1.0, 1.0)
    body = Body(
        shape, (0.0, 0.0), draw.angle(), (kick * math.cos(direction), kick * math.sin(direction)),
        turn * draw.log("spin"), density=density,
    )  # fmt: skip
    until = draw.log("duration", least, largest)
    return Case(
        [body], [Gravity(), StokesDrag()], draw.tolerance(shape.bounding_radius), until,
        lambda case: settled(body, fluid, until), fluid,
    )  # fmt: skip


def long_settling(draw):
    """The same for up to 1e7 s."""
    return free_settling(draw, 1e3, 1e7)


def settled(body, fluid, until):
    """The Answer of a body that settles alone."""
    r = body.shape.equivalent_radius
    drag = drag_of(fluid.viscosity, r)
    spin_drag = 8.0 * math.pi * fluid.viscosity * r**3
    fall = -body.buoyant_mass(fluid) * STANDARD_GRAVITY / drag
    place = np.array(
        [
            body.position[0] + settle(body.velocity[0], 0.0, body.mass / drag, until),
            body.position[1] + settle(body.velocity[1], fall, body.mass / drag, until),
            body.angle + settle(body.spin, 0.0, body.inertia / spin_drag, until),
        ]
    )
    path = max(abs(place[0]), abs(place[1]), abs(place[2]) * body.shape.bounding_radius)
    return Answer(place[None], span=path)


def free_spinning(draw):
    """One polygon without any force but drag, at the highest spins."""
    shape = random_shape(draw, draw.vertices(), draw.log("smaller radius"))
    spin = draw.log("spin", 1e3)
    body = Body(shape, (0.0, 0.0), 0.0, (0.0, 0.0), spin, density=draw.density())
    fluid = Fluid(draw.log("viscosity"), WATER_DENSITY, buoyancy=True)
    until = 10.0 ** draw.uniform(-1.0, 4.0) / spin
    return Case(
        [body], [Gravity(), StokesDrag()], draw.tolerance(shape.bounding_radius), until,
        lambda case: settled(body, fluid, until), fluid,
    )  # fmt: skip


def mass_between(a, b):
    """M = m_a m_b/(m_a + m_b) [kg], fixed bodies infinitely heavy."""
    return 1.0 / sum(0.0 if body.fixed else 1.0 / body.mass for body in (a, b))


def contact_of(draw, bodies, k_n, tensions=(True, False)):
    """(Contact, ω0, damping ratio, tension) for a pair."""
    z, tension = draw.pick(*DAMPING_RATIOS), draw.pick(*tensions)
    omega = math.sqrt(k_n / mass_between(*bodies))
    damping = "critical" if z == 1.0 else 2.0 * z * omega
    return Contact(k_n=k_n, k_t=0.1 * k_n, damping_n=damping, tension=tension), omega, z, tension


def pair_at(draw, density):
    """(two spheres of drawn radii at the origin, the lower first; a direction from it)."""
    small, large = draw.radii()
    direction = draw.angle()
    fixed = draw.rng.random() < 0.2
    bodies = [
        Body(Sphere(large), density=density, fixed=fixed),
        Body(Sphere(small), density=density),
    ]
    return bodies, np.array([math.cos(direction), math.sin(direction)])


def apart(bodies, direction, gap, speed):
    """The bodies with this gap along a direction, the second one closing in."""
    distance = gap + sum(body.shape.radius for body in bodies)
    one, other = bodies
    placed = Body(
        other.shape, tuple(distance * direction), 0.0, tuple(-speed * direction),
        density=other.density,
    )  # fmt: skip
    return [one, placed]


def sphere_impact(draw):
    """Two spheres, or a sphere and a fixed one, head-on, from zero gap or some way off."""
    bodies, direction = pair_at(draw, draw.density())
    k_n, radii = draw.log("stiffness k_n"), sum(body.shape.radius for body in bodies)
    law, omega, z, tension = contact_of(draw, bodies, k_n)
    speed = min(draw.log("impact depth") * omega * radii, FASTEST)
    gap = 0.0 if draw.rng.random() < 0.15 else draw.uniform(0.01, 20.0) * speed / omega
    flight = draw.uniform(0.1, 30.0) / omega if draw.rng.random() < 0.5 else radii / speed
    return impact_case(draw, bodies, direction, (gap, speed), law, (omega, z, tension), flight)


def deep_overlap(draw):
    """Two spheres that start at rest in a deep overlap; beyond the limit they must be refused."""
    bodies, direction = pair_at(draw, draw.density())
    k_n, radii = draw.log("stiffness k_n"), sum(body.shape.radius for body in bodies)
    law, omega, z, tension = contact_of(draw, bodies, k_n)
    share = draw.log("start overlap")
    flight = 10.0 ** draw.uniform(-1.0, 2.0) / omega
    motion = (omega, z, tension)
    return impact_case(draw, bodies, direction, (-share * radii, 0.0), law, motion, flight)


def impact_case(draw, bodies, direction, approach, law, motion, flight):
    """The Case of a head-on approach (gap, speed) that goes on for a time after the touch."""
    gap, speed = approach
    until = (max(gap, 0.0) / speed if gap > 0.0 else 0.0) + flight
    pair = apart(bodies, direction, gap, speed)
    radii = sum(body.shape.radius for body in bodies)
    return Case(
        pair, [law], draw.tolerance(bodies[1].shape.radius), until,
        lambda case: impact_answer(case, direction, approach, motion),
        refused=-gap > DEEPEST_OVERLAP * radii, conserves=not pair[0].fixed,
    )  # fmt: skip


def impact_answer(case, direction, approach, motion):
    """The Answer of a head-on impact, its amplification by a nudge of the start."""
    (gap, speed), nudge = approach, case.tolerance
    end, deepest = bounce(gap, speed, *motion, case.until)
    nudged, _ = bounce(gap + nudge, speed, *motion, case.until)
    radii = sum(body.shape.radius for body in case.bodies)
    place = pair_places(case, direction, end - gap, speed)
    span = max(np.abs(place[:, :2]).max(), radii, speed * case.until)
    # Overlaps are differences of coordinates; the force's round-off is a speed in the flight after.
    flight = case.until - max(gap, 0.0) / speed if speed > 0.0 else case.until
    lost = CANCELLED * span * motion[0] * flight
    growth = max(1.0, abs(nudged - end) / nudge)
    return Answer(place, 1e-12 * abs(end - gap) + lost, growth, span, deepest / radii)


def pair_places(case, direction, change, speed):
    """Places (2, 3) of a pair whose gap has changed by so much since the start."""
    one, other = case.bodies
    masses = np.array([0.0 if body.fixed else 1.0 / body.mass for body in (one, other)])
    shares = masses / masses.sum()
    drift = 0.0 if one.fixed else -speed * case.until * other.mass / (one.mass + other.mass)
    along = np.array([drift - shares[0] * change, drift + shares[1] * change])
    place = np.zeros((2, 3))
    place[:, :2] = np.array([one.position, other.position]) + along[:, None] * direction
    return place


def resting_sphere(draw):
    """A sphere let go at zero gap on top of a fixed one: it sinks in and comes to rest."""
    small, large = draw.radii()
    fluid = Fluid(draw.log("viscosity"), WATER_DENSITY, buoyancy=True)
    lower = Body(Sphere(large), density=2650.0, fixed=True)
    upper = Body(Sphere(small), (0.0, small + large), density=draw.density())
    bodies = [lower, upper]
    law, omega, z, _ = contact_of(draw, bodies, draw.log("stiffness k_n"), [True])
    decay = 2.0 * z * omega + drag_of(fluid.viscosity, small) / upper.mass
    load = STANDARD_GRAVITY * upper.buoyant_mass(fluid) / upper.mass
    # Longer, and the balance on top of the lower sphere is lost to round-off.
    until = min(10.0 ** draw.uniform(-1.0, 4.0) / omega, 3.0 / math.sqrt(load / (small + large)))
    return Case(
        bodies, [Gravity(), StokesDrag(), law], draw.tolerance(small), until,
        lambda case: resting_answer(case, load, omega, decay), fluid,
    )  # fmt: skip


def resting_answer(case, load, omega, decay):
    """The Answer of a sphere that sinks into its support."""
    overlap, deepest = resting_overlap(load, omega, decay, case.until)
    radii = sum(body.shape.radius for body in case.bodies)
    place = np.array([[0.0, 0.0, 0.0], [0.0, radii - overlap, 0.0]])
    return Answer(place, 1e-12 * overlap, span=radii, deepest=deepest / radii)
