"""Pairs of real flocs in water: boundary elements on both, and what the engine makes of them."""

import math
from functools import cache

import numpy as np

from flocsim import Body, Fluid, SpheroPolygon, System
from flocsim.ensembles.strength.opening import gap_of
from flocsim.forces import PairResistance, StokesDrag
from flocsim.geometry.fit.fit import fit_mask
from flocsim.geometry.shapes.outline import oriented
from flocsim.hydrodynamics.panels import panels_of
from flocsim.hydrodynamics.rigid_bodies import ORDERS
from flocsim.integrators.parts import evaluate_as_they_lie
from flocsim.integrators.rhs.jacobian import assemble_jacobian
from flocsim.state.work import DAMPING, NOW, work_of
from tests.helpers.prisms import loads_of
from tests.helpers.real_images import silhouettes

SIZE = 1e-5
"""r_eq of all [m]."""

UNIT = Fluid(viscosity=1.0)

PANELS = 60
"""Panels on half of the surface of each body, about; once more with four times as many."""


@cache
def real_flocs(count, vertices=24, least=60, read=silhouettes):
    """Shapes of the first silhouettes of so many pixels at least, all of one size; ``read`` gives
    pairs (mask, r_eq)."""
    masks = [mask for mask, _ in read() if mask.sum() >= least][:count]
    return [resized(fit_mask(mask, vertices=vertices, radius=1.0).shape) for mask in masks]


def resized(shape, radius=SIZE):
    """The shape with another r_eq."""
    scale = radius / shape.equivalent_radius
    return SpheroPolygon(scale * np.array(shape.vertices), scale * shape.radius)


def pose(rng, shapes, gap):
    """Places (2, 3) at random angles and a gap of the outlines [m]."""
    towards, *angles = rng.uniform(0.0, 2.0 * math.pi, 3)
    n = np.array([math.cos(towards), math.sin(towards)])
    bodies = [Body(shape, density=2000.0) for shape in shapes]

    def places(distance):
        return np.array([[0.0, 0.0, angles[0]], [*(distance * n), angles[1]]])

    low, high = 0.0, sum(shape.bounding_radius for shape in shapes) + 2.0 * gap
    for _ in range(50):
        middle = 0.5 * (low + high)
        near = gap_of(bodies, places(middle)) < gap
        low, high = (middle, high) if near else (low, middle)
    return places(high)


def random_pair(rng, flocs, gap):
    """Two flocs, the second as large as the first or half of it, and places with a gap of so many
    mean radii between their outlines."""
    first, second = rng.choice(len(flocs), 2, replace=False)
    share = rng.choice([1.0, 0.5])
    shapes = [flocs[first], resized(flocs[second], share * SIZE)]
    return shapes, pose(rng, shapes, gap * 0.5 * (1.0 + share) * SIZE)


def rings_of(shape, place):
    """Of the placed outline, over SIZE."""
    c, s = math.cos(place[2]), math.sin(place[2])
    return [(ring[:-1] @ [[c, s], [-s, c]] + place[:2]) / SIZE for ring in shape.outline()]


def boundary_elements(shapes, places):
    """(6, 6) resistance of prisms 4/3 r_eq deep, viscosity 1."""
    outlines = [oriented(rings_of(*each)) for each in zip(shapes, places, strict=True)]
    heights = [4.0 / 3.0 * shape.equivalent_radius / SIZE for shape in shapes]
    area = sum(
        0.5 * height * sum(np.hypot(*(np.roll(ring, -1, axis=0) - ring).T).sum() for ring in rings)
        + math.pi * (0.75 * height) ** 2
        for rings, height in zip(outlines, heights, strict=True)
    )
    size, found = math.sqrt(area / (PANELS * len(shapes))), []
    for finer in (1, 2):
        surfaces = [panels_of(*each, size, finer) for each in zip(outlines, heights, strict=True)]
        loads = loads_of(surfaces, list(range(len(shapes))), places[:, :2] / SIZE)
        found.append(0.5 * (loads + loads.T))
    coarse, fine = found
    limit = fine + (fine - coarse) / (2.0 ** ORDERS[0] - 1.0)
    powers = np.array([0.0, 0.0, 1.0] * len(shapes))
    return limit * SIZE ** (1.0 + powers[:, None] + powers)


def resistance_here(scene, work):
    """An entry of the engine: the Jacobian of forces where bodies are."""
    if not evaluate_as_they_lie(scene, work):
        return False
    assemble_jacobian(scene, work, 0.0, 1.0)
    return True


class Resistance:
    """−∂F/∂v (6, 6) of two shapes by the engine, viscosity 1, wherever they lie."""

    def __init__(self, shapes, law="shape", jit=False):
        bodies = [
            Body(shape, (1e-3 * place, 0.0), density=2000.0) for place, shape in enumerate(shapes)
        ]
        system = System(bodies, (StokesDrag(law=law), PairResistance()), fluid=UNIT)
        self.scene = system.scene(jit=jit)
        self.work = work_of(self.scene, *system.motion(), capacity=8192)
        self.entry = system.compose(entry=resistance_here, observer=None, jit=jit)

    def __call__(self, places):
        self.work.place[NOW] = places
        assert self.entry(self.scene, self.work)
        blocks = self.work.jacobian[DAMPING]
        return np.block([[blocks[0], blocks[4]], [blocks[5], blocks[1]]])


def line_mobilities(resistance, places):
    """How fast two bodies that are pulled together, along and across their line of centres, and
    against each other, move so (4,): over a pull of 1 on either."""
    n = places[1, :2] - places[0, :2]
    n = n / np.hypot(*n)
    t = np.array([-n[1], n[0]])
    pulls = np.array([[*(sign * axis), 0.0, *axis, 0.0] for sign in (1, -1) for axis in (n, t)])
    return np.diag(pulls @ np.linalg.solve(resistance, pulls.T))


def settling(resistance, shapes):
    """Velocities (directions, 2, 2) of both under weights ∝ r_eq³ in eight directions."""
    turn = 2.0 * math.pi * np.arange(8) / 8
    weights = [shape.equivalent_radius**3 for shape in shapes]
    pulls = np.array([
        [part for w in weights for part in (w * math.cos(a), w * math.sin(a), 0.0)] for a in turn
    ])  # fmt: skip
    return np.linalg.solve(resistance, pulls.T).T.reshape(-1, 2, 3)[..., :2]
