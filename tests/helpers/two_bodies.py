"""Two bodies put somewhere, uncompiled, as the proofs of bonds see them."""

import math

import numpy as np

from flocsim import Body, SpheroPolygon, System
from flocsim.bonds.certificate import Load, bond_between
from flocsim.geometry.contact.candidates import rebuild_list
from flocsim.geometry.contact.points import locate_contacts
from flocsim.integrators.events.first_event import set_modes
from flocsim.state.work import NOW, work_of
from tests.helpers.swarm_scenes import WATER

ANCHOR = [(-0.5, 8), (-0.5, 1), (-3, 1), (-3, 0), (3, 0), (3, 1), (0.5, 1), (0.5, 8)]
CHANNEL = [
    (-4, -2), (4, -2), (4, 2), (1, 2), (1, 1), (3.5, 1), (3.5, -1), (-3.5, -1), (-3.5, 1), (-1, 1),
    (-1, 2), (-4, 2),
]  # fmt: skip
"""A channel whose lips lie on the feet of the anchor from above."""


class TwoBodies:
    """Two shapes at places (2, 3) [m, m, rad], with motions (2, 3) and forces of their own."""

    def __init__(self, shapes, places, forces, motion=None, fixed=(False, False)):
        """At rest unless a motion is given."""
        bodies = [
            Body(shape, tuple(place[:2]), float(place[2]), density=2650.0, fixed=held)
            for shape, place, held in zip(shapes, places, fixed, strict=True)
        ]
        self.bodies = bodies
        self.scene = System(bodies, forces, fluid=WATER).scene(jit=False)
        motion = np.zeros((2, 3)) if motion is None else np.asarray(motion)
        self.work = work_of(self.scene, np.asarray(places, dtype=float), motion, 256)
        assert rebuild_list(self.scene, self.work)
        locate_contacts(self.scene, self.work, NOW)
        set_modes(self.scene, self.work)

    @property
    def bond(self):
        """Its Bond."""
        return bond_between(self.scene, self.work, 0.0, 0, 1)


def load(force=0.0, drift=(0.0, -1e-3), **known):
    """The Load of two bodies alone that drift so against each other [m/s]."""
    speed = math.hypot(*drift)
    x, y = (drift[0] / speed, drift[1] / speed) if speed else (0.0, 0.0)
    given = {"lever": 0.0, "alone": 1.0, "kicks": 0.0} | known
    return Load(force, speed or 1e-3, x, y, **given)


def polygon(points, unit=1e-6, radius=5e-8):
    """(a rounded polygon of points in units of 1 um, where its centroid lies in them [m])."""
    points = unit * np.array(points, dtype=float)
    shape = SpheroPolygon(points, radius)
    return shape, points[0] - np.asarray(shape.vertices)[0]
