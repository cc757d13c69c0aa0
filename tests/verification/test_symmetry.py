"""The same end after turning, shifting, mirroring, swapping and renumbering an encounter.

The runs are short, two or three touches with damping, slip and friction: a longer run is chaotic
and would amplify round-off. Fixed steps agree to round-off; adaptive ones to a multiple of their
tolerance.
"""

import attrs
import numpy as np
import pytest

from flocsim import Body, SpheroPolygon
from flocsim.forces import Contact
from flocsim.integrators import DormandPrince54, Implicit, VelocityVerlet
from tests.helpers.methods import by_setting
from tests.helpers.trial_scenes import PolygonSystem, Spring, hook, star, watched
from tests.reference.shapes import rotation

LAW = Contact(k_n=20.0, k_t=2.0, damping_n=3e4, friction=0.4)
SPRING = Spring(1e-2)
UNTIL = 2e-4
FINE = 1e-10
by_method = by_setting(
    (VelocityVerlet(1e-8), 1e-13), (DormandPrince54(1e-12), FINE), (Implicit(1e-12), FINE)
)
"""Method and how far the ends may lie apart [m], with angles times 10 µm."""


def encounter():
    """Star and hook run into each other off their middles, both turning."""
    return [
        Body(star(), (0.0, 0.0), 0.0, (0.05, 0.01), 2e3, surface_density=2.0),
        Body(hook(), (18e-6, -4e-6), 1.0, (-0.05, 0.0), -1e3, surface_density=1.0),
    ]


def end_of(bodies, integrator):
    """Position (2, 3) at the end; the bodies have touched."""
    end = watched(PolygonSystem(bodies, [LAW, SPRING], integrator), UNTIL)
    assert end.status.name == "FINISHED"
    assert end.contacts >= 2
    return end.position


def assert_same(found, expected, allowed):
    """Places [m] and angles [rad], those compared as paths at 10 µm."""
    assert np.abs((found - expected) * [1.0, 1.0, 1e-5]).max() < allowed


@by_method
@pytest.mark.parametrize("angle", [0.5 * np.pi, 2.1])
def test_turned(angle, integrator, allowed):
    turn = rotation(angle)
    moved = [
        attrs.evolve(b, position=turn @ b.position, velocity=turn @ b.velocity,
                     angle=b.angle + angle)
        for b in encounter()
    ]  # fmt: skip
    expected = end_of(encounter(), integrator)
    expected = np.column_stack([expected[:, :2] @ turn.T, expected[:, 2] + angle])
    assert_same(end_of(moved, integrator), expected, allowed)


@by_method
def test_shifted_and_seen_from_a_moving_frame(integrator, allowed):
    shift, drift = np.array([3e-4, -2e-4]), np.array([0.02, -0.03])
    moved = [
        attrs.evolve(b, position=b.position + shift, velocity=b.velocity + drift)
        for b in encounter()
    ]
    expected = end_of(encounter(), integrator)
    expected[:, :2] += shift + drift * UNTIL
    # 2e-4 m away from the origin a float's grain is a hundred times coarser.
    assert_same(end_of(moved, integrator), expected, 10.0 * allowed)


def mirrored(body):
    """The body in the mirror x → −x."""
    shape = SpheroPolygon(body.shape.vertices * [-1.0, 1.0], body.shape.radius)
    (x, y), (vx, vy) = body.position, body.velocity
    return Body(
        shape, (-x, y), -body.angle, (-vx, vy), -body.spin, surface_density=body.surface_density
    )


@by_method
def test_mirrored(integrator, allowed):
    expected = end_of(encounter(), integrator) * [-1.0, 1.0, -1.0]
    assert_same(end_of([mirrored(b) for b in encounter()], integrator), expected, allowed)


@by_method
def test_bodies_swapped(integrator, allowed):
    expected = end_of(encounter(), integrator)[::-1]
    assert_same(end_of(encounter()[::-1], integrator), expected, allowed)


@by_method
def test_lengths_scaled_with_time_kept(integrator, allowed):
    """Twice the lengths at an equal mass per area: mass × 4, so stiffnesses × 4 keep the time."""
    bodies = [
        attrs.evolve(b, shape=b.shape.scaled(2.0), position=2.0 * np.array(b.position),
                     velocity=2.0 * np.array(b.velocity))
        for b in encounter()
    ]  # fmt: skip
    law = attrs.evolve(LAW, k_n=80.0, k_t=8.0)
    larger = integrator
    if allowed == FINE:
        larger = attrs.evolve(integrator, tolerance=2.0 * integrator.tolerance)
    system = PolygonSystem(bodies, [law, Spring(4e-2)], larger)
    found = watched(system, UNTIL).position / [2.0, 2.0, 1.0]
    assert_same(found, end_of(encounter(), integrator), allowed)
