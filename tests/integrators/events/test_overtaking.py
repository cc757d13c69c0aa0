"""Boxes that attract a floor and touch it with one corner after the other."""

import math

import pytest

from flocsim import Body, Fluid, SpheroPolygon, System
from flocsim.forces import Contact, Gravity, StokesDrag, VanDerWaals
from flocsim.integrators import Implicit, Status

OVERLAP = 0.9e-9
"""About that of a corner that bears the attraction [m]."""


def outline(x, y):
    """A box of these half sides [m]."""
    return SpheroPolygon([(-x, -y), (x, -y), (x, y), (-x, y)], 5e-7)


def tilted(angle, spin, tolerance=1e-9):
    """The System of a box on a floor, one of its lower corners pressed."""
    height = 4e-6 + 5e-6 * math.sin(abs(angle)) - OVERLAP
    bodies = [
        Body(outline(3e-5, 1e-6), fixed=True, density=2650.0),
        Body(outline(5e-6, 2e-6), (0.0, height), angle=angle, spin=spin, density=2650.0),
    ]
    attraction = VanDerWaals(hamaker=4.7e-20, gap="surface", cut=1e-6)
    forces = [Gravity(), StokesDrag(), attraction, Contact()]
    return System(bodies, forces, Implicit(tolerance), Fluid(buoyancy=True))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_corner_that_touches_gently_does_not_draw_the_attraction_to_itself(side):
    """The box tilts until its other corner touches, far too slowly to tip over on to that one: both
    rests are nearer to each other than the tolerance."""
    angles = []
    for tolerance in (1e-9, 1e-12):
        run = tilted(side * 3e-4, side * -5.0, tolerance).run(1e-3, jit=False)
        assert run.status == Status.FINISHED
        angles.append(side * run.position[-1, 1, 2])
    assert angles[0] == pytest.approx(angles[1], rel=1e-3)
    assert angles[0] > 1e-5
