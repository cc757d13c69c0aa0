"""Energy, momentum and angular momentum over many contacts of non-convex bodies.

A weak spring along the line of centres brings the bodies back; nothing dissipates.
"""

import attrs
import numpy as np
import pytest

from flocsim import Body, System
from flocsim.forces import Contact
from flocsim.integrators import Implicit, VelocityVerlet
from tests.helpers.methods import by_adaptive
from tests.helpers.trial_scenes import (
    ELASTIC,
    Spring,
    comb,
    hook,
    kinetic_energy,
    momenta,
    star,
    watched,
)
from tests.reference import shapes as plain
from tests.reference.contacts import contacts

SPRING = Spring(stiffness=0.1, rest=-6e-6)
SPEED, ARM = 0.02, 1e-5


def tied():
    """A star and a hook in each other's reach, turning."""
    left = Body(star(), velocity=(SPEED, 0.0), spin=5e2, surface_density=2.0)
    right = Body(hook(), (17e-6, -3e-6), 1.0, (-SPEED, 0.0), surface_density=2.0)
    return [left, right]


def plain_scene(bodies, position, velocity):
    """The bodies as a scene of the independent reference."""
    made = [
        plain.Body(np.array(b.shape.vertices), b.shape.radius, b.mass, b.inertia,
                   b.shape.equivalent_radius)
        for b in bodies
    ]  # fmt: skip
    return plain.Scene(tuple(made), position, velocity)


def energy(bodies, position, velocity):
    """Kinetic + ½ k_n Σ Δ² of all vertex–edge pairs + that of the spring [J]."""
    overlaps = contacts(plain_scene(bodies, position, velocity)).overlap
    distance = np.hypot(*(position[0] - position[1])[:2])
    stretch = distance - sum(b.shape.equivalent_radius for b in bodies) - SPRING.rest
    elastic = 0.5 * ELASTIC.k_n * np.sum(overlaps**2) + 0.5 * SPRING.stiffness * stretch**2
    return kinetic_energy(bodies, velocity) + elastic


def drift(integrator, until):
    """(contacts, energy's relative change, momenta's change in units of m v and m v · 10 µm)."""
    system = System(tied(), [ELASTIC, SPRING], integrator)
    start, end = system.motion(), watched(system, until)
    assert end.status.name == "FINISHED"
    energies = [energy(system.bodies, *m) for m in (start, (end.position, end.velocity))]
    change = momenta(system.bodies, end.position, end.velocity) - momenta(system.bodies, *start)
    unit = system.bodies[0].mass * SPEED * np.array([1.0, 1.0, ARM])
    return end.contacts, energies[1] / energies[0] - 1.0, np.abs(change / unit).max()


@by_adaptive
def test_adaptive_methods_lose_less_energy_at_a_finer_tolerance(integrator):
    # Over three decades: what is lost at one tolerance may be next to nothing by chance.
    settings = [attrs.evolve(integrator, tolerance=tolerance) for tolerance in (1e-9, 1e-12)]
    coarse, fine = (drift(setting, 1.5e-3) for setting in settings)
    assert min(coarse[0], fine[0]) >= 25
    # How much is chance: other last digits, as of another processor, lead to other collisions.
    assert abs(fine[1]) < 1e-4
    assert abs(fine[1]) < 0.02 * abs(coarse[1])
    assert coarse[2] < 1e-4 and fine[2] < 1e-6


def pressed_combs(teeth):
    """Two combs that are pushed against each other, and along, all teeth tip to tip."""
    shape = comb(teeth)
    height = 2.0 * (shape.vertices[:, 1].max() + shape.radius) - 1e-9
    lower = Body(shape, velocity=(0.0, SPEED), surface_density=2.0)
    upper = Body(shape, (0.0, height), np.pi, (1e-3, -SPEED), surface_density=2.0)
    return [lower, upper]


@pytest.mark.parametrize("teeth", [3, 15, 31])
def test_momentum_stays_with_hundreds_of_contacts_at_once(teeth):
    """N = 14, 62, 126; explicit codes that keep few contacts lose momentum from N = 16 on."""
    bodies = pressed_combs(teeth)
    system = System(bodies, [Contact(k_n=20.0, k_t=2.0), SPRING], Implicit(tolerance=1e-12))
    end = watched(system, 1e-6, capacity=1024)
    assert end.status.name == "FINISHED"
    touching = contacts(plain_scene(bodies, end.position, end.velocity)).overlap
    assert len(touching) >= 4 * teeth
    change = momenta(bodies, end.position, end.velocity) - momenta(bodies, *system.motion())
    scaled = np.abs(change) / (bodies[0].mass * SPEED * np.array([1.0, 1.0, teeth * 5e-6]))
    assert scaled[:2].max() < 1e-13
    assert scaled[2] < 1e-7


@pytest.mark.slow
@pytest.mark.parametrize(
    ("integrator", "seconds", "fewest", "energy", "momentum"),
    [
        # 1.1e-5 of angular momentum, 1e-10 a contact: ends on the cubic keep only momentum exactly.
        (Implicit(tolerance=1e-12), 4.2, 100_000, 1e-3, 3e-5),
        (VelocityVerlet(2.5e-8), 4.2, 100_000, 0.03, 1e-8),
        (Implicit(tolerance=1e-13), 0.04, 1000, 1e-4, 1e-6),
    ],
    ids=["Implicit-100000", "VelocityVerlet-100000", "Implicit-1000"],
)
def test_many_contacts_keep_energy_and_momentum(integrator, seconds, fewest, energy, momentum):
    count, energy_change, momenta_change = drift(integrator, seconds)
    assert count >= fewest
    assert abs(energy_change) < energy
    assert momenta_change < momentum
