"""Stick and slide: Coulomb's law along a floor."""

import numpy as np
import pytest

from flocsim import Body, Sphere, SpheroPolygon, System
from flocsim.forces import Contact, Gravity, StokesDrag
from flocsim.integrators import DormandPrince54, Implicit, Status

RADIUS, BALL, MU = 1e-6, 2e-6, 0.3
FLOOR = SpheroPolygon([(-1e-4, 0.0), (1e-4, 0.0)], RADIUS)


@pytest.mark.parametrize(
    "method", [Implicit(1e-9), pytest.param(DormandPrince54(1e-10), marks=pytest.mark.slow)]
)
def test_a_pushed_ball_slides_as_coulomb_says(method):
    """Thrown along a floor in water without rolling resistance it slides until it rolls: the same
    for both methods, and the same mirrored."""
    ends = []
    for side in (1.0, -1.0):
        floor = Body(FLOOR, fixed=True, surface_density=2.0)
        rest = RADIUS + BALL - np.pi * BALL**2 * 2.0 * 9.81 / 20.0
        ball = Body(Sphere(BALL), (0.0, rest), velocity=(side * 0.01, 0.0), surface_density=2.0)
        law = Contact(k_n=20.0, k_t=2.0, friction=MU)
        run = System([floor, ball], [Gravity(), law], method).run(2e-3, max_steps=200_000)
        assert run.status == Status.FINISHED
        ends.append(run.position[-1, 1, 0] * side)
        rolling = run.velocity[-1, 1, 0] + BALL * run.velocity[-1, 1, 2]
        assert abs(rolling) < 1e-4
        # A disk that slides until it rolls keeps two thirds of its speed.
        assert run.velocity[-1, 1, 0] == pytest.approx(side * 0.01 * 2.0 / 3.0, rel=2e-3)
    assert ends[0] == pytest.approx(ends[1], rel=1e-6)


def test_drag_and_friction_together_come_to_rest():
    floor = Body(FLOOR, fixed=True, surface_density=2.0)
    box = SpheroPolygon([(-3e-6, -1e-6), (3e-6, -1e-6), (3e-6, 1e-6), (-3e-6, 1e-6)], 5e-7)
    body = Body(box, (0.0, RADIUS + 1.5e-6), velocity=(5e-3, 0.0), surface_density=2.0)
    forces = [Gravity(), StokesDrag(), Contact(friction=MU)]
    run = System([floor, body], forces, Implicit()).run(5e-3, max_steps=5000)
    assert run.status == Status.FINISHED
    assert np.abs(run.velocity[-1, 1, [0, 1]]).max() < 1e-8
