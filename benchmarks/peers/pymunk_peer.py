"""Scenes of flocsim bodies in pymunk (Chipmunk 2D): rounded polygons, rigid contacts, impulses."""

import math

import numpy as np
import pymunk

NAME = "pymunk"

SLOP = 0.005
"""Overlap [m] that is not pushed apart, as in Box2D; Chipmunk's own suits larger bodies."""


class World:
    """A pymunk space with a scene's bodies, advanced by steps of equal size [s]."""

    def __init__(self, scene, step):
        self.step, self.steps, self.bodies = step, 0, []
        self.space = pymunk.Space()
        self.space.gravity, self.space.collision_slop = (0.0, -scene.gravity), SLOP
        for body in scene.bodies:
            kind = pymunk.Body.STATIC if body.fixed else pymunk.Body.DYNAMIC
            made = pymunk.Body(body.mass, body.inertia, kind)
            made.position, made.angle = body.position, body.angle
            made.velocity, made.angular_velocity = body.velocity, body.spin
            points, radius = body.shape.vertices.tolist(), body.shape.radius
            disc = len(points) == 1
            outline = (
                pymunk.Circle(made, radius) if disc else pymunk.Poly(made, points, None, radius)
            )
            # A pair has the product of both coefficients.
            outline.elasticity = math.sqrt(scene.restitution)
            outline.friction = math.sqrt(scene.friction)
            self.space.add(made, outline)
            self.bodies.append(made)

    def advance(self, until):
        """Advance to a time [s], a multiple of the step."""
        for _ in range(round(until / self.step) - self.steps):
            self.space.step(self.step)
        self.steps = round(until / self.step)

    def motion(self):
        """Return x, y, angle, vx, vy, spin of all bodies, (n, 6)."""
        rows = [(*b.position, b.angle, *b.velocity, b.angular_velocity) for b in self.bodies]
        return np.array(rows)
