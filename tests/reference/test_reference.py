"""Forces of the reference against gradients of potentials and the signs of the laws.

Its symmetries are those of the engine, which agrees with it: tests/forces/test_symmetry.py.
"""

from dataclasses import replace

import numpy as np
import pytest

from tests.reference.contacts import measure, pairs_of
from tests.reference.forces import Contact, Drag, VanDerWaals, loads, reduced
from tests.reference.samples import (
    SEEDS,
    VISCOSITY,
    scene_of,
)


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
