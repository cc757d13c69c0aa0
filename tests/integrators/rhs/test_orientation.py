"""Forces and torques by how bodies are turned: what is kept, dipoles, and runs."""

import math

import attrs
import numpy as np
import pytest

from flocsim import Body, Sphere, SpheroPolygon, System
from flocsim.errors import UsageError
from flocsim.fields import quantity
from flocsim.forces import OrientedForce, StokesDrag
from flocsim.integrators import DormandPrince54
from flocsim.integrators.rhs.outline_sum import outline_forces_at
from flocsim.state.work import work_of
from flocsim.swarms.swarm import Swarm

MOMENT = 2e-33
"""µ²/(4πε) of two dipoles [J m³]."""


@attrs.frozen
class Dipoles(OrientedForce):
    """U = µ²/(4πε d³) (cos(α_i − α_j) − 3 cos α_i cos α_j), dipoles along the bodies' own x."""

    moment: float = quantity("J m^3", default=MOMENT)

    @staticmethod
    def kernel(pair, moment):
        along = math.cos(pair.angle_i) * math.cos(pair.angle_j)
        facing = math.cos(pair.angle_i - pair.angle_j) - 3.0 * along
        return moment * facing / pair.centre_distance**3


ROD = SpheroPolygon(np.array([(-2, -0.3), (2, -0.3), (2, 0.3), (-2, 0.3)]) * 1e-6, 1e-7)


def system_of(x, y, angle_j, angle_i=0.0, shape=None, **more):
    shape = shape or Sphere(1e-6)
    bodies = [
        Body(shape, (0.0, 0.0), angle_i, density=2000.0),
        Body(shape, (x, y), angle_j, density=2000.0),
    ]
    return System(bodies, [Dipoles()], **more)


def loads(x, y, angle_j, angle_i=0.0, shape=None):
    """(fx, fy, torque on j, torque on i) where bodies lie so, uncompiled."""
    system = system_of(x, y, angle_j, angle_i, shape)
    scene = system.scene(jit=False)
    work = work_of(scene, *system.motion())
    return np.array(outline_forces_at(scene, work, 0.0, 1, 0, x, y, angle_j, angle_i))


def energy(x, y, angle_j, angle_i):
    bearing, distance = math.atan2(y, x), math.hypot(x, y)
    one, other = angle_i - bearing, angle_j - bearing
    facing = math.cos(one - other) - 3.0 * math.cos(one) * math.cos(other)
    return MOMENT * facing / distance**3


@pytest.mark.parametrize("seed", range(6))
def test_they_are_the_slopes_of_the_energy_and_keep_angular_momentum(seed):
    x, y, angle_j, angle_i = np.random.default_rng(seed).uniform(-3.0, 3.0, 4) * [2e-6, 2e-6, 1, 1]
    found, by = loads(x, y, angle_j, angle_i), np.array([1e-11, 1e-11, 1e-5, 1e-5])
    place, strength = np.array([x, y, angle_j, angle_i]), MOMENT / math.hypot(x, y) ** 4
    for axis, step in enumerate(np.diag(by)):
        slope = (energy(*(place - step)) - energy(*(place + step))) / (2.0 * by[axis])
        size = strength if axis < 2 else strength * math.hypot(x, y)
        assert found[axis] == pytest.approx(slope, abs=1e-6 * size)
    moment = x * found[1] - y * found[0]
    assert found[2] + found[3] == pytest.approx(-moment, abs=1e-12 * strength * math.hypot(x, y))


def test_dipoles_in_line_attract_and_side_by_side_repel():
    distance = 3e-6
    unit = 3.0 * MOMENT / distance**4
    assert loads(distance, 0.0, 0.0)[:2] == pytest.approx([-2.0 * unit, 0.0], rel=1e-6)
    assert loads(0.0, distance, 0.0)[:2] == pytest.approx([0.0, unit], rel=1e-6, abs=1e-9 * unit)
    # One turned by 90°: the torques 2 and 1 of µ²/(4πε d³), and a force across.
    fx, fy, torque_j, torque_i = loads(distance, 0.0, 0.5 * math.pi)
    unit = MOMENT / distance**3
    assert [torque_j, torque_i] == pytest.approx([-2.0 * unit, -unit], rel=1e-6)
    assert [fx, fy] == pytest.approx([0.0, 3.0 * unit / distance], abs=1e-6 * unit / distance)


def test_turned_mirrored_or_with_names_changed_nothing_else_changes():
    x, y, angle_j, angle_i = 2.5e-6, 1e-6, 0.7, -0.4
    here, c, s = loads(x, y, angle_j, angle_i), math.cos(1.1), math.sin(1.1)
    size = np.hypot(*here[:2]) * np.array([1.0, 1.0, 3e-6, 3e-6])
    there = loads(c * x - s * y, s * x + c * y, angle_j + 1.1, angle_i + 1.1)
    turned = [c * here[0] - s * here[1], s * here[0] + c * here[1], *here[2:]]
    mirrored = loads(x, -y, -angle_j, -angle_i)
    swapped = loads(-x, -y, angle_i, angle_j)
    for found, wanted in (
        (there, turned), (mirrored, [here[0], -here[1], -here[2], -here[3]]),
        (swapped, [-here[0], -here[1], here[3], here[2]]),
    ):  # fmt: skip
        assert np.all(abs(found - np.array(wanted)) < 1e-8 * size)


@pytest.mark.parametrize("shape", [Sphere(1e-6), ROD], ids=["spheres", "rods"])
def test_two_dipoles_turn_into_line_and_no_energy_is_made(shape):
    """Without drag energy is kept; with it two that lie askew end in line."""
    start = (1e-6, 6e-6, 0.4, 1.4)
    free = system_of(*start, shape=shape, integrator=DormandPrince54())
    run = free.run(until=3e-5, jit=False)
    energies = run.energies()
    kinetic = float(np.sum(energies.kinetic[-1] - energies.kinetic[0]))
    x, y = (run.position[-1, 1] - run.position[-1, 0])[:2]
    potential = energy(x, y, *run.position[-1, ::-1, 2]) - energy(*start)
    assert kinetic > 0.0
    assert kinetic == pytest.approx(-potential, rel=1e-4)
    spin = sum(body.inertia * run.velocity[-1, n, 2] for n, body in enumerate(free.bodies))
    arm = sum(
        body.mass * (run.position[-1, n, 0] * run.velocity[-1, n, 1]
                     - run.position[-1, n, 1] * run.velocity[-1, n, 0])
        for n, body in enumerate(free.bodies)
    )  # fmt: skip
    assert spin + arm == pytest.approx(0.0, abs=1e-4 * abs(spin))


def test_they_are_explained_and_refused_where_only_distances_are_known():
    words = system_of(3e-6, 0.0, 0.0).explain()
    assert "the angles of both bodies" in words
    bodies = [Body(Sphere(1e-6), density=2000.0), Body(Sphere(1e-6), (1e-5, 0.0), density=2000.0)]
    with pytest.raises(
        UsageError, match="Dipoles depends on the angles of the bodies, but a swarm can only have"
    ):
        Swarm(bodies, [Dipoles(), StokesDrag()])
