"""The package's right-hand side for scenes of the plain reference, so that the two can be held
against each other."""

from functools import cache

import numpy as np

from flocsim import Body, Sphere, SpheroPolygon, System
from flocsim.arrays import CANDIDATES, NOW, work_of
from flocsim.geometry.contact.candidates import list_candidates
from flocsim.geometry.contact.points import locate_contacts
from flocsim.integrators.events.modes import set_modes
from flocsim.integrators.rhs.forces import locate_and_rate, sum_forces


def right_hand_side(scene, work):
    """List the candidates and sum the forces of state NOW; False where the list has no room."""
    if not list_candidates(scene, work):
        return False
    locate_contacts(scene, work, NOW)
    set_modes(scene, work, NOW)
    locate_and_rate(scene, work, NOW)
    sum_forces(scene, work, 0.0, NOW)
    return True


@cache
def shape_from(coordinates, radius):
    """The package's shape of a core, given as bytes."""
    vertices = np.frombuffer(coordinates).reshape(-1, 2)
    return Sphere(radius) if len(vertices) == 1 else SpheroPolygon(vertices, radius)


def shape_of(body):
    """The package's shape of a reference body; its vertices keep their numbers."""
    shape = shape_from(body.vertices.tobytes(), body.radius)
    np.testing.assert_allclose(
        shape.vertices, body.vertices, rtol=0.0, atol=1e-11 * shape.bounding_radius
    )
    return shape


def bodies_of(plain, **material):
    """The package's bodies of a reference scene, of the given density or surface density."""
    return [
        Body(
            shape_of(body), tuple(place[:2]), place[2], tuple(speed[:2]), speed[2],
            fixed=body.fixed, **material,
        )
        for body, place, speed in zip(plain.bodies, plain.positions, plain.velocities, strict=True)
    ]  # fmt: skip


def keys_of(scene, work):
    """(vertex's body, vertex, edge's body, edge) of every listed pair."""
    first = scene.first
    return [
        (int(a), int(point - first[a]), int(b), int(start - first[b]))
        for a, point, b, start in work.candidates[: work.tally[CANDIDATES], :4]
    ]


class FastScene:
    """A System with its arrays, ready to evaluate the forces where the bodies are."""

    def __init__(self, system, *, jit=True, capacity=4096):
        """Compose the right-hand side of the system, compiled or not."""
        self.system = system
        self.scene = system.scene()
        self.work = work_of(self.scene, *system.motion(), capacity=capacity)
        self.evaluate = system.compose(entry=right_hand_side, observer=None, jit=jit)

    def loads(self, slips=None):
        """Force and torque (n, 3) on every body, with tangential displacements by pair."""
        assert self.evaluate(self.scene, self.work)
        if slips:
            # A second listing has to hand the displacements back to the same pairs.
            self.put_slips(slips)
            assert self.evaluate(self.scene, self.work)
        return self.work.rates[NOW, :, 3:].copy()

    def put_slips(self, slips):
        """Write displacements {pair: ξ} into the list; every pair must be in it."""
        keys = keys_of(self.scene, self.work)
        for key, slip in slips.items():
            row = keys.index(key if key in keys else self.other_way_round(key))
            self.work.slip[NOW, row] = slip

    def other_way_round(self, key):
        """The key of two spheres' one pair, whichever is called the vertex."""
        assert all(self.scene.first[body + 1] - self.scene.first[body] == 1 for body in key[::2])
        return key[2:] + key[:2]

    def overlapping(self):
        """{pair: geometry row} of the listed pairs that overlap."""
        rows = self.work.geometry[NOW, : self.work.tally[CANDIDATES]]
        return {
            key: row
            for key, row in zip(keys_of(self.scene, self.work), rows, strict=True)
            if row[2] < 0.0
        }

    def contact_point(self, key, row):
        """Middle of a pair's overlap [m], from the arms that its geometry row stores."""
        nx, ny, across, along = row[0], row[1], row[3], row[4]
        x, y = self.work.motion[NOW, key[0], :2]
        return np.array([x + along * nx + across * ny, y + along * ny - across * nx])


def fast_system(plain, forces, fluid, **material):
    """The System of a reference scene."""
    return System(bodies_of(plain, **material), forces, fluid=fluid)
