"""Scenes that rigid-body engines and flocsim can all compute, and how each is judged.

Metres, seconds, 1 kg/m². Contacts with Coulomb friction, and weight; no water, no surface forces.
"""

import math
from collections.abc import Callable

import attrs
import numpy as np
import shapely
from scipy.optimize import brentq
from shapely.ops import nearest_points

from flocsim import Body, Sphere, SpheroPolygon, Swarm
from flocsim.constants import STANDARD_GRAVITY
from flocsim.forces import Contact, Gravity
from flocsim.forces.contact import damping_ratio_for
from flocsim.integrators.amplification import end_distance
from flocsim.swarms.placement import place_at_random

RADIUS = 0.05
"""Spheroradius of all polygons [m]."""

AT_REST = 1e-2
"""Speed [m/s] of any outline point below which a pile is at rest."""


@attrs.frozen(eq=False)
class Scene:
    """Bodies, flocsim's law ``contact(k_n)``, times [s] at which they are looked at, and a judge.

    ``judge(scene, spent, motions)``, given CPU seconds and motions (n, 6) up to each time, returns
    (CPU time, error, further cells), or an infinite CPU time where the end was not reached.
    ``columns`` names error and cells; methods are ranked at errors of at most each of ``goals``.
    """

    name: str
    bodies: tuple
    times: tuple
    contact: Callable
    judge: Callable
    columns: tuple = ("error [m]",)
    goals: tuple = (0.1, 0.01, 1e-3, 1e-5)
    gravity: float = 0.0
    restitution: float = 0.0
    friction: float = 0.0

    def forces(self, stiffness):
        """Return flocsim's forces with a normal stiffness [N/m]."""
        return [Gravity(self.gravity), self.contact(stiffness)]


def at_end(exact):
    """Return a judge that compares the last positions with exact ones (n, 3)."""
    return lambda scene, spent, motions: (
        spent[-1], end_distance(scene.bodies, motions[-1][:, :3], exact)
    )  # fmt: skip


def inertia_of(bodies):
    """Return mass, mass and moment of inertia of the bodies, (n, 3)."""
    return np.array([(body.mass, body.mass, body.inertia) for body in bodies])


def rigid_impact(bodies, place, velocity, restitution, until):
    """Return the exact end (n, 3) of two bodies that meet once, and the mass [kg] of the impact.

    Free flight up to the root of the gap, Newton's impact law, free flight.
    """

    def cores(time):
        moved = zip(bodies, place + time * velocity, strict=True)
        return [shapely.Polygon(body.shape.placed_vertices(*at)) for body, at in moved]

    def gap(time):
        return shapely.distance(*cores(time)) - 2.0 * RADIUS

    times = np.linspace(0.0, until, 1000)
    first = next(k for k, time in enumerate(times) if gap(time) < 0.0)
    touch = brentq(gap, times[first - 1], times[first], xtol=1e-15)
    # Normal and levers at touch; the gap's rate is Σ jacobian · velocity.
    one, other = (np.array(point.coords[0]) for point in nearest_points(*cores(touch)))
    normal = (other - one) / np.hypot(*(other - one))
    touching = place + touch * velocity
    lever = one + RADIUS * normal - touching[:, :2]
    turning = lever[:, 0] * normal[1] - lever[:, 1] * normal[0]
    jacobian = np.array([[-1.0], [1.0]]) * np.column_stack([[normal, normal], turning])
    mass = 1.0 / np.sum(jacobian**2 / inertia_of(bodies))
    impulse = -(1.0 + restitution) * mass * np.sum(jacobian * velocity)
    return touching + (until - touch) * (velocity + impulse * jacobian / inertia_of(bodies)), mass


def collision(delay, restitution=0.5, until=1.0):
    """Return two polygons of 12 vertices that meet obliquely at 6 m/s, without friction.

    ``delay`` [s] of the touch: errors of fixed steps depend on when in a step that is.
    """
    turn = 2.0 * math.pi * np.arange(12) / 12
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    velocity = np.array([(0.0, 3.0, 0.7), (-0.4, -3.0, -1.0)])
    place = np.array([(0.0, 0.0, 0.3), (0.5, 3.0, 1.2)]) - delay * velocity
    shapes = [SpheroPolygon(circle * axes, RADIUS) for axes in ((0.5, 0.35), (0.6, 0.4))]
    bodies = tuple(
        Body(shape, at[:2], at[2], rate[:2], rate[2], surface_density=1.0)
        for shape, at, rate in zip(shapes, place.tolist(), velocity.tolist(), strict=True)
    )
    exact, mass = rigid_impact(bodies, place, velocity, restitution, until)
    pair = bodies[0].mass * bodies[1].mass / (bodies[0].mass + bodies[1].mass)
    # The law damps with the mass of the pair; off the centres less mass takes part.
    unit = 2.0 * damping_ratio_for(restitution, True) * math.sqrt(mass) / pair
    return Scene("one collision", bodies, (until,),
                 lambda k: Contact(k_n=k, damping_n=unit * math.sqrt(k), friction=0.0),
                 at_end(exact), restitution=restitution)  # fmt: skip


def block(low, high, slope=0.0):
    """Return a fixed rectangle between two corners [m], turned clockwise about the origin."""
    (x0, y0), (x1, y1) = np.add(low, RADIUS), np.subtract(high, RADIUS)
    (x, y), c, s = np.add(low, high) / 2.0, math.cos(slope), math.sin(slope)
    shape = SpheroPolygon([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], RADIUS)
    return Body(shape, (c * x + s * y, c * y - s * x), -slope, surface_density=1.0, fixed=True)


def frictional(friction):
    """Return the law of stiffness for critical damping, Coulomb friction and no tension."""
    return lambda k: Contact(k_n=k, k_t=0.5 * k, friction=friction, tension=False)


def incline(slope=0.35, radius=0.5, until=2.0):
    """Return a disc that rolls down an incline of 20 degrees from rest: s = g sin(slope) t²/3."""
    along, up = np.array([(math.cos(slope), -math.sin(slope)), (math.sin(slope), math.cos(slope))])
    ground = block((-2.0, -1.0), (10.0, 0.0), slope)
    disc = Body(Sphere(radius), tuple(radius * up), surface_density=1.0)
    way = STANDARD_GRAVITY * math.sin(slope) * until**2 / 3.0
    exact = [(*ground.position, -slope), (*(radius * up + way * along), -way / radius)]
    return Scene("rolling disc", (ground, disc), (until,), frictional(0.5),
                 at_end(np.array(exact)), gravity=STANDARD_GRAVITY, friction=0.5)  # fmt: skip


def random_polygon(rng):
    """Return a convex polygon of 8 vertices near an ellipse of random size."""
    size, aspect = 0.25 * math.exp(0.2 * rng.normal()), rng.uniform(0.6, 1.0)
    turn = 2.0 * math.pi * np.arange(8) / 8 + rng.uniform(-0.2, 0.2, 8)
    return SpheroPolygon(size * np.column_stack([np.cos(turn), aspect * np.sin(turn)]), RADIUS)


def filled_box(number, fraction, aspect, speed=0.0):
    """Return floor, walls and lid, and polygons at random between them, which fill a fraction."""
    rng = np.random.default_rng(0)
    shapes = [random_polygon(rng) for _ in range(number)]
    width = math.sqrt(sum(shape.area for shape in shapes) / (fraction * aspect))
    top = aspect * width
    places = place_at_random(shapes, (width, top), rng, (False, False), gap=0.01)
    walls = [block((-1.0, -1.0), (width + 1.0, 0.0)), block((-1.0, -1.0), (0.0, top + 1.0)),
             block((width, -1.0), (width + 1.0, top + 1.0)),
             block((-1.0, top), (width + 1.0, top + 1.0))]  # fmt: skip
    return tuple(walls) + tuple(
        Body(shape, (x, y), angle, tuple(speed * rng.normal(size=2)), speed * rng.normal(),
             surface_density=1.0)
        for shape, (x, y, angle) in zip(shapes, places.tolist(), strict=True)
    )  # fmt: skip


def judge_gas(scene, spent, motions):
    """Compare kinetic energies: the largest of the last times, when fewest springs are pressed."""
    inertia = inertia_of(scene.bodies[4:])
    start = np.array([(*body.velocity, body.spin) for body in scene.bodies[4:]])
    last = max(np.sum(inertia * motion[4:, 3:] ** 2) for motion in motions)
    change = last / np.sum(inertia * start**2) - 1.0
    cost = 1e6 * spent[-1] / (scene.times[-1] * len(inertia))
    return spent[-1], abs(change), f"{change:+.0e}", cost


def gas(number, until):
    """Return polygons that fill 0.3 of a closed box and collide elastically, at 5 m/s."""
    times = tuple(until - 0.01 * k for k in reversed(range(10)))
    return Scene("elastic gas", filled_box(number, 0.3, 1.0, speed=3.5), times,
                 lambda k: Contact(k_n=k, friction=0.0, damping_n=0.0), judge_gas,
                 ("energy error", "signed", "us per s and body"), restitution=1.0)  # fmt: skip


def judge_pile(scene, spent, motions):
    """Return CPU time until rest, largest overlap over mean diameter, time at rest, area fraction
    up to the height of four fifths of the centres, and speed at the end."""
    free, position = scene.bodies[4:], motions[-1][4:, :3]
    reach = np.array([body.shape.bounding_radius for body in free])
    speeds = [np.max(np.hypot(*m[4:, 3:5].T) + reach * np.abs(m[4:, 5])) for m in motions]
    first = max((k + 1 for k, speed in enumerate(speeds) if speed > AT_REST), default=0)
    rests = first < len(speeds)
    gaps = Swarm(scene.bodies, scene.forces(1e4)).gauge().neighbours(motions[-1][:, :3]).gap
    size = np.mean([2.0 * body.shape.equivalent_radius for body in free])
    filled = shapely.box(0.0, 0.0, 2.0 * scene.bodies[0].position[0],
                         np.quantile(position[:, 1], 0.8))  # fmt: skip
    placed = zip(free, position, strict=True)
    cores = [shapely.Polygon(body.shape.placed_vertices(*at)) for body, at in placed]
    area = np.sum(shapely.area(shapely.intersection(shapely.buffer(cores, RADIUS), filled)))
    return (spent[first] if rests else math.inf, -float(gaps.min(initial=0.0)) / size,
            f"{scene.times[first]:.2f}" if rests else "never", float(area / filled.area),
            f"{speeds[-1]:.0e}")  # fmt: skip


def pile(number, until):
    """Return polygons with friction that fall on a floor between walls."""
    times = tuple(0.25 * k for k in range(1, round(until / 0.25) + 1))
    return Scene("pile", filled_box(number, 0.35, 1.5), times, frictional(0.4), judge_pile,
                 ("overlap/size", "at rest [s]", "packing", "last speed [m/s]"), (0.02, 2e-3),
                 STANDARD_GRAVITY, friction=0.4)  # fmt: skip
