"""How fast errors fall with the step or the tolerance: with drag, and in a collision.

The smooth two-body problem is in tests/verification/test_two_bodies.py.
"""

import math

import numpy as np
import pytest
from reference.closed_forms import impact
from trial_scenes import ELASTIC, PolygonSystem, Spring, head_on, watched

from flocsim import Body, Sphere, System
from flocsim.forces import Contact, Gravity, StokesDrag
from flocsim.integrators import Implicit, VelocityVerlet

SPEED, GAP, K_N = 1e-3, 1e-7, 20.0


def bounce_error(integrator, z=0.0):
    """Error [m] of the place of two spheres after their bounce, by the closed form."""
    bodies = head_on(SPEED, GAP)
    omega = math.sqrt(2.0 * K_N / bodies[0].mass)
    until = GAP / SPEED + 6.0 / omega
    law = ELASTIC if z == 0.0 else Contact(K_N, 0.0, damping_n=2.0 * z * omega)
    end = watched(PolygonSystem(bodies, [law, Spring()], integrator), until)
    restitution, lasted, _ = impact(z, True)
    expected = restitution * SPEED * (until - GAP / SPEED - lasted / omega)
    return abs(end.position[1, 0] - end.position[0, 0] - 1e-5 - expected)


def test_velocity_verlet_is_of_second_order_through_an_elastic_bounce():
    """The kink at the touch shakes single errors, so a decade of steps is compared."""
    coarse, fine = (
        np.mean([bounce_error(VelocityVerlet(base / k)) for k in (1.0, 1.13, 1.27)])
        for base in (4e-7, 4e-8)
    )
    assert math.log10(coarse / fine) == pytest.approx(2.0, abs=0.4)


def test_velocity_verlet_is_of_first_order_through_a_damped_bounce():
    """The dashpot's force jumps at the touch: no fixed step that does not end there does better."""
    coarse, fine = (bounce_error(VelocityVerlet(step), z=0.3) for step in (4e-7, 4e-9))
    assert fine < 0.05 * coarse


@pytest.mark.parametrize("z", [0.0, 0.3])
def test_error_of_implicit_falls_with_its_tolerance_through_a_bounce(z):
    """Over five decades of tolerance the error falls by at least two."""
    errors = [bounce_error(Implicit(tolerance=10.0**-k), z) for k in (10, 12, 15)]
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 0.01 * errors[0]
    assert errors[2] < 1e-11


def fall_error(integrator):
    """Error of the speed of a sphere after one τ of falling, as a share of v_t."""
    body = Body(Sphere(5e-6), density=2650.0)
    drag = 6.0 * math.pi * 8.9e-4 * 5e-6
    tau, terminal = body.mass / drag, body.mass * 9.81 / drag
    found = System([body], [Gravity(), StokesDrag()], integrator).run(tau, jit=False)
    return abs(found.velocity[-1, 0, 1] / terminal + 1.0 - math.exp(-1.0))


def test_velocity_verlet_is_of_second_order_with_drag():
    tau = 1.6541822721598005e-05
    errors = [fall_error(VelocityVerlet(tau / n)) for n in (20, 40, 80)]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert orders == pytest.approx([2.0, 2.0], abs=0.2)


def test_error_of_implicit_falls_with_its_tolerance_with_drag():
    errors = [fall_error(Implicit(10.0**-k, first_step=1e-8)) for k in (11, 13, 15)]
    assert errors[1] < 0.05 * errors[0]
    assert errors[2] < 0.05 * errors[1]


def test_steps_go_with_the_root_of_the_tolerance():
    """Second order: a hundredth of the tolerance costs ten times the steps, not a hundred."""
    bodies = head_on(SPEED, GAP)
    counts = [
        watched(PolygonSystem(bodies, [ELASTIC, Spring(1e-2)], Implicit(t)), 1e-3).steps
        for t in (1e-12, 1e-14)
    ]
    assert 6.0 < counts[1] / counts[0] < 14.0
