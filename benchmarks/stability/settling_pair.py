"""Two spheres that settle above each other under DLVO forces, and a stiff reference for them.

Laws are those of tests/reference; the motion along the line of centres is integrated by SciPy,
restarted at every gap where a law has a kink.
"""

import math

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.stability.case import WATER_DENSITY, Answer, Case, ReferenceGaveUpError
from benchmarks.stability.spheres import contact_of, drag_of, mass_between
from flocsim import Body, Fluid, Sphere
from flocsim.constants import CENTRE_SOFTENING, STANDARD_GRAVITY
from flocsim.forces import DoubleLayer, Gravity, StokesDrag, VanDerWaals
from tests.reference.forces import Contact as PlainContact
from tests.reference.forces import DoubleLayer as PlainDoubleLayer
from tests.reference.forces import VanDerWaals as PlainVanDerWaals
from tests.reference.forces import reduced

MOST_EVALUATIONS = 60_000
"""The reference gives up beyond so many."""

MOST_KINKS = 400


def approach(draw, gap_mode="equivalent_spheres"):
    """A sphere settles onto another one, from near or far."""
    small, large = draw.radii()
    fluid = Fluid(draw.log("viscosity"), WATER_DENSITY, buoyancy=True)
    density = draw.density()
    gap = 0.0 if draw.rng.random() < 0.1 else draw.log("start gap")
    lower = Body(Sphere(small), density=density, fixed=draw.rng.random() < 0.3)
    upper = Body(Sphere(large), (0.0, small + large + gap), density=density)
    bodies = [falling(body, fluid) for body in (lower, upper)]
    law, omega, *_ = contact_of(draw, bodies, draw.log("stiffness k_n"))
    forces = [
        Gravity(), StokesDrag(), VanDerWaals(draw.log("hamaker"), draw.log("d_min"), gap_mode),
        DoubleLayer(10.0 ** draw.uniform(-3.0, -1.0), draw.log("debye length"), gap=gap_mode), law,
    ]  # fmt: skip
    drift = abs(bodies[1].velocity[1] - bodies[0].velocity[1])
    until = draw.uniform(0.1, 2.0) * max(gap, 1e-9) / drift
    until += 10.0 ** draw.uniform(-1.0, 2.0) / omega
    return Case(
        bodies, forces, draw.tolerance(small), until, approach_answer, fluid,
    )  # fmt: skip


def approach_at_surfaces(draw):
    """The same with the gap between the outlines, which for spheres is the same gap."""
    return approach(draw, "surface")


def falling(body, fluid):
    """The body at its terminal velocity."""
    if body.fixed:
        return body
    speed = (
        body.buoyant_mass(fluid) * STANDARD_GRAVITY / drag_of(fluid.viscosity, body.shape.radius)
    )
    return Body(body.shape, body.position, 0.0, (0.0, -speed), density=body.density)


class Approach:
    """The equations of gap g, height and the two velocities, in units of r and of the run's time.

    y = (g/r, height of the lower body/r, its velocity and the upper one's in r/T).
    """

    def __init__(self, case):
        """Numbers of the case."""
        bodies, fluid = case.bodies, case.fluid
        _, _, attraction, repulsion, contact = case.forces
        self.length, self.time, self.evaluations = bodies[0].shape.radius, case.until, 0
        unit = self.length / self.time
        self.reduced = reduced(*(body.shape.radius for body in bodies))
        self.attraction = PlainVanDerWaals(attraction.hamaker, attraction.d_min)
        self.repulsion = PlainDoubleLayer(repulsion.potential, repulsion.debye_length)
        self.radii = sum(body.shape.radius for body in bodies)
        # Forces along the line of centres are those of a softened distance.
        along_centres = attraction.gap == "equivalent_spheres"
        self.softening = CENTRE_SOFTENING * self.radii if along_centres else 0.0
        self.d_min = self.hard(attraction.d_min)
        self.reaches = self.hard(attraction.reach), self.hard(repulsion.reach)
        kinks = sorted([0.0, self.d_min, *self.reaches])
        self.bounds = [-math.inf, *(kink / self.length for kink in kinks), math.inf]
        self.mass = mass_between(*bodies)
        self.contact = PlainContact(
            contact.k_n, contact.k_t, contact.damping_n, None, None, contact.tension
        )
        drags = [drag_of(fluid.viscosity, body.shape.radius) for body in bodies]
        free = [0.0 if body.fixed else 1.0 / body.mass for body in bodies]
        self.decays = [drag * one * self.time for drag, one in zip(drags, free, strict=True)]
        weights = [body.buoyant_mass(fluid) * STANDARD_GRAVITY for body in bodies]
        self.falls = [w * one * self.time / unit for w, one in zip(weights, free, strict=True)]
        self.gains = [one * self.time / unit for one in free]
        omega = math.sqrt(contact.k_n / self.mass)
        self.stiff = max(*self.decays, omega * self.time) > 3e3

    def hard(self, soft):
        """The gap of which the softened one is this [m]."""
        return math.sqrt((soft + self.radii) ** 2 - self.softening**2) - self.radii

    def force(self, gap, rate, between):
        """Repulsion [N] of the pair; which kinks the gap lies between is given, not asked."""
        total = 0.0
        distance = math.hypot(gap + self.radii, self.softening)
        soft = distance - self.radii
        upright = (gap + self.radii) / distance if distance > 0.0 else 1.0  # a trial may go there
        if between < self.reaches[0]:
            # Beyond a kink by a trial step, the law goes on as it was before the kink.
            d_min = self.attraction.d_min
            d = d_min if between < self.d_min else max(soft, 0.5 * d_min)
            total -= upright * self.attraction.hamaker * self.reduced / (6.0 * d * d)
        if between < self.reaches[1]:
            inside = 0.0 if between < self.hard(0.0) else soft
            total += upright * self.repulsion.repulsion(inside, self.reduced)
        if between < 0.0:
            total += self.contact.components(self.mass, -gap, 0.0, rate, 0.0)[0]
        return total

    def rate(self, y, between):
        """dy/ds, s = t/T."""
        self.evaluations += 1
        if self.evaluations > MOST_EVALUATIONS:
            raise ReferenceGaveUpError
        gap, _, v, w = y.tolist()
        unit = self.length / self.time
        repulsion = self.force(self.length * gap, unit * (w - v), between)
        return [
            w - v,
            v,
            -repulsion * self.gains[0] - self.decays[0] * v - self.falls[0],
            repulsion * self.gains[1] - self.decays[1] * w - self.falls[1],
        ]

    def segment_at(self, gap, rate):
        """The number of the segment between two kinks that a gap lies in, or goes into."""
        side = "right" if rate >= 0.0 else "left"
        return int(np.searchsorted(self.bounds, gap, side)) - 1

    def leg(self, start, y, segment, accuracy):
        """The motion from s = start to the end of a segment or to s = 1."""
        method = "LSODA" if self.stiff else "DOP853"
        leg = self.solve(start, y, segment, accuracy, method)
        return leg if leg.status >= 0 else self.solve(start, y, segment, accuracy, "Radau")

    def solve(self, start, y, segment, accuracy, method):
        """The same by one of SciPy's methods, which may fail."""
        low, high = self.bounds[segment], self.bounds[segment + 1]
        middle = {-math.inf: high - 1.0, math.inf: low + 1.0}
        between = middle.get(low, middle.get(high, 0.5 * (low + high))) * self.length
        return solve_ivp(
            lambda s, y: self.rate(y, between), (start, 1.0), y,
            method=method, events=[crossing(low, -1), crossing(high, 1)],
            rtol=100.0 * accuracy, atol=accuracy * np.array([1e-2, 1.0, 1.0, 1.0]),
        )  # fmt: skip

    def run(self, case, accuracy, nudge=0.0):
        """(y at the end, least gap) of the motion, the start gap nudged [m]."""
        lower, upper = case.bodies
        gap = upper.position[1] - sum(body.shape.radius for body in case.bodies) + nudge
        unit = self.length / self.time
        speeds = [body.velocity[1] / unit for body in (lower, upper)]
        start, y, least = 0.0, np.array([gap / self.length, 0.0, *speeds]), math.inf
        segment, self.evaluations = self.segment_at(y[0], y[3] - y[2]), 0
        for _ in range(MOST_KINKS):
            leg = self.leg(start, y, segment, accuracy)
            least = min(least, leg.y[0].min())
            if leg.status < 0:
                raise ReferenceGaveUpError
            start, y = leg.t[-1], leg.y[:, -1].copy()
            if leg.status == 0:
                return y, least * self.length
            # On the kink exactly, and on to the other side of it.
            rises = len(leg.t_events[1]) > 0
            y[0] = self.bounds[segment + 1 if rises else segment]
            segment += 1 if rises else -1
        raise ReferenceGaveUpError


def crossing(bound, direction):
    """An event of solve_ivp where the gap passes a bound upwards or downwards."""

    def event(s, y):
        return y[0] - bound

    event.terminal, event.direction = True, direction
    return event


def approach_answer(case):
    """The Answer of a run of Approach, its uncertainty from a second, looser one."""
    motion = Approach(case)
    accuracy = min(max(0.1 * case.tolerance / motion.length, 1e-13), 1e-11)
    try:
        tight, least = motion.run(case, accuracy)
        loose, _ = motion.run(case, 20.0 * accuracy)
        nudge = max(case.tolerance, 1e-7 * motion.length)
        nudged, _ = motion.run(case, 20.0 * accuracy, nudge)
    except ValueError:  # SciPy's root finder has lost a kink.
        raise ReferenceGaveUpError from None
    place = places_of(case, tight, motion.length)
    radii = sum(body.shape.radius for body in case.bodies)
    error = np.abs(tight - loose)[:2].max() * motion.length
    growth = np.abs(nudged - loose)[:2].max() * motion.length / nudge
    return Answer(
        place, error, max(1.0, growth), max(radii, np.abs(place).max()), max(-least / radii, 0.0)
    )


def places_of(case, y, length):
    """Places (2, 3) from the reference's y."""
    radii = sum(body.shape.radius for body in case.bodies)
    lower = case.bodies[0].position[1] + length * y[1]
    return np.array([[0.0, lower, 0.0], [0.0, lower + radii + length * y[0], 0.0]])
