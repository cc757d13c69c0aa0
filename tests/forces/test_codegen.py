"""The scene's own functions: sums of the kernels, with the derivatives that a scene needs."""

import math

import attrs
import pytest

from flocsim import Fluid
from flocsim.fields import quantity
from flocsim.forces import (
    BodyForce,
    CentreForce,
    Contact,
    ContactForce,
    DoubleLayer,
    Gravity,
    StokesDrag,
    SurfaceForce,
    VanDerWaals,
)
from flocsim.forces.check import SAMPLE_CONTACTS, sample_pairs
from flocsim.forces.codegen import laws_of

PAIRS = sample_pairs(1e-6)


@attrs.frozen
class Lubrication(SurfaceForce):
    """−c ḋ/(d + b), with derivatives by differences alone."""

    strength: float = quantity("N s", default=1e-12)
    smoothing: float = quantity("m", default=1e-8)
    reach: float = quantity("m", default=5e-7)

    @staticmethod
    def kernel(pair, strength, smoothing):
        return -strength * pair.gap_rate / (max(pair.gap, 0.0) + smoothing)


@attrs.frozen
class Screened(CentreForce):
    """exp(−d/λ), its slope left to differences."""

    length: float = quantity("m", default=1e-7)

    @staticmethod
    def kernel(pair, length):
        return 1e-12 * math.exp(-pair.gap / length)


@attrs.frozen
class Trap(BodyForce):
    """A spring to the origin."""

    @staticmethod
    def kernel(body):
        return -1e-6 * body.x, -1e-6 * body.y, 0.0


def speed_of(body):
    return body.vx


def twice_the_speed_of(body):
    return 2.0 * speed_of(body)


@attrs.frozen
class HelpedTwice(BodyForce):
    """Reads the velocity in a helper's helper."""

    @staticmethod
    def kernel(body):
        return -1e-6 * twice_the_speed_of(body), 0.0, 0.0


@attrs.frozen
class Unpacked(BodyForce):
    """Reads the velocity without naming it."""

    @staticmethod
    def kernel(body):
        return -1e-6 * body[4], 0.0, 0.0


def call(pieces, law, view, *more):
    """What a law of the scene returns."""
    return pieces.laws[law](view, pieces.parameters, *more)


@pytest.mark.parametrize(
    "force, velocity, position",
    [
        (Gravity(), False, False), (StokesDrag(), True, False), (Trap(), False, True),
        (HelpedTwice(), True, False), (Unpacked(), True, False),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, BodyForce) else "",
)  # fmt: skip
def test_derivatives_are_asked_of_the_forces_that_have_them(force, velocity, position):
    pieces = laws_of([force], Fluid())
    assert ("velocity_derivatives" in pieces.laws) is velocity
    assert ("position_derivatives" in pieces.laws) is position


def central_difference(pieces, law, pair, field, size):
    """Derivative of a pair's force by a field of its view."""
    high, low = (
        call(pieces, law, pair._replace(**{field: getattr(pair, field) + by}))
        for by in (size, -size)
    )
    return (high - low) / (2.0 * size)


@pytest.mark.parametrize(
    "force", [VanDerWaals(d_min=1e-8), DoubleLayer(debye_length=1e-7), Screened()]
)
def test_slopes_are_the_derivative_by_the_gap(force):
    pieces = laws_of([force], Fluid())
    for pair in PAIRS:
        if abs(pair.gap) > 5e-10:
            slope = call(pieces, "centre_derivatives", pair)[0]
            wanted = central_difference(pieces, "centre_force", pair, "gap", 1e-11)
            assert slope == pytest.approx(wanted, rel=1e-5, abs=1e-12)


def test_damping_is_minus_the_derivative_by_the_rate():
    pieces = laws_of([Lubrication(), VanDerWaals(gap="surface")], Fluid())
    for pair in PAIRS:
        damping = call(pieces, "surface_derivatives", pair)[1]
        wanted = -central_difference(pieces, "surface_force", pair, "gap_rate", 1e-6)
        assert damping == pytest.approx(wanted, rel=1e-6)


def test_a_force_ends_at_its_reach_and_the_scene_at_the_farthest():
    pieces = laws_of([Lubrication(), Lubrication(reach=2e-7)], Fluid())
    assert pieces.surface_reach == 5e-7
    near, middle, far = (PAIRS[-1]._replace(gap=gap) for gap in (1e-7, 3e-7, 6e-7))
    alone = laws_of([Lubrication()], Fluid())
    for pair, count in ((near, 2), (middle, 1), (far, 0)):
        single = Lubrication.kernel(pair, 1e-12, 1e-8)
        assert call(pieces, "surface_force", pair) == pytest.approx(count * single)
    assert call(alone, "surface_force", far) == 0.0


def test_events_of_a_contact_force():
    none = laws_of([Contact()], Fluid())
    assert "contact_event" not in none.laws and none.events == 0
    pulling = SAMPLE_CONTACTS[0]._replace(overlap_rate=-1.0)
    pushing = pulling._replace(overlap_rate=0.0)
    clipped = laws_of([Contact(tension=False)], Fluid())
    pull, push = (call(clipped, "contact_event", view, 0) for view in (pulling, pushing))
    assert pull < 0.0 < push
    # Which slides, and which holds, at the same slip.
    slippery, rough = (
        laws_of([Contact(k_n=20.0, k_t=2.0, friction=mu)], Fluid()) for mu in (1e-3, 10.0)
    )
    slipping = pushing._replace(slip_rate=0.0)
    slides, holds = (call(each, "contact_event", slipping, 1) for each in (slippery, rough))
    assert slides < 0.0 < holds


@attrs.frozen
class Threshold(ContactForce):
    """A force that sets in at an overlap, with one event."""

    onset: float = 5e-9

    @staticmethod
    def kernel(contact, onset):
        return max(contact.overlap - onset, 0.0), 0.0

    @staticmethod
    def events(contact, onset):
        return (contact.overlap - onset,)


def test_events_of_several_forces_stand_in_a_row():
    law = Contact(tension=False)
    pieces = laws_of([Threshold(), law, Threshold(2e-8)], Fluid())
    assert pieces.events == 4
    contact = SAMPLE_CONTACTS[0]
    found = [call(pieces, "contact_event", contact, which) for which in range(4)]
    normal, _ = Contact.events(contact, law.law)
    assert found[0] == pytest.approx(5e-9) and found[3] == pytest.approx(-1e-8)
    assert found[1] == pytest.approx(normal) and found[2] == 1.0


@pytest.mark.parametrize(
    "force, reason",
    [
        (Gravity(0.0), "g is zero"), (VanDerWaals(0.0), "hamaker is zero"),
        (DoubleLayer(0.0), "potential is zero"),
    ],
)  # fmt: skip
def test_absent_forces_are_left_out_with_their_reason(force, reason):
    pieces = laws_of([force], Fluid())
    assert pieces.left_out == {type(force).__name__: reason}
    assert not any(pieces.parameters) and not pieces.laws
