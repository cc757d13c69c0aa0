"""Spheres that meet in water: published and exact efficiencies."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flocsim.errors import UsageError
from flocsim.hydrodynamics import Meeting, SpherePair, encounters
from flocsim.hydrodynamics.rigid_bodies import drag_factor
from tests.helpers.tiers import rest_slow


@pytest.fixture
def long_steps(monkeypatch):
    """Ways in three times as long steps: an error that two sides of an equation share."""
    monkeypatch.setattr(encounters, "STEP", 3.0 * encounters.STEP)
    monkeypatch.setattr(encounters, "SMOOTHNESS", 3.0 * encounters.SMOOTHNESS)


def attraction(radii, k):
    """−H_A r*/(6 d²) with H_A = 36πµ k, in units of µ = 1."""
    first, second = radii
    return lambda gap: -6.0 * np.pi * k * first * second / (first + second) / gap**2


def settling(k, water, radii=(0.5, 1.0), touch=1e-7):
    """b_c/R of spheres of one density, k over w R²."""
    size = sum(radii)
    speeds = [radius**2 for radius in radii]
    force = attraction(radii, k * abs(speeds[1] - speeds[0]) * size**2)
    weights = tuple(6.0 * np.pi * radius**3 for radius in radii)
    meeting = Meeting(SpherePair(radii), force, touch * size, water)
    return meeting.settling(weights) ** 0.5


@pytest.mark.parametrize(("k", "with_water", "without"), rest_slow([
    (1e-2, 0.6288, 1.30769), (1e-4, 0.2537, 1.0474), (1e-6, 0.1400, 1.0075),
], lambda k, *_: k == 1e-4))  # fmt: skip
def test_settling(k, with_water, without):
    assert settling(k, True) == pytest.approx(with_water, rel=3e-3)
    assert settling(k, False) == pytest.approx(without, rel=3e-4)
    assert settling(k, True, (1.0, 0.5)) == pytest.approx(settling(k, True), rel=1e-6)


@pytest.mark.parametrize(("k", "with_water", "without"), rest_slow([
    (1e-2, 0.604, 1.51), (1e-3, 0.325, 1.19), (1e-4, 0.189, 1.07), (1e-5, 0.110, 1.03),
], lambda k, *_: False))  # fmt: skip
def test_shear(long_steps, k, with_water, without):
    pair, force = SpherePair((1.0, 1.0)), attraction((1.0, 1.0), k)
    assert Meeting(pair, force, 1e-7).in_flow("shear", 1.0) == pytest.approx(with_water, rel=8e-3)
    alone = Meeting(pair, force, 1e-7, water=False).in_flow("shear", 1.0)
    assert alone == pytest.approx(without, abs=6e-3)


@pytest.mark.parametrize(
    ("radius", "alpha"),
    rest_slow([(5e-6, 0.257), (10e-6, 0.159), (20e-6, 0.096)], lambda radius, alpha: False),
)
def test_quartz_in_shear(radius, alpha):
    def force(gap):
        return -4.7e-20 * 0.5 * radius / (6.0 * np.maximum(gap, 1e-9) ** 2)

    meeting = Meeting(SpherePair((radius, radius), 0.89e-3), force, 1e-9)
    assert meeting.in_flow("shear", 10.0) == pytest.approx(alpha, rel=0.02)


@pytest.mark.parametrize("flow", ["shear", "extension"])
@pytest.mark.parametrize("rate", rest_slow([1.0, 30.0], lambda rate: rate == 30.0))
def test_without_water_and_forces_all_of_the_kernel_touches(flow, rate):
    meeting = Meeting(SpherePair((0.4, 1.0)), np.zeros_like, 1e-6, water=False)
    assert meeting.in_flow(flow, rate) == pytest.approx(1.0, rel=1e-3)


@pytest.mark.slow
def test_in_shear_small_ones_come_round_before_they_meet():
    # Closed ways around the large one let no small one near (Wang, Zinchenko and Davis 1994).
    def share(ratio, flow):
        radii = (ratio, 1.0)
        return Meeting(SpherePair(radii), attraction(radii, 1e-6), 1e-5).in_flow(flow, 1.0)

    assert share(0.02, "shear") == 0.0 < share(0.02, "extension")
    assert share(0.1, "shear") < 0.3 * share(0.1, "extension")


def test_repulsion_keeps_all_apart():
    meeting = Meeting(SpherePair((0.5, 1.0)), lambda gap: 1e3 * np.exp(-gap / 0.1), 1e-4)
    assert meeting.settling((0.1, 1.0)) == 0.0
    assert meeting.in_flow("shear", 1.0) == 0.0


def test_a_force_that_gives_no_number_is_refused():
    def force(gap):
        return np.where(gap < 0.1, np.nan, 0.0)

    with pytest.raises(UsageError, match="is not finite at a gap of 5e-07 m"):
        Meeting(SpherePair((1.0, 1.0)), force, 1e-6).in_flow("shear", 1.0)


@pytest.mark.parametrize("touch", [0.0, -1e-9, 1.0, float("nan")])
def test_a_touch_lies_near_the_spheres(touch):
    with pytest.raises(UsageError, match="touch must be above 0 m"):
        Meeting(SpherePair((1.0, 1.0)), np.zeros_like, touch)


@pytest.mark.parametrize(("flow", "rate"), [("rotation", 1.0), ("shear", 0.0), ("shear", -1.0)])
def test_other_flows_are_refused(flow, rate):
    with pytest.raises(UsageError, match="flow must be one of shear, extension"):
        Meeting(SpherePair((1.0, 1.0)), np.zeros_like, 1e-6).in_flow(flow, rate)


def test_alike_ones_never_meet():
    with pytest.raises(UsageError, match="settle at the same speed"):
        Meeting(SpherePair((1.0, 1.0)), np.zeros_like, 1e-6).settling((1.0, 1.0))


def permeable(radii, k, flow, water=True):
    """The share that touches of spheres of permeability 1/25 of the larger one's r²."""
    inner = tuple(r * drag_factor(r, 0.04) for r in radii)
    passed = sum(radii) - sum(inner)
    meeting = Meeting(SpherePair(inner), attraction(radii, k), 1e-7, water, passed)
    if flow:
        return meeting.in_flow(flow, 1.0)
    return meeting.settling(weights_of(radii))


def test_what_water_passes_through_touches_as_its_solid_inside_does_at_a_distance():
    inner, passed, touch = (0.6, 1.0), 0.05, 1e-3
    pair, weights = SpherePair(inner), weights_of(inner)
    solid = Meeting(pair, np.zeros_like, passed + touch).settling(weights)
    found = Meeting(pair, np.zeros_like, touch, passed=passed).settling(weights)
    assert found * (1.6 + passed) ** 2 == pytest.approx(solid * 1.6**2, rel=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("flow", ["", "shear"])
def test_permeable_spheres_touch_more_often_than_solid_ones(long_steps, flow):
    radii = (0.5, 1.0)
    found = permeable(radii, 1e-4, flow)
    meeting = Meeting(SpherePair(radii), attraction(radii, 1e-4), 1e-7)
    solid = meeting.in_flow(flow, 1.0) if flow else meeting.settling(weights_of(radii))
    assert 1.5 * solid < found < 0.9 * permeable(radii, 1e-4, flow, water=False)


def weights_of(radii):
    return tuple(6.0 * np.pi * radius**3 for radius in radii)


@pytest.mark.parametrize("radii", [(1.0, 1.0), (0.5, 1.5)])
@pytest.mark.parametrize("flow", ["shear", "extension"])
def test_paths_in_a_flow_are_displaced_as_far_as_they_are_integrated(radii, flow):
    pair, reach = SpherePair(radii), sum(radii)
    offset, near, far = 0.8 * reach, 3.0 * reach, 60.0 * reach
    log, square = encounters.bend_in_flow(pair, near)

    def rates(_, place):
        r = np.hypot(*place)
        n, motion = place / r, pair.relative(np.array([r - reach]))
        swept = FLOWS_IN_PLANE[flow] @ place
        spin = np.array([place[1], -place[0]]) * 0.5 * (flow == "shear")
        along = swept @ n
        reduced = motion.stretch[0] * along * n + motion.shear[0] * (swept - along * n)
        return spin + swept - reduced

    def arrived(_, place):
        return np.hypot(*place) - near

    arrived.terminal = True
    start = (-far, offset) if flow == "shear" else (offset**2 / (2.0 * far), far)
    x, y = solve_ivp(rates, [0.0, 1e4], start, events=arrived, rtol=1e-8, atol=1e-10).y[:, -1]
    if flow == "shear":
        assert y == pytest.approx(np.exp(log) * np.sqrt(offset**2 + square), rel=1e-4)
    else:
        assert x * y == pytest.approx(0.5 * offset**2 * np.exp(2.0 * log), rel=1e-4)


FLOWS_IN_PLANE = {
    "shear": np.array([[0.0, 0.5], [0.5, 0.0]]), "extension": np.diag([1.0, -1.0])
}  # fmt: skip
