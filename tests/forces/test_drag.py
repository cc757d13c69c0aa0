"""Drag beyond Stokes's: against measured drag and settling speeds, its slope, and in motion."""

import math

import numpy as np
import pytest

from flocsim import Body, Fluid, Sphere, System
from flocsim.errors import RangeError
from flocsim.forces import Contact, Gravity, StokesDrag
from flocsim.forces.check import SAMPLE_BODIES
from flocsim.forces.codegen import laws_of
from flocsim.forces.drag import reynolds_number
from flocsim.forces.settling import largest_mobility, least_mobility, terminal_motion
from flocsim.integrators import DormandPrince54, Implicit, Overdamped, VelocityVerlet

WATER = Fluid(viscosity=1.0e-3, density=1000.0, buoyancy=True)
INERTIAL = StokesDrag(law="schiller_naumann")


def drag_on(radius, speed, fluid=WATER, drag=INERTIAL):
    """Drag [N] on a sphere that falls at a speed in a fluid at rest."""
    pieces = laws_of([drag], fluid)
    view = SAMPLE_BODIES[0]._replace(vx=0.0, vy=-speed, spin=0.0, radius=radius)
    return pieces.laws["body_force"](view, pieces.parameters)[1]


@pytest.mark.parametrize(
    ("reynolds", "measured"),
    [(0.1, 240.0), (1.0, 26.5), (10.0, 4.10), (100.0, 1.07), (500.0, 0.55)],
)
def test_drag_coefficient_of_the_standard_curve(reynolds, measured):
    """C_D = F/(½ ρ v² π r²) as Lapple and Shepherd (1940) tabulate it; the law is good to 5 %."""
    radius, speed = 1e-4, reynolds * 1e-3 / (1000.0 * 2e-4)
    assert reynolds_number(speed, radius, 1e-3, 1000.0) == pytest.approx(reynolds)
    found = drag_on(radius, speed) / (0.5 * 1000.0 * speed**2 * math.pi * radius**2)
    assert found == pytest.approx(measured, rel=0.05)
    stokes = drag_on(radius, speed, drag=StokesDrag())
    assert stokes == pytest.approx(6.0 * math.pi * 1e-3 * radius * speed)


def gibbs(radius):
    """Settling speed [m/s] measured on spheres of 2.65 g/cm³ in water of 1 mPa s: Gibbs, Matthews
    and Link (1971), J. Sed. Petrol. 41, 7, in cgs units."""
    r, g = 100.0 * radius, 980.0
    inside = 9.0 * 0.01**2 + g * r**2 * 1.65 * (0.015476 + 0.19841 * r)
    return 0.01 * (math.sqrt(inside) - 3.0 * 0.01) / (0.011607 + 0.14881 * r)


@pytest.mark.parametrize("diameter", [1e-4, 2e-4, 5e-4, 1e-3])
def test_quartz_spheres_fall_as_measured(diameter):
    body = Body(Sphere(diameter / 2.0), density=2650.0)
    velocity, _ = terminal_motion(System([body], [Gravity(), INERTIAL], fluid=WATER), body)
    assert -velocity[1] == pytest.approx(gibbs(diameter / 2.0), rel=0.05)


@pytest.mark.parametrize(
    "flow", [{}, {"velocity": (3e-2, -1e-2), "gradient": (0.0, 4.0, -2.0, 0.0)}]
)
def test_derivatives_are_those_of_the_law(flow):
    """6πγr (1 + 0.15 Re^n) across the motion, 6πγr (1 + 0.15 (1 + n) Re^n) along it, n = 0.687."""
    pieces = laws_of([INERTIAL], Fluid(viscosity=1e-3, density=1000.0, **flow))
    view = SAMPLE_BODIES[0]._replace(x=0.0, y=0.0, vx=0.03, vy=-0.04, radius=1e-4)
    found = np.array(pieces.laws["velocity_derivatives"](view, pieces.parameters)).reshape(3, 3)
    relative = np.array([0.03, -0.04]) - flow.get("velocity", (0.0, 0.0))
    power = (reynolds_number(math.hypot(*relative), 1e-4, 1e-3, 1000.0)) ** 0.687
    along = np.outer(relative, relative) / (relative @ relative)
    wanted = (
        -6.0
        * math.pi
        * 1e-3
        * 1e-4
        * ((1.0 + 0.15 * power) * np.eye(2) + 0.15 * 0.687 * power * along)
    )
    np.testing.assert_allclose(found[:2, :2], wanted, rtol=2e-3, atol=1e-8)
    assert found[2, 2] == pytest.approx(-8.0 * math.pi * 1e-3 * 1e-12, rel=1e-6)
    assert ("position_derivatives" in pieces.laws) == bool(flow)


def test_at_rest_and_without_density_it_is_stokes():
    view = SAMPLE_BODIES[0]._replace(vx=0.0, vy=0.0)
    pieces = laws_of([INERTIAL], WATER)
    assert pieces.laws["body_force"](view, pieces.parameters)[:2] == (0.0, 0.0)
    assert drag_on(1e-4, 0.1, Fluid(viscosity=1e-3, density=0.0)) == drag_on(
        1e-4, 0.1, drag=StokesDrag()
    )


@pytest.mark.parametrize(
    "method",
    [Implicit(1e-9), Overdamped(1e-9), DormandPrince54(1e-8), VelocityVerlet(1e-4)],
    ids=lambda method: type(method).__name__,
)
def test_every_method_comes_to_the_terminal_speed(method):
    body = Body(Sphere(1e-4), density=2650.0)
    system = System([body], [Gravity(), INERTIAL], method, WATER)
    velocity, _ = terminal_motion(system, body)
    end = system.run(0.1, jit=False)
    assert end.velocity[-1, 0, 1] == pytest.approx(velocity[1], rel=1e-4)


def test_mobilities_bound_what_departure_and_bonds_ask():
    bodies = [Body(Sphere(radius), density=2650.0) for radius in (1e-4, 2e-4)]
    system = System(bodies, [Gravity(), INERTIAL, Contact()], fluid=WATER)
    found = [terminal_motion(system, body) for body in bodies]
    for body, (velocity, mobility) in zip(bodies, found, strict=True):
        largest = largest_mobility(system, body, math.hypot(*velocity), mobility)
        assert largest == pytest.approx(1.0 / (6e-3 * math.pi * body.shape.radius), rel=5e-3)
        assert largest > 1.3 * mobility
    fastest = -found[1][0][1]
    assert least_mobility(system, bodies[0], fastest, found[0][1]) < found[0][1]


def test_a_linear_drag_has_one_mobility():
    body = Body(Sphere(5e-6), density=2650.0)
    system = System([body], [Gravity(), StokesDrag()], fluid=WATER)
    velocity, mobility = terminal_motion(system, body)
    for bound in (largest_mobility, least_mobility):
        assert bound(system, body, -velocity[1], mobility) == pytest.approx(mobility, rel=1e-8)


def test_laws_are_named():
    with pytest.raises(RangeError, match="must be 'stokes', 'schiller_naumann' or 'shape'"):
        StokesDrag(law="oseen")
