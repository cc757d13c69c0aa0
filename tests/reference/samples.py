"""Laws and scenes that several tests of the reference share."""

from functools import cache

import numpy as np
import shapely

from tests.reference.contacts import contacts
from tests.reference.forces import Contact, DoubleLayer, VanDerWaals
from tests.reference.scenes import random_scene
from tests.reference.shapes import Scene, make_body

VISCOSITY, WATER = 8.9e-4, 997.0
CONTACT = Contact(k_n=20.0, k_t=2.0, damping_n=2e5, damping_t=7e4)
SURFACE = [
    VanDerWaals(1e-18, gap="surface"),
    DoubleLayer(15e-3, 0.98e-6, gap="surface"),
]
CENTRES = [VanDerWaals(1e-18), DoubleLayer(15e-3, 0.98e-6)]
SEEDS = range(40)


@cache
def scene_of(seed):
    return random_scene(np.random.default_rng(seed))


def displacements(scene):
    """Tangential displacements of some nanometres for every touching pair."""
    return {key: 1e-9 * (k % 7 - 3) for k, key in enumerate(contacts(scene).pair_keys())}


def random_core(make_core, rng):
    core = make_core(rng)
    while len(core) > 2 and not shapely.Polygon(core).is_valid:
        core = make_core(rng)
    return core


def spheres(distance, velocity, r=5e-6, **material):
    """Two spheres on the x axis, the left one moving right."""
    body = make_body([[0.0, 0.0]], r, **(material or {"surface_density": 2.0}))
    positions = np.array([[0.0, 0.0, 0.3], [distance, 0.0, 0.0]])
    return Scene((body, body), positions, np.array([[velocity, 0.0, 0.0], [0.0, 0.0, 0.0]]))
