"""Frames that go with the contacts: a doublet that turns costs no more for being stiffer."""

import numpy as np
import pytest

from flocsim import Body, Sphere
from flocsim.forces import Contact, VanDerWaals
from flocsim.integrators import Implicit
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
    # Twenty to a hundred and sixty roundings a step at stiffnesses near this one, by chance; a step
    # that did not keep it would lose 1e-9 of it.
    rounding = 500.0 * np.finfo(float).eps * found.steps
    assert np.abs(momentum).max() < rounding * bodies[0].mass * TURN * shape.bounding_radius
