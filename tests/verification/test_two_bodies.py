"""Two bodies on a user's own spring, against the closed form of the two-body problem."""

import attrs
import numpy as np
import pytest

from flocsim import Body, Sphere, SpheroPolygon
from flocsim.integrators import DormandPrince54, Implicit, VelocityVerlet
from tests.helpers.methods import by_adaptive, by_setting
from tests.helpers.trial_scenes import ELASTIC, PolygonSystem, Spring, hook, star, watched

STIFFNESS = 1e-2


def orbit(a, b):
    """Two bodies on an ellipse about their common centroid, which drifts; they never touch."""
    left = Body(a, (-30e-6, 5e-6), 0.2, (1e-3, 8e-3), 50.0, surface_density=2.0)
    right = Body(b, (25e-6, 0.0), -1.0, (2e-3, -0.2), -70.0, surface_density=2.0)
    return [left, right]


def isotropic(bodies):
    """The spring whose force is −k times the vector between the centroids."""
    return Spring(STIFFNESS, rest=-sum(body.shape.equivalent_radius for body in bodies))


def exact_motion(bodies, t):
    """Position (2, 3) at a time: relative vector d0 cos ωt + u0/ω sin ωt, even drift and spin."""
    place = np.array([body.position for body in bodies])
    speed = np.array([body.velocity for body in bodies])
    m = np.array([body.mass for body in bodies])
    omega = np.sqrt(STIFFNESS * m.sum() / m.prod())
    share = m[::-1] / m.sum() * [1.0, -1.0]
    middle = m @ (place + speed * t) / m.sum()
    apart = (place[0] - place[1]) * np.cos(omega * t)
    apart += (speed[0] - speed[1]) / omega * np.sin(omega * t)
    angles = [body.angle + body.spin * t for body in bodies]
    return np.column_stack([middle + share[:, None] * apart, angles])


def period(bodies):
    """2π/ω [s]."""
    a, b = (body.mass for body in bodies)
    return 2.0 * np.pi * np.sqrt(a * b / (a + b) / STIFFNESS)


def miss(bodies, integrator, turns):
    """Largest error of a place [m] after so many turns."""
    until = turns * period(bodies)
    end = watched(PolygonSystem(bodies, [ELASTIC, isotropic(bodies)], integrator), until)
    assert end.contacts == 0
    return np.abs((end.position - exact_motion(bodies, until))[:, :2]).max()


@pytest.mark.parametrize("shapes", [(star(), hook()), (Sphere(5e-6), Sphere(3e-6))])
@by_setting(
    (VelocityVerlet(2e-8), 1e-10), (DormandPrince54(1e-12), 1e-10), (Implicit(1e-12), 1e-10)
)
def test_elliptic_orbit(shapes, integrator, allowed):
    assert miss(orbit(*shapes), integrator, 1.3) < allowed


@by_adaptive
def test_the_error_falls_with_the_tolerance_and_stays_near_it(integrator):
    bodies = orbit(star(), hook())
    tolerances = np.array([1e-9, 1e-10, 1e-11, 1e-12, 1e-13])
    errors = [miss(bodies, attrs.evolve(integrator, tolerance=t), 0.8) for t in tolerances]
    falls = np.divide(errors[:-1], errors[1:]) > 3.0
    assert np.all(falls | (np.array(errors[1:]) < 1e-16))  # rounding
    assert np.all(errors < 20.0 * tolerances)


def test_body_tied_to_a_fixed_one_swings_back():
    """It oscillates with its own mass, and the fixed one stays."""
    post = Body(SpheroPolygon([[-1e-6, 0.0], [1e-6, 0.0]], 1e-6), fixed=True, surface_density=2.0)
    ball = Body(Sphere(5e-6), (60e-6, 0.0), surface_density=2.0)
    rest = 30e-6
    equilibrium = rest + 5e-6 + post.shape.equivalent_radius
    half = np.pi * np.sqrt(ball.mass / STIFFNESS)
    system = PolygonSystem([post, ball], [ELASTIC, Spring(STIFFNESS, rest)], Implicit(1e-12))
    end = watched(system, half)
    assert end.position[1, 0] == pytest.approx(2.0 * equilibrium - 60e-6, abs=1e-9)
    assert end.position[0].tolist() == [0.0, 0.0, 0.0]
