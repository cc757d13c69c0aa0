"""Events of a contact law: where a sliding contact parts."""

import numpy as np
import pytest

from flocsim import Body, Sphere, System
from flocsim.forces import Contact
from flocsim.integrators import Implicit
from flocsim.state.bodies import ANGLE, Y

RADIUS = 5e-6


@pytest.mark.parametrize("friction", [0.1, 0.3, 1.0])
def test_a_sliding_sphere_that_is_thrown_off_keeps_the_same_motion_at_any_tolerance(friction):
    """µ and no tension: the impact slides, then parts; the end converges with the tolerance."""
    still = Body(Sphere(RADIUS), fixed=True, surface_density=2.0)
    flying = Body(Sphere(RADIUS), (1e-6, 2.0 * RADIUS), velocity=(0.02, -0.05), surface_density=2.0)
    contact = Contact(k_n=20.0, k_t=2.0, damping_n=2e4, friction=friction, tension=False)
    ends = [
        System([still, flying], [contact], Implicit(tolerance)).run(1e-4, jit=False)
        for tolerance in (1e-9, 1e-11)
    ]
    assert all(end.status.name == "FINISHED" for end in ends)
    apart = np.abs(ends[0].position[-1, 1] - ends[1].position[-1, 1])
    assert ends[1].position[-1, 1, Y] > 2.0 * RADIUS
    assert apart[:2].max() < 1e-9
    assert ends[1].velocity[-1, 1, ANGLE] != 0.0
