"""Head-on impacts: restitution, contact time and largest overlap (MODEL section 7).

The bodies are spheres, run through the code for polygons: the same compiled scene serves all.
"""

import math

import pytest

from flocsim.forces import Contact
from flocsim.integrators import DormandPrince54, Implicit, VelocityVerlet
from tests.helpers.methods import by_setting
from tests.helpers.tiers import rest_slow
from tests.helpers.trial_scenes import PolygonSystem, Spring, head_on, watched
from tests.reference.closed_forms import impact

K_N, SPEED, GAP = 20.0, 1e-3, 1e-7

CLIPPED = {
    0.05: 0.858758, 0.1: 0.744079, 0.2: 0.571740, 0.5: 0.298436, 1 / math.sqrt(2): 0.207882,
    0.9: 0.155283, 1.0: 0.135335, 1.5: 0.075588, 3.0: 0.023770,
}  # fmt: skip
"""{z: e} of Schwager & Pöschel (2007)."""

by_method = by_setting(
    (VelocityVerlet(1e-9), 3e-3), (DormandPrince54(1e-15), 3e-6), (Implicit(1e-15), 3e-8)
)
"""Method and what it may be off: a damped contact closes with a jump of the force, which has a kink
where tension is clipped; only the adaptive methods end a step there."""

SEEN = 3e-3
"""What the deepest overlap may be off that is seen between two steps."""


def frequency(bodies):
    """ω0 = √(k_n/M) [1/s], M of the free bodies."""
    a, b = bodies
    return math.sqrt(K_N / (a.mass if b.fixed else a.mass * b.mass / (a.mass + b.mass)))


def bounce(z, tension, integrator, fixed=False):
    """(restitution, ω0 · contact time, ω0/v0 · largest overlap) of one impact."""
    bodies = head_on(SPEED, GAP, fixed=fixed)
    omega = frequency(bodies)
    until = GAP / SPEED + (40.0 if z > 2.0 else 12.0) / omega
    law = Contact(k_n=K_N, k_t=2.0, damping_n=2.0 * z * omega, tension=tension)
    system = PolygonSystem(bodies, [law, Spring()], integrator)
    end = watched(system, until)
    assert end.status.name == "FINISHED"
    # Seen at the ends of steps, which may be as long as the impact.
    deepest = watched(system, until, largest_step=0.02 / omega).deepest
    parting = end.velocity[1, 0] - end.velocity[0, 0]
    gap = end.position[1, 0] - end.position[0, 0] - 1e-5
    # Before and after, the bodies fly free, so that the instants follow from the gaps.
    lasted = until - gap / parting - GAP / SPEED
    return parting / SPEED, omega * lasted, omega / SPEED * deepest


@by_method
@pytest.mark.parametrize("z", rest_slow(CLIPPED, lambda z: z in (0.05, 0.5, 3.0)))
def test_restitution_without_tension(z, integrator, allowed):
    restitution, _, deepest = bounce(z, False, integrator)
    assert restitution == pytest.approx(impact(z, False)[0], rel=allowed)
    assert restitution == pytest.approx(CLIPPED[z], rel=max(allowed, 2e-5), abs=1e-6)
    assert deepest == pytest.approx(impact(z, False)[2], rel=SEEN)


@by_method
@pytest.mark.parametrize("z", [0.0, 0.05, 0.3, 0.7])
def test_restitution_and_contact_time_with_tension(z, integrator, allowed):
    restitution, lasted, deepest = bounce(z, True, integrator)
    root = math.sqrt(1.0 - z * z)
    assert restitution == pytest.approx(math.exp(-math.pi * z / root), rel=allowed)
    assert lasted == pytest.approx(math.pi / root, rel=allowed)
    assert deepest == pytest.approx(impact(z, True)[2], rel=SEEN)


@by_method
def test_bounce_off_a_fixed_body_is_one_of_its_own_mass(integrator, allowed):
    restitution, lasted, _ = bounce(0.3, True, integrator, fixed=True)
    root = math.sqrt(1.0 - 0.3**2)
    assert restitution == pytest.approx(math.exp(-math.pi * 0.3 / root), rel=allowed)
    assert lasted == pytest.approx(math.pi / root, rel=allowed)


def test_critical_is_the_damping_of_z_equal_to_one():
    bodies = head_on(SPEED, GAP)
    until = GAP / SPEED + 5.0 / frequency(bodies)
    numbers = ["critical", 2.0 * frequency(bodies)]
    ends = [
        watched(
            PolygonSystem(bodies, [Contact(K_N, 2.0, damping_n=d), Spring()], Implicit(1e-14)),
            until,
        ).motion
        for d in numbers
    ]
    assert ends[0][:, 3] == pytest.approx(ends[1][:, 3], abs=1e-9 * SPEED)
