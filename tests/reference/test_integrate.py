"""Motion against closed forms and conservation laws."""

import numpy as np
import pytest

from tests.helpers.tiers import rest_slow
from tests.reference.closed_forms import impact
from tests.reference.contacts import OverlapTooDeepError, contacts
from tests.reference.forces import Contact
from tests.reference.integrate import simulate
from tests.reference.motion import hand_over
from tests.reference.samples import random_core, scene_of, spheres
from tests.reference.scenes import spiral, star
from tests.reference.shapes import Scene, make_body


@pytest.mark.parametrize(
    ("ratio", "tension"), [(0.2, True), (0.5, True), (0.2, False), (1.5, False)]
)
def test_head_on_spheres_bounce_as_one_spring(ratio, tension):
    scene = spheres(10.001e-6, 1e-3)
    frequency = np.sqrt(20.0 / (scene.bodies[0].mass / 2))
    law = Contact(20.0, 2.0, damping_n=2 * ratio * frequency, tension=tension)
    motion = simulate(scene, [law], 1e-6 + 30 / frequency)
    parting = motion.velocities[-1, 1, 0] - motion.velocities[-1, 0, 0]
    assert parting == pytest.approx(1e-3 * impact(ratio, tension)[0], rel=1e-7)
    assert motion.displacement == {}


def ragged_encounter():
    """A spiral and a turning star run into each other off their middles, and slide and roll."""
    star_body = make_body(6e-6 * random_core(star, np.random.default_rng(5)), 1e-6, 2.0)
    hook = make_body(8e-6 * random_core(spiral, np.random.default_rng(2)), 0.8e-6, 2.0)
    positions = np.array([[0.0, 0.0, 0.0], [20e-6, -4e-6, 1.0]])
    return Scene((star_body, hook), positions, np.array([[0.05, 0, 2e3], [-0.05, 0, 0]]))


def scenes_along(motion):
    return [motion.scene(k) for k in range(len(motion.t))]


def kinetic_energy(scene):
    masses = np.array([[b.mass, b.mass, b.inertia] for b in scene.bodies])
    return 0.5 * np.sum(masses * scene.velocities**2)


def momenta(scene):
    """Momentum (2,) [kg m/s] and angular momentum about the origin [kg m²/s]."""
    masses = np.array([b.mass for b in scene.bodies])
    spin = sum(b.inertia * w for b, w in zip(scene.bodies, scene.velocities[:, 2], strict=True))
    (x, y, _), (vx, vy, _) = scene.positions.T, scene.velocities.T
    return np.array([*(masses @ scene.velocities[:, :2]), masses @ (x * vy - y * vx) + spin])


def assert_same_momenta(motion):
    scale = motion.bodies[0].mass * 0.1 * np.array([1.0, 1.0, 1e-5])
    assert np.all(np.abs(momenta(motion.scene()) - momenta(motion.scene(0))) < 1e-12 * scale)


@pytest.mark.slow
def test_ragged_bodies_conserve_energy_and_momenta():
    law = Contact(20.0, 0.0, damping_n=0.0)
    motion = simulate(ragged_encounter(), [law], 2e-4, max_step=2e-6)
    kinetic = np.array([kinetic_energy(scene) for scene in scenes_along(motion)])
    elastic = np.array([law.energy(scene) for scene in scenes_along(motion)])
    assert len(motion.events) >= 10
    assert elastic.max() > 0.5 * kinetic[0]
    assert kinetic + elastic == pytest.approx(kinetic[0], rel=1e-7)
    assert_same_momenta(motion)


def test_tangential_history_and_damping_lose_energy_but_no_momentum():
    motion = simulate(ragged_encounter(), [Contact(20.0, 2.0, 1e4)], 2e-4, max_step=2e-6)
    assert kinetic_energy(motion.scene()) < 0.9 * kinetic_energy(motion.scene(0))
    assert_same_momenta(motion)


def test_displacement_is_the_path_slid():
    """A ball held against a bar by overlap, too heavy to be slowed, slides along it."""
    bar = make_body([[-9e-6, 0.0], [9e-6, 0.0]], 1e-6, surface_density=1e6)
    ball = make_body([[0.0, 0.0]], 2e-6, surface_density=1e6)
    scene = Scene((bar, ball), np.array([[0, 0, 0], [0, 2.9e-6, 0]]), np.zeros((2, 3)))
    scene.velocities[1, 0] = 1e-3
    motion = simulate(scene, [Contact(1e-9, 1e-9, 0.0)], 1e-3, {(1, 0, 0, 0): 3e-7})
    # The tangent is −x: the normal points up, from the bar to the ball.
    assert motion.displacement == {(1, 0, 0, 0): pytest.approx(3e-7 - 1e-6, rel=1e-6)}


@pytest.mark.parametrize("seed", rest_slow(range(40), lambda seed: seed < 12))
def test_hand_over_keeps_the_tangential_force_as_far_as_energy_allows(seed):
    scene = scene_of(seed)
    pairs = contacts(scene)
    if len(pairs.overlap) < 2:
        return
    same = np.flatnonzero([set(p) == set(pairs.pair[0, ::2]) for p in pairs.pair[:, ::2]])
    before = np.random.default_rng(seed).normal(size=len(pairs.overlap))
    after = before.copy()
    hand_over(scene.bodies, pairs, 0, same[1:], after)
    assert after[0] == 0.0 and np.sum(after**2) <= np.sum(before**2) * (1.0 + 1e-12)
    changed = np.flatnonzero(after[1:] != before[1:]) + 1
    if not changed.size:
        return
    heir = changed[0]
    side = np.where(pairs.pair[:, 0] == pairs.pair[0, 0], 1.0, -1.0)[same, None]
    forces = [np.sum(side * xi[same, None] * pairs.tangent[same], axis=0) for xi in (before, after)]
    jump = (forces[1] - forces[0]) @ pairs.tangent[heir]
    if np.sum(after**2) < np.sum(before**2) * (1.0 - 1e-12):
        assert jump == pytest.approx(0.0, abs=1e-14)
    assert abs(after[heir]) <= np.hypot(before[0], before[heir]) * (1.0 + 1e-12)


def test_bodies_that_pass_through_each_other_are_reported():
    scene, feeble = spheres(10.5e-6, 1.0), Contact(1e-6, 0.0, 0.0)
    with pytest.raises(OverlapTooDeepError):
        simulate(scene, [feeble], 1e-4)
    with pytest.raises(RuntimeError, match="unseen"):
        simulate(scene, [feeble], 1e-4, max_step=1.0)
