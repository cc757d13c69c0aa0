"""Frames that go with the contacts: a doublet that turns costs no more for being stiffer."""

import numpy as np
import pytest

import flocsim.arrays as at
from flocsim import Body, Fluid, Sphere
from flocsim.arrays import work_of
from flocsim.body import scene_of
from flocsim.forces import Contact, VanDerWaals
from flocsim.integrators import Implicit
from flocsim.integrators.radau.contact_frames import add_shifts, force_back, shift_at, velocity_on
from tests.helpers.trial_scenes import PolygonSystem, star

SPHERE = Sphere(5e-6)
TURN = 20.0
"""Angular velocity [rad/s] of the doublet."""


def turning_doublet(shape, k_n):
    """Two sticking bodies that turn about each other with nothing else around, for two turns."""
    reach = shape.bounding_radius
    bodies = [
        Body(shape, (-reach, 0.0), 0.0, (0.0, -TURN * reach), TURN, density=2650.0),
        Body(shape, (reach, 0.0), np.pi, (0.0, TURN * reach), TURN, density=2650.0),
    ]
    forces = [VanDerWaals(4.7e-20, gap="surface"), Contact(k_n=k_n, k_t=0.1 * k_n)]
    return bodies, PolygonSystem(bodies, forces, Implicit(1e-9)).run(4 * np.pi / TURN)


@pytest.mark.slow
@pytest.mark.parametrize("shape", [SPHERE, star(size=5e-6)], ids=["spheres", "stars"])
def test_stiffness_does_not_add_steps(shape):
    soft, stiff = (turning_doublet(shape, k_n)[1] for k_n in (1e2, 1e6))
    assert soft.status.name == stiff.status.name == "FINISHED"
    assert stiff.steps < 4 * soft.steps
    assert stiff.evaluations < 4 * soft.evaluations


@pytest.mark.parametrize("shape", [SPHERE, star(size=5e-6)], ids=["spheres", "stars"])
def test_doublet_keeps_its_momentum(shape):
    bodies, found = turning_doublet(shape, 1e4)
    momentum = sum(body.mass * found.velocity[:, k, :2] for k, body in enumerate(bodies))
    assert np.abs(momentum).max() < 1e-12 * bodies[0].mass * TURN * shape.bounding_radius


def framed():
    """(scene, work) of two free bodies of one cluster, with some frame at stage 1."""
    bodies = [Body(SPHERE, (0.0, 0.0), density=2650.0), Body(SPHERE, (1e-5, 0.0), density=1500.0)]
    scene = scene_of(bodies, Fluid(), [])
    work = work_of(scene, np.zeros((2, 3)), np.zeros((2, 3)))
    turn, frame = 0.3, at.FRAMES + at.FRAME_COLUMNS
    shifts = 1e-6 * np.random.default_rng(1).normal(size=(2, 2))
    work.bodies[:, frame : frame + at.FRAME_COLUMNS] = [
        [np.cos(turn), np.sin(turn), *s] for s in shifts
    ]
    work.cluster[:] = 0
    return scene, work


def test_shifts_change_no_momentum_but_relative_velocities_by_what_spin_makes_of_them():
    scene, work = framed()
    before = np.random.default_rng(2).normal(size=(2, 3))
    work.motion[at.CHANGE, :, 3:] = before
    add_shifts(scene, work, 1)
    change = work.motion[at.CHANGE, :, 3:] - before
    masses = scene.bodies[:, at.MASS]
    assert np.abs(masses @ change).max() < 1e-15 * masses.sum()
    shifts = np.array([shift_at(work, body, 1) for body in range(2)])
    expected = before[0, 2] * shifts[0] - before[1, 2] * shifts[1]
    assert np.allclose(change[0, :2] - change[1, :2], expected, rtol=1e-9, atol=0.0)


def test_force_in_the_frame_has_the_same_power():
    _, work = framed()
    x, y, spin, fx, fy, torque = np.random.default_rng(3).normal(size=6)
    there = np.array(velocity_on(work, 0, 1, x, y))
    there += spin * np.array(shift_at(work, 0, 1))
    gx, gy, other = force_back(work, 0, 1, fx, fy, torque)
    power = there @ [fx, fy] + spin * torque
    assert power == pytest.approx(gx * x + gy * y + other * spin, rel=1e-12)
