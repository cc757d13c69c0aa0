"""Every method, in System and Swarm, with every family of shapes, held to laws in closed form."""

import math
from itertools import product

import numpy as np
import pytest

from flocsim import Body, Composite, Fluid, Sphere, SpheroPolygon, Swarm, System
from flocsim.forces import Contact, Gravity, StokesDrag
from flocsim.integrators import (
    BackwardEuler,
    DormandPrince54,
    Implicit,
    Status,
    VelocityVerlet,
)
from tests.helpers.methods import name_of
from tests.helpers.tiers import rest_slow
from tests.reference.closed_forms import impact

R, SPEED, GAP, K_N, MASS = 5e-6, 1e-3, 1e-9, 0.05, 2e-10
OMEGA = math.sqrt(K_N / MASS)

METHODS = [VelocityVerlet(2e-3 / OMEGA), DormandPrince54(1e-10), Implicit(1e-10), BackwardEuler()]
CONTROLLED = METHODS[1:]

DIAMOND = SpheroPolygon(1e-6 * np.array([[4, 0], [0, 4], [-4, 0], [0, -4]]), 1e-6)
LEVEL = SpheroPolygon(1e-6 * np.array([[-30, 0], [30, 0]]), 1e-6)
SHAPES = {
    "spheres": (Sphere(R), Sphere(R)),
    "polygons": (LEVEL, DIAMOND),
    "compounds": (LEVEL, Composite([(DIAMOND, (0.0, 0.0), 0.0), (Sphere(R), (0.0, 9e-6), 0.0)])),
}
"""What lies below, and what comes down on it with one corner."""


def falling_on(family, gap, speed):
    """A fixed body and one of MASS that comes down on it."""
    below, above = SHAPES[family]
    lowest = above.placed_vertices(0.0, 0.0)[:, 1].min() - above.radius
    place = (0.0, below.radius + gap - lowest)
    density = MASS / above.area
    return [
        Body(below, surface_density=2.0, fixed=True),
        Body(above, place, velocity=(0.0, -speed), surface_density=density),
    ]


def restitution(kind, integrator, family, z, **options):
    """What is left of the speed of an impact, and how the run ended."""
    bodies = falling_on(family, GAP, SPEED)
    contact = Contact(K_N, 0.0, damping_n=2.0 * z * OMEGA, damping_t=0.0)
    # As long as a fall back would take: what leads on from a velocity counts for so long.
    run = kind(bodies, [contact], integrator, Fluid()).run(5e-4, **options)
    assert run.status == Status.FINISHED
    return run.velocity[-1, 1, 1] / SPEED


by_family = pytest.mark.parametrize("family", SHAPES)
by_any = pytest.mark.parametrize("integrator", METHODS, ids=name_of)


def is_quick(integrator, family, z):
    """Each method, family and damping, but not each with each; backward Euler takes longest."""
    if isinstance(integrator, BackwardEuler):
        return False  # its law for a step: tests/integrators/backward_euler
    if isinstance(integrator, VelocityVerlet) and family != "spheres":
        return False  # small steps, uncompiled
    return z == (0.05 if family == "polygons" else 0.4)


@pytest.mark.parametrize(
    ("integrator", "family", "z"),
    rest_slow(product(METHODS, SHAPES, (0.05, 0.4)), is_quick),
    ids=lambda value: name_of(value) if value in METHODS else None,
)
def test_an_impact_gives_back_what_the_law_says(integrator, family, z):
    """Within 1 %: the method that is named is the one that runs."""
    found = restitution(System, integrator, family, z, record=False, jit=False)
    assert found == pytest.approx(impact(z, True)[0], rel=1e-2)


@pytest.mark.slow
@by_family
@by_any
def test_an_impact_in_a_swarm_is_that_of_a_system(integrator, family):
    """Each is an engine of its own."""
    found = restitution(Swarm, integrator, family, 0.05)
    assert found == pytest.approx(impact(0.05, True)[0], rel=1e-2)


@pytest.mark.parametrize("integrator", CONTROLLED, ids=name_of)
def test_a_sphere_comes_to_its_terminal_velocity(integrator):
    body = Body(Sphere(R), density=2650.0)
    lasts = body.mass / (6.0 * math.pi * Fluid().viscosity * R)
    run = System([body], [Gravity(), StokesDrag()], integrator).run(lasts, jit=False)
    expected = -9.81 * lasts * -math.expm1(-1.0)
    assert run.velocity[-1, 0, 1] == pytest.approx(expected, rel=3e-2)
    exact = -9.81 * lasts * lasts * math.exp(-1.0)
    assert abs(run.position[-1, 0, 1] - exact) < 20.0 * integrator.tolerance


@by_family
@pytest.mark.parametrize("integrator", CONTROLLED[1:], ids=name_of)
def test_what_lies_is_pressed_by_its_weight(integrator, family):
    """N = m g: an overlap of m g/k_n, and nothing moves any more."""
    bodies = falling_on(family, -1.01 * MASS * 9.81 / K_N, 0.0)
    contact = Contact(K_N, 0.0, damping_n=2.0 * OMEGA, damping_t=0.0)
    run = System(bodies, [Gravity(), StokesDrag(), contact], integrator).run(1e-3, jit=False)
    flat = falling_on(family, -MASS * 9.81 / K_N, 0.0)[1].position[1]
    assert run.status == Status.FINISHED
    assert run.position[-1, 1, 1] == pytest.approx(flat, abs=2e-11)
    assert abs(run.velocity[-1, 1, 1]) < 1e-6
