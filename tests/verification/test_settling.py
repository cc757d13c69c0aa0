"""Settling alone: MODEL section 7's terminal velocities, relaxation and table of speeds."""

import numpy as np
import pytest

from flocsim import Body, Fluid, Sphere, System
from flocsim.forces import Gravity, StokesDrag
from flocsim.integrators import DormandPrince54, Implicit, VelocityVerlet
from tests.helpers.trial_scenes import WATER_VISCOSITY, hook
from tests.reference.closed_forms import relaxation_time, terminal_velocity

RADIUS = 5e-6
BUOYANT = Fluid(viscosity=WATER_VISCOSITY, density=997.0, buoyancy=True)
TABLE = [(4.62e-6, 0.0864e-3), (4.95e-6, 0.0992e-3), (16.41e-6, 1.090e-3), (23.02e-6, 2.146e-3)]


def settle(body, integrator, until, fluid=None):
    """Uncompiled: one body needs few steps."""
    system = System([body], [Gravity(), StokesDrag()], integrator, fluid or Fluid())
    return system.run(until, jit=False)


def relaxation_of(body):
    """(τ, v_t) of a body without buoyancy."""
    r = body.shape.equivalent_radius
    tau = relaxation_time(body.mass, WATER_VISCOSITY, r)
    return tau, terminal_velocity(body.mass, 9.81, WATER_VISCOSITY, r)


def relaxation_error(body, integrator):
    """Largest error of v(t) = v_t (1 − e^(−t/τ)) over three τ, as a share of v_t."""
    tau, terminal = relaxation_of(body)
    found = settle(body, integrator, 3.0 * tau)
    expected = -terminal * (1.0 - np.exp(-found.t / tau))
    return np.abs(found.velocity[:, 0, 1] - expected).max() / terminal


@pytest.mark.parametrize(("radius", "speed"), TABLE)
def test_settling_speeds_of_the_table(radius, speed):
    body = Body(Sphere(radius), density=2650.0)
    tau, _ = relaxation_of(body)
    end = settle(body, Implicit(tolerance=1e-12), 30.0 * tau, BUOYANT)
    assert end.velocity[-1, 0, 1] == pytest.approx(-speed, rel=6e-4)
    exact = speed_in_closed_form(body)
    assert end.velocity[-1, 0, 1] == pytest.approx(-exact, rel=1e-6)
    assert np.all(end.velocity[:, 0, [0, 2]] == 0.0)


def speed_in_closed_form(body):
    """2/9 (ρ − ρ_f) g r²/γ of a solid sphere."""
    return 2.0 / 9.0 * (2650.0 - 997.0) * 9.81 * body.shape.radius**2 / WATER_VISCOSITY


@pytest.mark.parametrize(
    ("integrator", "allowed"),
    [
        (Implicit(1e-11), 1e-4),
        (Implicit(1e-14), 1e-7),
        (VelocityVerlet(1e-7), 2e-3),
        (DormandPrince54(1e-11), 1e-3),
        (DormandPrince54(1e-14), 1e-6),
    ],
)
def test_relaxation_follows_the_exponential(integrator, allowed):
    assert relaxation_error(Body(Sphere(RADIUS), density=2650.0), integrator) < allowed


def test_drag_stops_a_spin_and_only_where_it_is_rotational():
    body = Body(Sphere(RADIUS), spin=100.0, density=2650.0)
    moment = 8.0 * np.pi * WATER_VISCOSITY * RADIUS**3 / body.inertia
    drags = [StokesDrag(), StokesDrag(rotational=False)]
    ends = [System([body], [d], Implicit(1e-14)).run(2 / moment, jit=False) for d in drags]
    assert ends[0].velocity[-1, 0, 2] == pytest.approx(100.0 * np.exp(-2.0), rel=1e-4)
    assert ends[1].velocity[-1, 0, 2] == 100.0


def test_a_body_in_a_vortex_follows_the_closed_form():
    """z″ = (iΩz − z′)/τ about the place where the flow stands still, z = x + iy."""
    turning, until = 40.0, 0.02
    flow = Fluid(velocity=(1e-3, -2e-3), gradient=(0.0, -turning, turning, 0.0))
    body = Body(hook(), (0.0, 0.0), 0.3, (1e-3, -2e-3), turning, surface_density=2.0)
    end = System([body], [StokesDrag()], Implicit(tolerance=1e-12), flow).run(until, jit=False)
    tau, _ = relaxation_of(body)
    roots = (np.array([-1.0, 1.0]) * np.sqrt(1.0 + 4j * turning * tau) - 1.0) / (2.0 * tau)
    middle, speed = (2e-3 + 1e-3j) / turning, 1e-3 - 2e-3j
    shares = np.linalg.solve([[1.0, 1.0], roots], [-middle, speed])
    exact = middle + shares @ np.exp(roots * until)
    assert complex(*end.position[-1, 0, :2]) == pytest.approx(exact, abs=1e-9)
    assert end.position[-1, 0, 2] == pytest.approx(0.3 + turning * until, rel=1e-9)
