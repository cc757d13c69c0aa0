"""Scenes of flocsim bodies in Box2D 2.3 (pybox2d): rigid contacts, impulses, float32.

Polygons of 16 vertices at most, with a skin as thick as the spheroradius: their faces are those of
the spheropolygon, but where two corners meet they act as sharp ones.
"""

import Box2D
import numpy as np

NAME = "Box2D"

ITERATIONS = 8, 3
"""Of the velocities and of the positions in a step, as the manual recommends."""


class World:
    """A Box2D world with a scene's bodies, advanced by steps of equal size [s]."""

    def __init__(self, scene, step):
        self.step, self.steps, self.bodies = step, 0, []
        self.world = Box2D.b2World(gravity=(0.0, -scene.gravity))
        for body in scene.bodies:
            create = self.world.CreateStaticBody if body.fixed else self.world.CreateDynamicBody
            made = create(position=body.position, angle=body.angle)
            points = body.shape.vertices.tolist()
            disc = len(points) == 1
            outline = Box2D.b2CircleShape() if disc else Box2D.b2PolygonShape(vertices=points)
            outline.radius = body.shape.radius
            # A pair has the larger restitution, and the geometric mean of both frictions.
            about = {"restitution": scene.restitution, "friction": scene.friction}
            made.CreateFixture(Box2D.b2FixtureDef(shape=outline, density=1.0, **about))
            if not body.fixed:
                made.massData = Box2D.b2MassData(mass=body.mass, I=body.inertia, center=(0.0, 0.0))
                made.linearVelocity, made.angularVelocity = body.velocity, body.spin
            self.bodies.append(made)

    def advance(self, until):
        """Advance to a time [s], a multiple of the step."""
        for _ in range(round(until / self.step) - self.steps):
            self.world.Step(self.step, *ITERATIONS)
        self.steps = round(until / self.step)

    def motion(self):
        """Return x, y, angle, vx, vy, spin of all bodies, (n, 6)."""
        rows = [(*b.position, b.angle, *b.linearVelocity, b.angularVelocity) for b in self.bodies]
        return np.array(rows)
