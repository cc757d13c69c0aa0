"""Families of the stability table with polygons: impacts, rest, interlocked shapes, full scenes."""

import math

import attrs
import numpy as np

from benchmarks.stability.case import FASTEST, WATER_DENSITY, Answer, Case
from benchmarks.stability.references import explicit_answer, plain_answer
from benchmarks.stability.shapes import (
    hook,
    interlocked_place,
    made,
    place_at_gap,
    placed,
    random_shape,
    segment,
    sliver,
    star,
)
from benchmarks.stability.spheres import contact_of
from flocsim import Body, Fluid
from flocsim.forces import DoubleLayer, Gravity, StokesDrag, VanDerWaals

FREE = Fluid()


def contact_law(draw, bodies):
    """(Contact, ω0) of a pair; the tangential spring is left out in a third of the cases."""
    law, omega, *_ = contact_of(draw, bodies, draw.log("stiffness k_n"))
    if draw.rng.random() < 0.33:
        law = attrs.evolve(law, k_t=0.0, damping_t=0.0)
    return law, omega


def thrown(draw, shapes, answer, ratio_of_spin=10.0):
    """A body flies into another one from near by, turning."""
    density = draw.density()
    bodies = [Body(shape, density=density) for shape in shapes]
    law, omega = contact_law(draw, bodies)
    radii = sum(shape.radius for shape in shapes)
    speed = min(draw.log("impact depth", 1e-6, 0.3) * omega * radii, FASTEST)
    gap = 0.0 if draw.rng.random() < 0.15 else draw.uniform(0.01, 5.0) * speed / omega
    direction, at = draw.angle(), (0.0, 0.0, draw.angle())
    place = place_at_gap(shapes[0], at, shapes[1], draw.angle(), direction, gap)
    aside = direction + draw.uniform(-0.5, 0.5)
    velocity = (-speed * math.cos(aside), -speed * math.sin(aside))
    most = min(1e6, ratio_of_spin * speed / shapes[1].bounding_radius)
    spin = draw.pick(0.0, 1.0, -1.0) * draw.log("spin", 1e-2, max(most, 2e-2))
    pair = [placed(bodies[0], at), placed(bodies[1], place, velocity, spin)]
    until = gap / speed + draw.uniform(0.3, 8.0) * math.pi / omega
    smaller = min(shape.equivalent_radius for shape in shapes)
    return Case(
        pair, [law], draw.tolerance(smaller), until, answer, FREE, conserves=True
    )  # fmt: skip


def two_shapes(draw, most, ratio):
    """Two random shapes, one of them a sphere now and then, of a size ratio up to the given."""
    small, large = draw.radii(ratio)
    counts = [1 if draw.rng.random() < 0.15 else draw.vertices(most) for _ in range(2)]
    if counts == [1, 1]:
        counts[0] = draw.vertices(most)
    sizes = (small, large) if draw.rng.random() < 0.5 else (large, small)
    return [random_shape(draw, count, size) for count, size in zip(counts, sizes, strict=True)]


def polygon_impact(draw):
    """Polygons of few vertices run into each other."""
    return thrown(draw, two_shapes(draw, 16, 30.0), plain_answer)


def large_polygon_impact(draw):
    """Polygons of up to 512 vertices, of a size ratio up to 1:1000, run into each other."""
    return thrown(draw, two_shapes(draw, 512, 1e3), explicit_answer)


def sliver_impact(draw):
    """Needles and slivers with a thin skin run into each other or into a star."""
    size = draw.log("smaller radius")
    makers = [sliver, draw.pick(sliver, segment, star(8))]
    shapes = [made(draw, make, size, 10.0 ** draw.uniform(-2.5, -1.0)) for make in makers]
    return thrown(draw, shapes, plain_answer)


def spinning_impact(draw):
    """Polygons meet whose outlines run much faster than they approach."""
    shapes = two_shapes(draw, 16, 10.0)
    return thrown(draw, shapes, plain_answer, ratio_of_spin=1e3)


def interlocked(draw):
    """Hooks and deep stars that hold each other, shaken."""
    size = draw.log("smaller radius")
    while True:
        makers = [draw.pick(hook, star(draw.vertices(40) + 2, 0.15)) for _ in range(2)]
        shapes = [made(draw, make, size, 0.08) for make in makers]
        place = interlocked_place(draw, *shapes)
        if place is not None:
            return shaken(draw, shapes, place)


def shaken(draw, shapes, place):
    """The Case of two interlocked bodies of which one moves and turns."""
    density = draw.density()
    bodies = [Body(shape, density=density) for shape in shapes]
    law, omega = contact_law(draw, bodies)
    speed = min(draw.log("impact depth", 1e-6, 0.3) * omega * shapes[0].radius, FASTEST)
    spin = draw.uniform(-3.0, 3.0) * speed / shapes[1].bounding_radius
    direction = draw.angle()
    velocity = (speed * math.cos(direction), speed * math.sin(direction))
    pair = [placed(bodies[0], (0.0, 0.0, 0.0)), placed(bodies[1], place, velocity, spin)]
    until = draw.uniform(1.0, 30.0) / omega
    tolerance = draw.tolerance(shapes[0].equivalent_radius)
    return Case(pair, [law], tolerance, until, explicit_answer, FREE, conserves=True)


def unloaded_rest(draw):
    """Two bodies that touch at zero gap, at rest and without load: nothing may move."""
    shapes = two_shapes(draw, 512, 1e3)
    density = draw.density()
    bodies = [Body(shape, density=density) for shape in shapes]
    law, omega = contact_law(draw, bodies)
    at = (0.0, 0.0, draw.angle())
    place = place_at_gap(shapes[0], at, shapes[1], draw.angle(), draw.angle(), 0.0)
    pair = [placed(bodies[0], at), placed(bodies[1], place)]
    until = 10.0 ** draw.uniform(0.0, 6.0) / omega
    tolerance = draw.tolerance(min(shape.equivalent_radius for shape in shapes), 1e-11)
    return Case(pair, [law], tolerance, until, at_rest, FREE, conserves=True)


def at_rest(case):
    """The Answer of bodies that stay where they are."""
    places = np.array([(*body.position, body.angle) for body in case.bodies])
    return Answer(places, span=np.abs(places[:, :2]).max())


def all_forces(draw, law):
    """Every force of the model, DLVO at the surfaces."""
    attraction = VanDerWaals(draw.log("hamaker"), draw.log("d_min"), "surface")
    repulsion = DoubleLayer(
        10.0 ** draw.uniform(-3.0, -1.0), draw.log("debye length"), gap="surface"
    )
    return [Gravity(), StokesDrag(), attraction, repulsion, law]


def full_scene(draw):
    """Two to four polygons settle onto each other under all forces, for long."""
    shapes = two_shapes(draw, 64, 10.0)
    more = draw.pick(0, 0, 2)
    shapes += [random_shape(draw, 6, shapes[0].equivalent_radius) for _ in range(more)]
    density = draw.density()
    fluid = Fluid(draw.log("viscosity"), WATER_DENSITY, buoyancy=True)
    bodies = [Body(shape, density=density) for shape in shapes]
    bodies[0] = attrs.evolve(bodies[0], fixed=draw.rng.random() < 0.3)
    law, omega = contact_law(draw, bodies[:2])
    until = min(10.0 ** draw.uniform(0.0, 6.0) / omega, 100.0)
    tolerance = draw.tolerance(min(shape.equivalent_radius for shape in shapes), 1e-10)
    return Case(stacked(draw, bodies), all_forces(draw, law), tolerance, until, None, fluid)


def stacked(draw, bodies):
    """The bodies one above the other, about upright, each at a drawn gap from the last."""
    stack = [placed(bodies[0], (0.0, 0.0, draw.angle()))]
    for body in bodies[1:]:
        below, upwards = stack[-1], 0.5 * math.pi + draw.uniform(-0.3, 0.3)
        at, gap = (*below.position, below.angle), draw.log("start gap")
        place = place_at_gap(below.shape, at, body.shape, draw.angle(), upwards, gap)
        stack.append(placed(body, place))
    return stack


def resting_polygon(draw):
    """A polygon lies on a fixed one, touching at the start, under its weight."""
    shapes = two_shapes(draw, 64, 30.0)
    fluid = Fluid(draw.log("viscosity", None, draw.pick(1e-3, 1e2)), WATER_DENSITY, buoyancy=True)
    density = draw.density()
    bodies = [Body(shapes[0], density=density, fixed=True), Body(shapes[1], density=density)]
    law, omega = contact_law(draw, bodies)
    at = (0.0, 0.0, draw.angle())
    place = place_at_gap(shapes[0], at, shapes[1], draw.angle(), draw.uniform(1.2, 1.9), 0.0)
    pair = [placed(bodies[0], at), placed(bodies[1], place)]
    longest = draw.pick(2.0, 6.0)
    until = min(10.0 ** draw.uniform(0.0, longest) / omega, 100.0)
    tolerance = draw.tolerance(min(shape.equivalent_radius for shape in shapes), 1e-10)
    forces = [Gravity(), StokesDrag(), law]
    return Case(pair, forces, tolerance, until, explicit_answer, fluid)
