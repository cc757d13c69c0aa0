"""The same pair in pymunk (Chipmunk): convex polygons with a radius, rigid contacts by impulses.

Units inside: µm and ms, masses in 1e-12 kg.
"""

import math
import time

import numpy as np

from benchmarks.speed.measure import Measured
from flocsim.constants import STANDARD_GRAVITY

LENGTH, TIME, MASS = 1e-6, 1e-3, 1e-12

REMARK = "convex only, rigid contacts (no k_n, damping or displacement), no DLVO"


def add_body(space, body):
    """A body of the scene in a space."""
    import pymunk

    core = pymunk.Body(body.mass / MASS, body.inertia / (MASS * LENGTH**2))
    core.position = tuple(value / LENGTH for value in body.position)
    core.angle = body.angle
    core.velocity = tuple(value * TIME / LENGTH for value in body.velocity)
    core.angular_velocity = body.spin * TIME
    points = [tuple(point) for point in np.asarray(body.shape.vertices) / LENGTH]
    shape = pymunk.Poly(core, points, radius=body.shape.radius / LENGTH)
    shape.friction, shape.elasticity = 0.0, 0.0
    space.add(core, shape)
    return core


def loads_of(scene):
    """(weight, drag coefficient) of each body in pymunk's units."""
    for body in scene.bodies:
        weight = STANDARD_GRAVITY * body.buoyant_mass(scene.fluid)
        drag = 6.0 * math.pi * scene.fluid.viscosity * body.shape.equivalent_radius
        yield weight * TIME**2 / (MASS * LENGTH), drag * TIME / MASS


def run(scene, step):
    """A Measured of the scene with fixed steps."""
    import pymunk

    space = pymunk.Space()
    space.collision_slop, space.iterations = 1e-3, 30
    cores = [add_body(space, body) for body in scene.bodies]
    loads = list(loads_of(scene))
    steps = round(scene.until / step)
    began = time.process_time()
    for _ in range(steps):
        for core, (weight, drag) in zip(cores, loads, strict=True):
            vx, vy = core.velocity
            core.force = (-drag * vx, -drag * vy - weight)
        space.step(step / TIME)
    cpu = time.process_time() - began
    motion = [
        [*(value * LENGTH for value in core.position), core.angle, 0.0, 0.0, 0.0] for core in cores
    ]
    return Measured(np.array(motion), "FINISHED", cpu, steps, 0, steps)
