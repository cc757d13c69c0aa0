"""Bodies with holes and of several parts: they move as what they are made of says."""

import math

import numpy as np
import pytest

from flocsim import Body, Composite, Fluid, Sphere, SpheroPolygon, Swarm, System
from flocsim.forces import Contact, Gravity, StokesDrag, VanDerWaals
from flocsim.integrators import Implicit, Status
from tests.helpers.compound_shapes import beads, cross, framed, lace, wavy
from tests.helpers.tiers import rest_slow

UNIT = 1e-6
WATER = Fluid(buoyancy=True)
CONTACT = Contact(k_n=20.0, k_t=5.0)


def finished(system, until):
    """The run of a System or Swarm; that of a System is at its end before it were compiled."""
    options = {"jit": False} if isinstance(system, System) else {}
    found = system.run(until, **options)
    assert found.status == Status.FINISHED
    return found


def furthest(a, b):
    return float(np.hypot(*(a - b)[:, :2].T).max())


def thrown(shapes, spin=2e3, speed=0.02):
    """Two bodies thrown at each other off centre, in nothing."""
    apart = sum(shape.bounding_radius for shape in shapes)
    return [
        Body(shape, (side * 0.55 * apart, side * 0.1 * apart), 0.4 + side, (-side * speed, 0.0),
             side * spin, surface_density=2.0)
        for shape, side in zip(shapes, (-1.0, 1.0), strict=True)
    ]  # fmt: skip


@pytest.mark.parametrize(
    "make", rest_slow([framed, lace, beads, cross], lambda make: make in (framed, beads))
)
def test_momentum_and_energy_are_kept(make):
    """Elastic collisions, whose springs have given all back at the end."""
    bodies = thrown([make(UNIT), cross(0.8 * UNIT)])
    found = finished(System(bodies, [Contact(damping_n=0.0, k_t=0.0)], Implicit(1e-12)), 4e-4)
    mass = np.array([body.mass for body in bodies])
    inertia = np.array([body.inertia for body in bodies])
    v, x = found.velocity[[0, -1]], found.position[[0, -1]]
    momentum = np.einsum("n,knc->kc", mass, v[:, :, :2])
    turning = v[:, :, 2] @ inertia
    turning += (x[:, :, 0] * v[:, :, 1] - x[:, :, 1] * v[:, :, 0]) @ mass
    energy = 0.5 * (np.sum(v[:, :, :2] ** 2, axis=2) @ mass + v[:, :, 2] ** 2 @ inertia)
    # They have met, and parted.
    assert np.abs(v[1] - v[0]).max() > 1e-3
    assert np.abs(np.diff(momentum, axis=0)).max() < 1e-12 * mass.sum() * 0.02
    assert abs(np.diff(turning)[0]) < 1e-6 * np.abs(turning).max() + 1e-25
    assert energy[1] == pytest.approx(energy[0], rel=1e-5)


def test_one_part_moves_as_the_shape_itself():
    """A polygon by itself, and as the only part of a composite."""
    star = SpheroPolygon(wavy(16, 0.3, 5, 5.0) * UNIT, 0.5 * UNIT)
    plain = thrown([star, star])
    composite = thrown([Composite([(star, (2e-6, 1e-6), 0.0)])] * 2)
    forces = [CONTACT, StokesDrag(), VanDerWaals(1e-19, gap="surface", cut=1e-6)]
    one = finished(System(plain, forces), 1e-3)
    other = finished(System(composite, forces), 1e-3)
    assert furthest(one.position[-1], plain_places(plain)) > 1e-6
    assert furthest(one.position[-1], other.position[-1]) < 1e-11 + one.error + other.error


def plain_places(bodies):
    return np.array([[*body.position, body.angle] for body in bodies])


def test_settling_is_that_of_the_union():
    """Stokes's law with r_eq of what all parts cover together."""
    for shape in (framed(UNIT), beads(UNIT)):
        body = Body(shape, density=2650.0)
        found = finished(System([body], [Gravity(), StokesDrag()], fluid=WATER), 5e-3)
        drag = 6.0 * math.pi * WATER.viscosity * math.sqrt(shape.area / math.pi)
        weight = 9.81 * body.buoyant_mass(WATER)
        assert -found.velocity[-1, 0, 1] == pytest.approx(weight / drag, rel=1e-9)


def test_a_disk_rests_in_the_hole_of_a_frame():
    frame = Body(framed(UNIT), density=2650.0, fixed=True)
    disk = Body(Sphere(0.8 * UNIT), (0.3 * UNIT, 0.0), density=2650.0)
    forces = [Gravity(), StokesDrag(), CONTACT]
    found = finished(System([disk, frame], forces, fluid=WATER), 1.0)
    sunk = 9.81 * disk.buoyant_mass(WATER) / 20.0
    assert found.position[-1, 0, 1] + 2.0 * UNIT - 0.8 * UNIT == pytest.approx(
        -sunk, abs=1e-4 * sunk
    )


@pytest.mark.slow
def test_swarms_of_compounds_end_as_one_run_does():
    shapes = [framed(UNIT), beads(1.5 * UNIT), Sphere(2.0 * UNIT), Sphere(5.0 * UNIT)]
    bodies = [
        Body(shapes[k % 4], (26e-6 * (k % 3), 24e-6 * (k // 3)), 0.7 * k, density=2650.0)
        for k in range(9)
    ]
    forces = [Gravity(), StokesDrag(), VanDerWaals(1e-19, gap="surface", cut=1e-6), CONTACT]
    swarm = finished(Swarm(bodies, forces, fluid=WATER), 0.2)
    one = finished(System(bodies, forces, fluid=WATER), 0.2)
    assert len(swarm.neighbours().pairs) > 0
    assert furthest(swarm.position[-1], one.position[-1]) < 1e-9 + swarm.error[-1] + one.error
