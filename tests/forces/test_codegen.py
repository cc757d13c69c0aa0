"""The scene's own functions: sums of the kernels, with the derivatives that a scene needs."""

import math

import attrs
import pytest

from flocsim import Fluid
from flocsim import hooks as slots
from flocsim.fields import quantity
from flocsim.forces import (
    BodyForce,
    CentreForce,
    Contact,
    DoubleLayer,
    Gravity,
    StokesDrag,
    SurfaceForce,
    VanDerWaals,
)
from flocsim.forces.check import SAMPLE_BODIES, SAMPLE_CONTACTS, sample_pairs
from flocsim.forces.codegen import scene_functions

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
class Helped(BodyForce):
    """Reads the velocity in a helper."""

    @staticmethod
    def kernel(body):
        return -1e-6 * speed_of(body), 0.0, 0.0


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


def call(pieces, slot, view):
    """What the scene's function for a slot returns."""
    return pieces.fillings.get(slot, slot)(view, pieces.parameters)


def test_body_forces_add_up():
    fluid = Fluid(gradient=(0.1, 0.2, 0.3, -0.1))
    forces = [Gravity(), StokesDrag(), Trap()]
    for body in SAMPLE_BODIES:
        parts = [call(scene_functions([force], fluid), slots.body_force, body) for force in forces]
        total = call(scene_functions(forces, fluid), slots.body_force, body)
        assert total == pytest.approx([sum(part) for part in zip(*parts, strict=True)], rel=1e-14)


@pytest.mark.parametrize(
    "force, velocity, position",
    [
        (Gravity(), False, False), (StokesDrag(), True, False), (Trap(), False, True),
        (Helped(), True, False), (HelpedTwice(), True, False), (Unpacked(), True, False),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, BodyForce) else "",
)  # fmt: skip
def test_derivatives_are_asked_of_the_forces_that_have_them(force, velocity, position):
    pieces = scene_functions([force], Fluid())
    assert pieces.fillings[slots.reads_velocity]() is velocity
    assert pieces.fillings[slots.reads_position]() is position


def test_a_flow_that_varies_makes_drag_a_function_of_place():
    shear = scene_functions([StokesDrag()], Fluid(gradient=(0.0, 1.0, 0.0, 0.0)))
    assert shear.fillings[slots.reads_position]()


def central_difference(pieces, slot, pair, field, size):
    """Derivative of a pair's force by a field of its view."""
    high, low = (
        call(pieces, slot, pair._replace(**{field: getattr(pair, field) + by}))
        for by in (size, -size)
    )
    return (high - low) / (2.0 * size)


@pytest.mark.parametrize(
    "force", [VanDerWaals(d_min=1e-8), DoubleLayer(debye_length=1e-7), Screened()]
)
def test_slopes_are_the_derivative_by_the_gap(force):
    pieces = scene_functions([force], Fluid())
    for pair in PAIRS:
        if abs(pair.gap) > 5e-10:
            slope = call(pieces, slots.centre_slope, pair)
            wanted = central_difference(pieces, slots.centre_force, pair, "gap", 1e-11)
            assert slope == pytest.approx(wanted, rel=1e-5, abs=1e-12)


def test_damping_is_minus_the_derivative_by_the_rate():
    pieces = scene_functions([Lubrication(), VanDerWaals(gap="surface")], Fluid())
    for pair in PAIRS:
        damping = call(pieces, slots.surface_damping, pair)
        wanted = -central_difference(pieces, slots.surface_force, pair, "gap_rate", 1e-6)
        assert damping == pytest.approx(wanted, rel=1e-6)


def test_a_force_ends_at_its_reach_and_the_scene_at_the_farthest():
    pieces = scene_functions([Lubrication(), Lubrication(reach=2e-7)], Fluid())
    assert pieces.fillings[slots.surface_reach](pieces.parameters) == 5e-7
    near, middle, far = (PAIRS[-1]._replace(gap=gap) for gap in (1e-7, 3e-7, 6e-7))
    alone = scene_functions([Lubrication()], Fluid())
    for pair, count in ((near, 2), (middle, 1), (far, 0)):
        single = Lubrication.kernel(pair, 1e-12, 1e-8)
        assert call(pieces, slots.surface_force, pair) == pytest.approx(count * single)
    assert call(alone, slots.surface_force, far) == 0.0


def test_contact_forces_and_their_slip_limit():
    pieces = scene_functions([Contact(k_n=20.0, k_t=2.0, friction=0.5)], Fluid())
    for contact in SAMPLE_CONTACTS:
        limit = call(pieces, slots.slip_limit, contact)
        assert limit == pytest.approx(0.5 * 20.0 * contact.overlap / 2.0)
    free = scene_functions([Contact()], Fluid())
    assert call(free, slots.slip_limit, SAMPLE_CONTACTS[0]) == math.inf
    assert free.fillings[slots.has_contact]() and not slots.has_contact()


def test_kinks_of_a_contact_force():
    assert slots.kink not in scene_functions([Contact()], Fluid()).fillings
    pulling = SAMPLE_CONTACTS[0]._replace(overlap_rate=-1.0)
    pushing = pulling._replace(overlap_rate=0.0)
    clipped = scene_functions([Contact(tension=False)], Fluid())
    assert call(clipped, slots.kink, pulling) < 0.0 < call(clipped, slots.kink, pushing)
    # Which slides, and which holds, at the same slip.
    slippery, rough = (
        scene_functions([Contact(k_n=20.0, k_t=2.0, friction=mu)], Fluid()) for mu in (1e-3, 10.0)
    )
    slipping = pushing._replace(slip_rate=0.0)
    assert call(slippery, slots.kink, slipping) < 0.0 < call(rough, slots.kink, slipping)


@pytest.mark.parametrize(
    "force, reason",
    [
        (Gravity(0.0), "g is zero"), (VanDerWaals(0.0), "hamaker is zero"),
        (DoubleLayer(0.0), "potential is zero"),
    ],
)  # fmt: skip
def test_absent_forces_are_left_out_with_their_reason(force, reason):
    pieces = scene_functions([force], Fluid())
    assert pieces.left_out == {type(force).__name__: reason}
    assert not pieces.parameters and slots.centre_force not in pieces.fillings
