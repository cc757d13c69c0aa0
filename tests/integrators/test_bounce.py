"""How errors fall with the step or the tolerance: through a bounce, and with drag."""

import math

import attrs
import numpy as np
import pytest

from flocsim import Body, Sphere, System
from flocsim.forces import Contact, Gravity, StokesDrag
from flocsim.integrators import VelocityVerlet
from tests.helpers.methods import by_adaptive
from tests.helpers.trial_scenes import ELASTIC, PolygonSystem, Spring, head_on, watched
from tests.reference.closed_forms import impact

SPEED, GAP, K_N = 1e-3, 1e-7, 20.0


def bounce(integrator, z=0.0):
    """(error [m] of the gap of two spheres after their bounce by the closed form, the end)."""
    bodies = head_on(SPEED, GAP)
    omega = math.sqrt(2.0 * K_N / bodies[0].mass)
    until = GAP / SPEED + 6.0 / omega
    law = ELASTIC if z == 0.0 else Contact(K_N, 0.0, damping_n=2.0 * z * omega)
    end = watched(PolygonSystem(bodies, [law, Spring()], integrator), until)
    restitution, lasted, _ = impact(z, True)
    expected = restitution * SPEED * (until - GAP / SPEED - lasted / omega)
    return abs(end.position[1, 0] - end.position[0, 0] - 1e-5 - expected), end


def test_velocity_verlet_is_of_second_order_through_an_elastic_bounce():
    """The kink at the touch shakes single errors, so a decade of steps is compared."""
    coarse, fine = (
        np.mean([bounce(VelocityVerlet(base / k))[0] for k in (1.0, 1.13, 1.27)])
        for base in (4e-7, 4e-8)
    )
    assert math.log10(coarse / fine) == pytest.approx(2.0, abs=0.4)


def test_velocity_verlet_is_of_first_order_through_a_damped_bounce():
    """The dashpot's force jumps at the touch: no fixed step that does not end there does better."""
    coarse, fine = (bounce(VelocityVerlet(step), z=0.3)[0] for step in (4e-7, 4e-9))
    assert fine < 0.05 * coarse


@pytest.mark.parametrize("z", [0.0, 0.3])
@by_adaptive
def test_errors_stay_near_the_tolerance_through_a_bounce(integrator, z):
    for tolerance in (1e-9, 1e-11, 1e-13):
        error, end = bounce(attrs.evolve(integrator, tolerance=tolerance), z)
        # A step's error in velocity goes on for as long as the run: the tolerance counts that in.
        assert error < 20.0 * tolerance
        # Down to rounding: a bounce without damping is followed as exactly as that.
        assert error < 10.0 * end.error + 1e-17


@pytest.mark.parametrize("tension", [True, False])
@pytest.mark.parametrize("gap", [1e-14, 1e-12])
@by_adaptive
def test_a_bounce_shallower_than_the_tolerance_gives_back_the_right_speed(integrator, gap, tension):
    """Spheres that all but touch at the start, and sink in by a tenth of the tolerance."""
    bodies = head_on(speed := 1e-7, gap)
    omega = math.sqrt(2.0 * K_N / bodies[0].mass)
    law = Contact(K_N, 0.0, damping_n=0.6 * omega, tension=tension)
    depth = speed / omega
    method = attrs.evolve(integrator, tolerance=10.0 * depth)
    end = watched(PolygonSystem(bodies, [law, Spring()], method), until := 1e9 * depth / speed)
    restitution, _, _ = impact(0.3, tension)
    parted = end.position[1, 0] - end.position[0, 0] - 1e-5
    assert parted == pytest.approx(restitution * speed * until, rel=1e-6)


@by_adaptive
def test_steps_go_with_a_high_root_of_the_tolerance(integrator):
    """Order 5: a hundredth of the tolerance costs hardly three times the steps, not ten times."""
    settings = [attrs.evolve(integrator, tolerance=tolerance) for tolerance in (1e-11, 1e-13)]
    counts = [bounce(setting)[1].steps for setting in settings]
    assert counts[1] < 3.5 * counts[0]


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


@by_adaptive
def test_errors_fall_with_the_tolerance_with_drag(integrator):
    settings = [attrs.evolve(integrator, tolerance=10.0**-k, first_step=1e-8) for k in (11, 13, 15)]
    errors = [fall_error(setting) for setting in settings]
    assert errors[1] < 0.05 * errors[0]
    assert errors[2] < 0.05 * errors[1] or errors[2] < 1e-12
