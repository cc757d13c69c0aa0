"""Forces held against Newton's third law, symmetries, and gradients of potentials."""

from dataclasses import replace

import numpy as np
import pytest

from tests.reference.contacts import measure, pairs_of
from tests.reference.forces import Contact, Drag, VanDerWaals, loads, reduced
from tests.reference.samples import (
    CONTACT,
    PAIR_LAWS,
    SEEDS,
    VISCOSITY,
    displacements,
    scene_of,
)
from tests.reference.shapes import Scene, rotation


@pytest.mark.parametrize("seed", SEEDS)
def test_pair_forces_leave_momentum_and_angular_momentum_alone(seed):
    scene = scene_of(seed)
    for law in PAIR_LAWS:
        total = loads(scene, [law], displacements(scene) if law is CONTACT else None)
        scale = np.abs(total[:, :2]).max() + 1e-30
        x, y, _ = scene.positions.T
        moments = x * total[:, 1] - y * total[:, 0] + total[:, 2]
        assert np.abs(total[:, :2].sum(axis=0)).max() < 1e-12 * scale
        assert abs(moments.sum()) < 1e-12 * scale * 1e-4


def turned(scene, angle, shift):
    """The scene turned about the origin and shifted."""
    turn = rotation(angle)
    positions, velocities = scene.positions.copy(), scene.velocities.copy()
    positions[:, :2] = positions[:, :2] @ turn.T + shift
    positions[:, 2] += angle
    velocities[:, :2] = velocities[:, :2] @ turn.T
    return Scene(scene.bodies, positions, velocities)


@pytest.mark.parametrize("seed", SEEDS)
def test_turning_and_shifting_the_scene_turns_the_forces(seed):
    scene, history = scene_of(seed), displacements(scene_of(seed))
    before = loads(scene, PAIR_LAWS, history)
    after = loads(turned(scene, 2.1, [3e-5, -1e-5]), PAIR_LAWS, history)
    before[:, :2] = before[:, :2] @ rotation(2.1).T
    assert_same_loads(after, before)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_mirrored_scene_has_mirrored_forces(seed):
    scene, history = scene_of(seed), displacements(scene_of(seed))
    flip, turn = np.array([-1.0, 1.0]), np.array([-1.0, 1.0, -1.0])
    bodies = tuple(replace(body, vertices=body.vertices * flip) for body in scene.bodies)
    mirrored = Scene(bodies, scene.positions * turn, scene.velocities * turn)
    opposite = {key: -xi for key, xi in history.items()}
    assert_same_loads(loads(mirrored, PAIR_LAWS, opposite), loads(scene, PAIR_LAWS, history) * turn)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_order_of_bodies_and_vertices_does_not_matter(seed):
    scene = scene_of(seed)
    bodies = tuple(
        replace(body, vertices=np.roll(body.vertices, 1, axis=0)) for body in scene.bodies[::-1]
    )
    swapped = Scene(bodies, scene.positions[::-1], scene.velocities[::-1])
    assert_same_loads(loads(swapped, PAIR_LAWS)[::-1], loads(scene, PAIR_LAWS))


def assert_same_loads(found, expected):
    for columns, arm in ((slice(0, 2), 1.0), (slice(2, 3), 1e-5)):
        tolerance = 1e-10 * arm * np.abs(expected[:, :2]).max()
        assert np.abs(found[:, columns] - expected[:, columns]).max() <= tolerance


@pytest.mark.parametrize("seed", SEEDS)
def test_elastic_force_is_minus_the_gradient_of_the_energy(seed):
    elastic = Contact(k_n=20.0, k_t=0.0, damping_n=0.0)
    gradient = gradient_of(elastic.energy, scene_of(seed))
    assert_gradient(loads(scene_of(seed), [elastic]), gradient)


@pytest.mark.parametrize("seed", SEEDS)
def test_surface_attraction_is_minus_the_gradient_of_its_potential(seed):
    scene, law = (
        scene_of(seed),
        VanDerWaals(1e-18, d_min=2e-6, gap="surface", smoothing=(1e-8, 0.0, 0.0)),
    )

    def potential(moved):
        """∫ of eq. 5 with its cut-off: F d up to d_min, 1/d beyond."""
        total = 0.0
        for i, j in [(0, 1), (0, 2), (1, 2)][: 1 if len(moved.bodies) == 2 else 3]:
            radii = [moved.bodies[k].equivalent_radius for k in (i, j)]
            d, strength = smooth_gap(moved, i, j, 1e-8), law.hamaker * reduced(*radii) / 6
            flat = strength * (d - law.d_min) / law.d_min**2 - strength / law.d_min
            total += flat if d < law.d_min else -strength / d
        return total

    assert_gradient(loads(scene, [law]), gradient_of(potential, scene))


def smooth_gap(scene, i, j, smoothing):
    """The soft minimum of the gaps of all pairs of two bodies [m]."""
    gaps = -measure(scene, pairs_of(scene.bodies, i, j)).overlap
    return gaps.min() - smoothing * np.log(np.exp((gaps.min() - gaps) / smoothing).sum())


def gradient_of(energy, scene):
    """Central differences over x, y [m] and θ [rad] of every body."""
    gradient = np.zeros_like(scene.positions)
    for place in np.ndindex(gradient.shape):
        step = np.zeros_like(gradient)
        step[place] = 1e-11 if place[1] < 2 else 1e-6
        ahead, behind = (replace(scene, positions=scene.positions + s * step) for s in (1, -1))
        gradient[place] = (energy(ahead) - energy(behind)) / (2 * step[place])
    return gradient


def assert_gradient(force, gradient):
    scale = np.abs(force[:, :2]).max() + 1e-30
    assert np.abs(force + gradient)[:, :2].max() <= 1e-4 * scale
    assert np.abs(force + gradient)[:, 2].max() <= 1e-4 * scale * 1e-5


def test_contact_law_signs_and_limits():
    mass, critical = 1e-10, 2 * np.sqrt(20.0 / 1e-10)
    law = Contact(k_n=20.0, k_t=2.0)
    assert law.damping(mass) == pytest.approx((critical, critical / 10))
    assert law.components(mass, 1e-7, 1e-8, 0.0, 0.0) == pytest.approx((2e-6, -2e-8))
    approaching, sliding = law.components(mass, 0.0, 0.0, -1e-3, 1e-3)
    assert [approaching, sliding] == pytest.approx(
        [mass * critical * 1e-3, -mass * critical * 1e-4]
    )
    assert law.components(mass, 1e-9, 0.0, 1.0, 0.0)[0] < 0
    clipped = replace(law, tension=False, friction=0.1)
    assert clipped.components(mass, 1e-9, 1e-6, 1.0, 0.0) == (0.0, 0.0)
    assert clipped.components(mass, 1e-7, 1e-3, 0.0, 0.0) == pytest.approx((2e-6, -2e-7))


def test_settling_body_at_rest_with_the_flow():
    scene = replace(scene_of(0), velocities=np.zeros((len(scene_of(0).bodies), 3)))
    gradient = np.array([[0.3, -0.2], [0.6, -0.3]])
    flow = np.array([1e-3, 2e-3])
    scene.velocities[:, :2] = scene.positions[:, :2] @ gradient.T + flow
    scene.velocities[:, 2] = 0.4
    assert loads(scene, [Drag(VISCOSITY, True, flow, gradient)]) == pytest.approx(0.0, abs=1e-24)
    r = scene.bodies[0].equivalent_radius
    torque = loads(scene, [Drag(VISCOSITY)])[0, 2]
    assert torque == pytest.approx(-8 * np.pi * VISCOSITY * r**3 * 0.4)
    assert loads(scene, [Drag(VISCOSITY, rotational=False)])[0, 2] == 0.0
