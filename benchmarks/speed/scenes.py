"""Scenes shared by benchmarks and tests: what moves, under which forces, for how long.

Each function gives a ``BenchmarkScene``, into which any integrator may be put.
"""

import math
from functools import cache
from pathlib import Path

import attrs
import numpy as np

from flocsim import Body, Fluid, Sphere, SpheroPolygon, System
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.study import Study
from flocsim.forces import Contact, DoubleLayer, Gravity, StokesDrag, VanDerWaals

COLLISIONS = Path(__file__).with_name("collisions.toml")
"""The config of all collisions of flocs."""

RECEIVER, APPROACHER = 16.41e-6, 23.02e-6
"""r_eq [m] of Type I."""

CAPTURE_LIMIT = 39.44836e-6
"""Displacement [m] beyond which `grazing_capture`'s spheres pass each other untouched."""


@attrs.frozen(eq=False)
class BenchmarkScene:
    """Bodies, forces, fluid, and how long [s] they move.

    ``light``: real weights, small Stokes numbers, so that a method without inertia makes sense.
    """

    name: str
    bodies: tuple
    forces: tuple
    fluid: Fluid
    until: float
    light: bool = False

    def system(self, integrator):
        """The scene with an integrator in it."""
        return System(self.bodies, self.forces, integrator, self.fluid)


def collisions(preset="tang2014", **overrides):
    """The config of the collisions with a preset, and tables laid over it."""
    return load_config(COLLISIONS, {"preset": preset, **overrides})


@cache
def collision_study(preset, vertices, start_gap):
    """The Study that `collision` takes a replicate from."""
    shapes = {"vertices": [vertices], "pool": 2}
    return Study(collisions(preset, shapes=shapes, scene={"start_gap": start_gap}))


def free_settling():
    """A sphere of quartz that starts from rest and spins, for 60 of its relaxation times."""
    body = Body(Sphere(RECEIVER), spin=1e3, density=2650.0)
    forces = (Gravity(), StokesDrag())
    return BenchmarkScene("free settling", (body,), forces, Fluid(buoyancy=True), 0.01)


def grazing_capture():
    """Type I spheres under `tang2014`, displaced by a little less than what would let them pass."""
    config = collisions("tang2014")
    displacement = (1.0 - 1e-4) * CAPTURE_LIMIT
    small, large = Sphere(RECEIVER), Sphere(APPROACHER)
    bodies = (
        Body(small, velocity=(0.0, -0.06029292), **config.body_options(small)),
        Body(
            large, (displacement, 20e-6), velocity=(0.0, -0.0845791), **config.body_options(large)
        ),
    )
    return BenchmarkScene("grazing capture", bodies, config.forces, config.fluid, 3e-3)


def steep_doublet():
    """Two quartz spheres 2 nm apart above the narrow well of surface attraction, at real weight."""
    height = 4.62e-6 + 4.95e-6 + 2e-9
    bodies = (
        Body(Sphere(4.62e-6), density=2650.0),
        Body(Sphere(4.95e-6), (1e-6, (height**2 - 1e-12) ** 0.5), density=2650.0),
    )
    forces = (
        Gravity(), StokesDrag(), VanDerWaals(4.7e-20, gap="surface"),
        DoubleLayer(15e-3, 0.98e-9, gap="surface"), Contact(k_n=20.0, k_t=2.0),
    )  # fmt: skip
    return BenchmarkScene("steep doublet", bodies, forces, Fluid(buoyancy=True), 0.01, True)


def collision(kind, preset, vertices=64, replicate=0, share=0.5, start_gap=2e-7):
    """The System of two synthetic flocs about to collide.

    ``kind`` is the type, "I" to "III"; ``share`` the displacement over δ_max.
    """
    study = collision_study(preset, vertices, start_gap)
    condition = study.config.scene.names.index(kind)
    return study.draw(condition, vertices, share, replicate).system()


def rolling(kind, preset, until):
    """A collision of two synthetic flocs of 64 vertices: approach, contact, rolling."""
    system = collision(kind, preset)
    name = f"rolling {kind}, {preset}"
    return BenchmarkScene(
        name, system.bodies, system.forces, system.fluid, until, light=preset == "si"
    )


def rolling_pair(preset, vertices, replicate):
    """Type I with any number of vertices, until shortly after it has touched."""
    system = collision("I", preset, vertices, replicate)
    until = {"tang2014": 5e-4, "si": 2e-3}[preset]
    return BenchmarkScene("rolling pair", system.bodies, system.forces, system.fluid, until)


FRICTIONLESS = (
    Gravity(),
    StokesDrag(rotational=False),
    Contact(k_n=20.0, k_t=0.0, damping_t=0.0),
)
"""All the forces that LAMMPS has of ours: no DLVO, no tangential force, no rotational drag."""


def ellipse(width, height, count=16):
    """A convex polygon of so many vertices on an ellipse, with a spheroradius of 1 µm."""
    turn = 2.0 * math.pi * np.arange(count) / count
    return SpheroPolygon(np.column_stack([width * np.cos(turn), height * np.sin(turn)]), 1e-6)


def contact_only_flocs():
    """The flocs of `rolling I, tang2014` under contact, drag and weight alone."""
    system = collision("I", "tang2014")
    return BenchmarkScene("contact only, flocs N = 64", system.bodies, FRICTIONLESS, Fluid(), 2e-3)


def contact_only_convex():
    """Two convex bodies of 16 vertices under contact, drag and weight alone."""
    bodies = (
        Body(ellipse(18e-6, 12e-6), angle=0.3, velocity=(0.0, -0.06), surface_density=2.0),
        Body(
            ellipse(24e-6, 19e-6), (15e-6, 37e-6), 1.2, velocity=(0.0, -0.085), surface_density=2.0
        ),
    )
    return BenchmarkScene("contact only, convex N = 16", bodies, FRICTIONLESS, Fluid(), 2e-3)


def all_scenes():
    """Every scene of the work-precision diagrams."""
    return [
        free_settling(),
        grazing_capture(),
        rolling("I", "tang2014", 2e-3),
        rolling("III", "tang2014", 4e-3),
        rolling("I", "si", 5e-3),
        rolling("III", "si", 0.05),
        steep_doublet(),
    ]
