"""A doublet in the narrow well between surface attraction and contact: stiff, and for long.

Real masses in water: the contact vibrates at about 1e6 rad/s, the runs last up to 10 s.
"""

import numpy as np
import pytest

from flocsim import Body, Fluid, Sphere
from flocsim.forces import Contact, DoubleLayer, Gravity, StokesDrag, VanDerWaals
from flocsim.integrators import Implicit
from tests.helpers.trial_scenes import PolygonSystem, hook, star
from tests.reference import shapes as plain
from tests.reference.contacts import surface_gap

WATER = Fluid(buoyancy=True)
ATTRACTION = VanDerWaals(4.7e-20, gap="surface")
REPULSION = DoubleLayer(15e-3, 0.98e-9, gap="surface")
LAW = Contact(k_n=20.0, k_t=2.0)
FORCES = [Gravity(), StokesDrag(), ATTRACTION, REPULSION, LAW]
PAIRS = {
    "spheres": (Sphere(4.62e-6), Sphere(4.95e-6)),
    "stars": (star(size=4e-6), star(size=4.5e-6)),
    "star_on_hook": (hook(), star()),
}


def gap_of(shapes, position):
    """Distance of the outlines [m] by the independent reference; negative: overlap."""
    bodies = tuple(plain.Body(np.array(s.vertices), s.radius, 1.0, 1.0, 1.0) for s in shapes)
    return surface_gap(plain.Scene(bodies, np.asarray(position), np.zeros((2, 3))), 0, 1)


def placed(shapes, gap, speed=0.0):
    """Two bodies of sand, the second one above the first at a gap."""
    lower, upper = shapes
    height = 1.1 * (lower.bounding_radius + upper.bounding_radius)
    while (excess := gap_of(shapes, [[0, 0, 0.1], [1e-6, height, 2.0]]) - gap) > 1e-13:
        height -= 0.7 * excess
    return [
        Body(lower, (0.0, 0.0), 0.1, density=2650.0),
        Body(upper, (1e-6, height), 2.0, (0.0, -speed), density=2650.0),
    ]


def doublet(name, tolerance, until, speed=0.0):
    """(shapes, Trajectory) of a pair of which the upper one starts 2 nm above the lower."""
    bodies = placed(PAIRS[name], 2e-9, speed)
    system = PolygonSystem(bodies, FORCES, Implicit(tolerance), WATER)
    return PAIRS[name], system.run(until, max_steps=20_000)


def gaps_along(shapes, found):
    """Gaps [m] at up to 200 records, the last one included."""
    rows = np.unique(np.linspace(0, len(found.t) - 1, 200).astype(int))
    return np.array([gap_of(shapes, found.position[row]) for row in rows])


@pytest.mark.parametrize("name", PAIRS)
@pytest.mark.parametrize("tolerance", [1e-9, 1e-11])
def test_doublet_stays_in_its_well(name, tolerance):
    shapes, found = doublet(name, tolerance, 10.0)
    gaps = gaps_along(shapes, found)
    assert found.status.name == "FINISHED"
    assert np.isfinite(found.position).all() and np.isfinite(found.velocity).all()
    assert -2e-9 - tolerance < gaps.min()
    assert gaps.max() < 2.1e-9
    assert gaps[-1] < 0.0


def test_spheres_rest_where_contact_balances_attraction():
    """k_n Δ = F_A − F_R at contact; the weights change that by less than a per cent."""
    shapes, found = doublet("spheres", 1e-12, 1.0)
    reduced = np.prod([s.radius for s in shapes]) / sum(s.radius for s in shapes)
    pull = (ATTRACTION.hamaker / (6.0 * ATTRACTION.d_min**2) - REPULSION.strength) * reduced
    assert gap_of(shapes, found.position[-1]) == pytest.approx(-pull / LAW.k_n, rel=0.01)


@pytest.mark.parametrize("tolerance", [1e-9, 1e-11])
def test_spheres_thrown_into_the_well_are_held(tolerance):
    """At 1 mm/s drag stops them in a micrometre; they neither bounce off nor pass through."""
    shapes, found = doublet("spheres", tolerance, 0.1, speed=1e-3)
    gaps = gaps_along(shapes, found)
    assert found.status.name == "FINISHED"
    assert gaps.min() > -0.05e-6
    assert gaps[-1] < 0.0
