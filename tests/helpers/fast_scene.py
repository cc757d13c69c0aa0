"""Scenes of the plain reference as the package sees them, so that the two can be held against each
other: its right-hand side of such a scene, and random scenes with random forces and options."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from flocsim import Body, Sphere, SpheroPolygon, System
from flocsim.body import Fluid
from flocsim.forces import Contact, DoubleLayer, Gravity, StokesDrag, VanDerWaals
from flocsim.geometry.contact.candidates import rebuild_list
from flocsim.geometry.contact.points import locate_contacts
from flocsim.integrators.events.first_event import set_modes
from flocsim.integrators.parts import evaluate_as_they_lie
from flocsim.state.work import NOW, work_of
from tests.reference import forces as plain_forces
from tests.reference.contacts import contacts
from tests.reference.samples import scene_of
from tests.reference.shapes import Scene


def flagged(system):
    """The scene and work arrays of a System, uncompiled, its contacts listed and flagged."""
    scene = system.scene(jit=False)
    work = work_of(scene, *system.motion())
    work.budget[:] = -1.0
    assert rebuild_list(scene, work)
    locate_contacts(scene, work, NOW)
    set_modes(scene, work)
    return scene, work


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
    first, names = scene.first, ["vertex_body", "vertex", "edge_body", "edge_start"]
    return [
        (a, int(point - first[a]), b, int(start - first[b]))
        for a, point, b, start in work.candidates[: work.tally.candidates][names].tolist()
    ]


class FastScene:
    """A System with its arrays, ready to evaluate the forces where the bodies are."""

    def __init__(self, system, *, jit=True, capacity=4096):
        """Compose the right-hand side of the system, compiled or not."""
        self.system = system
        self.scene = system.scene(jit=jit)
        self.work = work_of(self.scene, *system.motion(), capacity=capacity)
        self.evaluate = system.compose(entry=evaluate_as_they_lie, observer=None, jit=jit)

    def loads(self, slips=None):
        """Force and torque (n, 3) on every body, with tangential displacements by pair."""
        assert self.evaluate(self.scene, self.work)
        if slips:
            # A second listing has to hand the displacements back to the same pairs.
            self.put_slips(slips)
            assert self.evaluate(self.scene, self.work)
        return self.work.force[NOW].copy()

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
        rows = self.work.geometry[NOW, : self.work.tally.candidates]
        return {
            key: row
            for key, row in zip(keys_of(self.scene, self.work), rows, strict=True)
            if row.gap < 0.0
        }

    def contact_point(self, key, row):
        """Middle of a pair's overlap [m], from the arms that its geometry row stores."""
        nx, ny, across, along = row.normal_x, row.normal_y, row.vertex_arm_n, row.vertex_arm_t
        x, y = self.work.place[NOW, key[0], :2]
        return np.array([x + along * nx + across * ny, y + along * ny - across * nx])


def fast_system(plain, forces, fluid, **material):
    """The System of a reference scene."""
    return System(bodies_of(plain, **material), forces, fluid=fluid)


GAPS = ("equivalent_spheres", "surface")
VISCOSITY, WATER, DENSITY = 8.9e-4, 997.0, 2650.0
SURFACE_DENSITY = 2.0
"""ρ_s of the reference's random scenes [kg/m²]."""

FORCES = (
    "gravity",
    "drag",
    "contact",
    *(f"attraction at {gap}" for gap in GAPS),
    *(f"repulsion at {gap}" for gap in GAPS),
)

NOTHING = 1e-300
"""A strength that no sum notices, while the force stays compiled in."""


@dataclass(frozen=True)
class Case:
    """A scene with its fluid, pairs of (the package's force, the reference's law), and slips."""

    plain: Scene
    fluid: Fluid
    material: dict
    pairs: dict
    slips: dict

    def system(self, *names):
        """The package's System with the named forces, all by default."""
        chosen = [self.pairs[name][0] for name in names or self.pairs]
        return fast_system(self.plain, chosen, self.fluid, **self.material)

    def laws(self, *names, smoothing=plain_forces.SHARP):
        """The reference's laws of the same names; ℓ of the smooth gap of outlines [m]."""
        laws = [self.pairs[name][1] for name in names or self.pairs]
        pairs = plain_forces.PairLaw
        return [
            replace(each, smoothing=smoothing) if isinstance(each, pairs) else each for each in laws
        ]


@cache
def random_case(seed):
    """A scene of the reference with options drawn for it."""
    rng = np.random.default_rng([seed, 1])
    material = {"density": DENSITY} if rng.random() < 0.5 else {"surface_density": 1.5}
    plain = remade(scene_of(seed), fixed=rng.random() < 0.3, **material)
    buoyancy = "density" in material
    fluid = Fluid(
        VISCOSITY, WATER, buoyancy, tuple(1e-3 * rng.normal(size=2)), tuple(rng.normal(size=4))
    )
    pairs = {
        "gravity": (Gravity(), plain_forces.Gravity(9.81, WATER if buoyancy else 0.0)),
        "drag": drag_pair(fluid, rotational=rng.random() < 0.7),
        "contact": contact_pair(rng),
    }
    for gap in GAPS:
        pairs[f"attraction at {gap}"] = attraction_pair(rng, gap)
        pairs[f"repulsion at {gap}"] = repulsion_pair(rng, gap)
    slips = {key: 1e-8 * rng.normal() for key in contacts(plain).pair_keys()}
    return Case(plain, fluid, material, pairs, slips if rng.random() < 0.7 else {})


def remade(plain, fixed, density=None, surface_density=SURFACE_DENSITY):
    """The scene with bodies as heavy as wanted, the first one fixed where asked."""

    def heavier(body):
        if density is not None:
            share = density * 4.0 / 3.0 * body.equivalent_radius / SURFACE_DENSITY
        else:
            share = surface_density / SURFACE_DENSITY
        inertia = share * body.inertia
        return replace(body, mass=share * body.mass, inertia=inertia, density=density)

    bodies = [heavier(body) for body in plain.bodies]
    bodies[0] = replace(bodies[0], fixed=fixed)
    return Scene(tuple(bodies), plain.positions, plain.velocities)


def drag_pair(fluid, rotational):
    """Drag in the fluid's flow."""
    gradient = np.array(fluid.gradient).reshape(2, 2)
    law = plain_forces.Drag(VISCOSITY, rotational, np.array(fluid.velocity), gradient, rotational)
    return StokesDrag(rotational, strain=rotational), law


def contact_pair(rng):
    """Contact with every option: damping given or derived, sliding or not, pulling or not."""
    k_n, k_t = rng.uniform(1.0, 50.0), rng.uniform(0.1, 10.0)
    damping_n = rng.choice([2e5, 0.0]) if rng.random() < 0.6 else "critical"
    damping_t = 7e4 if rng.random() < 0.5 else None
    friction = 0.3 if rng.random() < 0.5 else None
    tension = bool(rng.random() < 0.5)
    force = Contact(
        k_n, k_t, damping_n, "proportional" if damping_t is None else damping_t,
        "none" if friction is None else friction, tension,
    )  # fmt: skip
    return force, plain_forces.Contact(k_n, k_t, damping_n, damping_t, friction, tension)


def attraction_pair(rng, gap):
    """Van der Waals attraction, left out where it is below 1e-9 of its greatest strength."""
    hamaker, d_min = 10.0 ** rng.uniform(-20, -18), 10.0 ** rng.uniform(-9.0, -7.5)
    reach = d_min / np.sqrt(1e-9)
    law = plain_forces.VanDerWaals(hamaker, d_min, gap, reach=reach)
    return VanDerWaals(hamaker, d_min, gap), law


def repulsion_pair(rng, gap):
    """Double-layer repulsion, left out where it is below 1e-9 of its greatest strength."""
    potential, debye_length = 15e-3, 10.0 ** rng.uniform(-8, -6)
    reach = debye_length * np.log(1e9)
    law = plain_forces.DoubleLayer(potential, debye_length, 78.5, gap, reach=reach)
    return DoubleLayer(potential, debye_length, 78.5, gap), law


SILENT = {
    "gravity": Gravity(NOTHING),
    "drag": StokesDrag(),
    "contact": Contact(NOTHING, 0.0, 0.0),
    **{f"attraction at {gap}": VanDerWaals(NOTHING, gap=gap) for gap in GAPS},
    **{f"repulsion at {gap}": DoubleLayer(1e-150, gap=gap) for gap in GAPS},
}
"""Forces that are compiled in and come to nothing (drag does in a fluid without viscosity)."""


def silenced(case, *names):
    """The case's system with all but the named forces made silent: no new code to compile."""
    chosen = [case.pairs[name][0] if name in names else SILENT[name] for name in case.pairs]
    viscosity = VISCOSITY if "drag" in names else NOTHING
    fluid = Fluid(viscosity, WATER, case.fluid.buoyancy, case.fluid.velocity, case.fluid.gradient)
    return fast_system(case.plain, chosen, fluid, **case.material)
