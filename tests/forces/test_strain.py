"""Drag that knows the shape: its torque, its derivatives, and Jeffery's orbit of an ellipse."""

import math

import numpy as np
import pytest

from flocsim import Body, Fluid, Sphere, SpheroPolygon, System
from flocsim.errors import RangeError
from flocsim.forces import StokesDrag
from flocsim.forces.check import SAMPLE_BODIES
from flocsim.forces.codegen import laws_of
from flocsim.integrators import Implicit, Overdamped
from tests.helpers.tiers import rest_slow

SHEAR = 10.0
"""G of the simple shear u = (G y, 0) [1/s]."""

FLOW = Fluid(viscosity=1e-3, gradient=(0.0, SHEAR, 0.0, 0.0))
DRAG = StokesDrag(strain=True)


def ellipse(a, b, corners=40):
    """A regular polygon stretched, whose moments are to each other as those of the ellipse."""
    turn = np.linspace(0.0, 2.0 * math.pi, corners, endpoint=False)
    return SpheroPolygon(np.column_stack([a * np.cos(turn), b * np.sin(turn)]), 1e-4 * b)


THREE_TO_ONE = ellipse(3e-6, 1e-6)


def test_elongation_of_known_shapes():
    assert ellipse(3e-6, 1e-6).elongation == pytest.approx(0.8, rel=1e-4)
    assert ellipse(3e-6, 1e-6).long_axis == pytest.approx(0.0, abs=1e-12)
    assert abs(ellipse(1e-6, 3e-6).long_axis) == pytest.approx(math.pi / 2.0)
    assert (Sphere(1e-6).elongation, Sphere(1e-6).long_axis) == (0.0, 0.0)
    square = SpheroPolygon([(0, 0), (1e-6, 0), (1e-6, 1e-6), (0, 1e-6)], 1e-7)
    assert (square.elongation, square.long_axis) == (0.0, 0.0)
    # Two disks in a row: a stadium of the length L has M₁ − M₂ = ∫(x² − y²), in parts.
    length, r = 4e-6, 1e-6
    long = length**3 * r / 6.0 + math.pi * r**4 / 4.0 + math.pi * r**2 * length**2 / 4.0
    long += 4.0 / 3.0 * length * r**3
    short = 2.0 * length * r**3 / 3.0 + math.pi * r**4 / 4.0
    stadium = SpheroPolygon([(0, 0), (length * math.cos(0.7), length * math.sin(0.7))], r)
    assert stadium.elongation == pytest.approx((long - short) / (long + short), rel=1e-9)
    assert stadium.long_axis == pytest.approx(0.7, rel=1e-9)


@pytest.mark.parametrize("turn", [0.3, 1.2, -2.0])
def test_elongation_turns_and_grows_with_the_shape(turn):
    shape = SpheroPolygon([(0, 0), (4, 1), (3, 2), (1, 1.5)], 0.3)
    c, s = math.cos(turn), math.sin(turn)
    turned = SpheroPolygon(shape.vertices @ [[c, s], [-s, c]], 0.3)
    assert turned.elongation == pytest.approx(shape.elongation, rel=1e-9)
    assert math.sin(turned.long_axis - shape.long_axis - turn) == pytest.approx(0.0, abs=1e-9)
    larger = shape.scaled(3e-6)
    assert (larger.elongation, larger.long_axis) == (shape.elongation, shape.long_axis)


def period_of(method, angle=0.2, shape=THREE_TO_ONE, until=2.5):
    """Twice the time of half a turn [s], without inertia to speak of."""
    body = Body(shape, angle=angle, spin=-1.0, surface_density=1e-3)
    run = System([body], [DRAG], method, FLOW).run(until, jit=False)
    times = np.linspace(0.1, until, 400)
    turned = angle - run.at(times).position[:, 0, 2]
    passed = np.interp([turned[0], turned[0] + math.pi], turned, times)
    return 2.0 * (passed[1] - passed[0])


@pytest.mark.parametrize(
    "method",
    rest_slow(
        [Implicit(1e-9), Overdamped(1e-9)], lambda method: not isinstance(method, Overdamped)
    ),
    ids=lambda method: type(method).__name__,
)
def test_an_ellipse_turns_once_in_jefferys_period(method):
    """2π (a/b + b/a)/G = 20.944/G for 3 : 1, from any angle."""
    assert 2.0 * math.pi * (3.0 + 1.0 / 3.0) == pytest.approx(20.944, abs=5e-4)
    assert period_of(method) == pytest.approx(20.944 / SHEAR, rel=5e-4)


def torque(angle, flow, shape=THREE_TO_ONE, spin=0.0, drag=DRAG):
    body = Body(shape, angle=angle, surface_density=1.0)
    pieces = laws_of([drag], flow)
    view = SAMPLE_BODIES[0]._replace(
        angle=body.angle, spin=spin, radius=shape.equivalent_radius,
        elongation=shape.elongation, long_axis=shape.long_axis,
    )  # fmt: skip
    return pieces.laws["body_force"](view, pieces.parameters)[2]


@pytest.mark.parametrize("angle", [0.0, 0.4, math.pi / 2.0, 2.0, -1.1])
def test_free_spin_in_simple_shear_is_jefferys(angle):
    """dψ/dt = −G (a² sin²ψ + b² cos²ψ)/(a² + b²)."""
    a, b = 3.0, 1.0
    spin = a**2 * math.sin(angle) ** 2 + b**2 * math.cos(angle) ** 2
    spin *= -SHEAR / (a**2 + b**2)
    drag = 8.0 * math.pi * 1e-3 * THREE_TO_ONE.equivalent_radius**3 * SHEAR
    assert torque(angle, FLOW, spin=spin) / drag == pytest.approx(0.0, abs=1e-4)


def test_the_torque_turns_with_flow_and_shape_and_a_mirror_turns_it_round():
    flow = Fluid(gradient=(1.0, 3.0, -0.5, -1.0))
    matrix, turn = np.array(flow.gradient).reshape(2, 2), 0.8
    c, s = math.cos(turn), math.sin(turn)
    turned = np.array([[c, -s], [s, c]]) @ matrix @ np.array([[c, s], [-s, c]])
    mirrored = np.diag([1, -1]) @ matrix @ np.diag([1, -1])
    wanted = torque(0.3, flow)
    assert torque(0.3 + turn, Fluid(gradient=turned.ravel())) == pytest.approx(wanted, rel=1e-9)
    assert torque(-0.3, Fluid(gradient=mirrored.ravel())) == pytest.approx(-wanted, rel=1e-9)
    assert torque(0.3 + math.pi, flow) == pytest.approx(wanted, rel=1e-9)


def test_a_swelling_flow_and_a_round_body_feel_no_strain():
    swelling = Fluid(gradient=(2.0, 0.0, 0.0, 2.0))
    assert torque(0.3, swelling) == 0.0
    assert torque(0.3, FLOW, Sphere(2e-6)) == torque(0.3, FLOW, Sphere(2e-6), drag=StokesDrag())


@pytest.mark.parametrize("law", ["stokes", "schiller_naumann"])
def test_its_derivative_by_the_angle_is_a_law_of_the_scene(law):
    """−8πµ r³ B (2 E_xx cos 2ψ + 2 E_xy sin 2ψ), through the laws that the Jacobian is made of."""
    flow = Fluid(viscosity=1e-3, gradient=(1.5, 4.0, -2.0, -1.5))
    pieces = laws_of([StokesDrag(strain=True, law=law)], flow)
    view = SAMPLE_BODIES[0]._replace(elongation=0.7, long_axis=0.25, angle=0.4)
    found = pieces.laws["position_derivatives"](view, pieces.parameters)[8]
    twice = 2.0 * (0.4 + 0.25)
    slope = 2.0 * (1.5 * math.cos(twice) + 1.0 * math.sin(twice))
    wanted = -8.0 * math.pi * 1e-3 * view.radius**3 * 0.7 * slope
    assert found == pytest.approx(wanted, rel=1e-5)


def test_where_nothing_is_strained_it_is_left_out_and_said():
    for flow in (Fluid(), Fluid(gradient=(0.0, -2.0, 2.0, 0.0)), Fluid(velocity=(1e-3, 0.0))):
        assert DRAG.kernel_in(flow) is StokesDrag().kernel_in(flow)
        text = System([Body(THREE_TO_ONE, density=2650.0)], [DRAG], fluid=flow).explain()
        assert "this flow has no strain: left out" in text
    text = System([Body(THREE_TO_ONE, density=2650.0)], [DRAG], fluid=FLOW).explain()
    assert "strain rotates long bodies" in text


def test_strain_is_a_part_of_the_torque():
    with pytest.raises(RangeError, match="strain must be false if rotational is"):
        StokesDrag(rotational=False, strain=True)
