"""Overdamped: the limit of Implicit for little mass, and what it no longer depends on."""

import attrs
import numpy as np
import pytest

from flocsim import Body, Fluid, Sphere, System
from flocsim.forces import Contact, Gravity, StokesDrag
from flocsim.integrators import Implicit, Overdamped
from tests.helpers.tiers import rest_slow
from tests.helpers.trial_scenes import PolygonSystem, Spring, Trap, hook

SPHERE = Sphere(6e-6)


def drifting(surface_density):
    """A hook and a sphere of some weight per area, on springs in a thick fluid that shears."""
    left = Body(hook(), (3e-6, 1e-6), 0.5, surface_density=surface_density)
    right = Body(SPHERE, (40e-6, -9e-6), 1.0, surface_density=surface_density)
    return [left, right]


FLUID = Fluid(viscosity=0.1, velocity=(1e-3, 0.0), gradient=(0.0, 50.0, -20.0, 0.0))
FORCES = [Trap(0.02, 1e-12), Spring(5e-3, -2e-6), StokesDrag()]


def path(integrator, surface_density):
    """The Trajectory of the drifting pair."""
    bodies = drifting(surface_density)
    found = PolygonSystem(bodies, FORCES, integrator, FLUID).run(2e-3, jit=False)
    assert found.status.name == "FINISHED"
    return found


@pytest.mark.parametrize(
    "masses", rest_slow([[0.2, 0.02], [0.2, 0.02, 0.002]], lambda masses: False)
)
def test_without_inertia_is_the_limit_of_little_mass(masses):
    """Overdamped does not depend on the mass; Implicit comes up to it in proportion to it."""
    ends = [path(Overdamped(1e-13), density).position[-1] for density in (2.0, 0.02)]
    assert np.abs(ends[0] - ends[1]).max() < 1e-14
    misses = [
        np.abs((path(Implicit(1e-13), density).position[-1] - ends[0])[:, :2]).max()
        for density in masses
    ]
    assert np.divide(misses[:-1], misses[1:]) == pytest.approx([10.0] * (len(masses) - 1), rel=0.1)


def test_without_inertia_the_velocities_of_the_start_do_not_matter():
    bodies = [attrs.evolve(body, velocity=(0.3, -0.2), spin=1e4) for body in drifting(2.0)]
    system = PolygonSystem(bodies, FORCES, Overdamped(1e-10), FLUID)
    thrown = system.run(2e-3, jit=False).position[-1]
    assert np.abs((thrown - path(Overdamped(1e-10), 2.0).position[-1]) * [1, 1, 1e-5]).max() < 1e-9


def test_without_inertia_falling_is_at_terminal_velocity_from_the_start():
    body = Body(SPHERE, density=2650.0)
    found = System([body], [Gravity(), StokesDrag()], Overdamped()).run(1e-2, jit=False)
    speed = body.mass * 9.81 / (6.0 * np.pi * 8.9e-4 * 6e-6)
    assert found.position[-1, 0] == pytest.approx([0.0, -speed * 1e-2, 0.0], rel=1e-12)
    assert found.velocity[-1, 0, 1] == pytest.approx(-speed, rel=1e-12)


def test_a_doublet_without_inertia_sticks_and_settles_as_with_it():
    """Real masses in water, a contact in between: the ends differ by what inertia does."""
    bodies = [
        Body(SPHERE, (0.0, 0.0), density=2650.0),
        Body(SPHERE, (2e-6, 11.9e-6), density=2650.0),
    ]
    forces = [Spring(1e-3, -1e-6), StokesDrag(), Contact(k_n=20.0, k_t=2.0)]
    ends = [
        PolygonSystem(bodies, forces, method).run(5e-3, jit=False).position[-1]
        for method in (Implicit(1e-11), Overdamped(1e-11))
    ]
    for end in ends:
        assert np.hypot(*np.diff(end[:, :2], axis=0)[0]) < 12e-6
    assert np.abs((ends[0] - ends[1]) * [1.0, 1.0, 1e-5]).max() < 2e-9
