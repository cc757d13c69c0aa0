"""Resistance of two spheres: published values, what must hold, and another way to compute it."""

import itertools

import numpy as np
import pytest
from scipy.integrate import quad

from flocsim.errors import UsageError
from flocsim.hydrodynamics import SpherePair, TwoSpheres
from tests.helpers.tiers import rest_slow
from tests.reference.stokeslets import resistances

EQUAL = SpherePair((1.0, 1.0))
RATIOS = [0.25, 0.5, 2.0]
ONE = 6.0 * np.pi
"""Resistance of a sphere alone."""


def mobility(pair, gap):
    """(along (2, 2), across (4, 4)) at one gap."""
    return np.linalg.inv(pair.along(gap)[0][0]), np.linalg.inv(pair.across(gap)[0][0])


@pytest.mark.parametrize(("gap", "value"), [(1e-4, 1.3971), (0.01, 1.4034)])
def test_both_pulled_across(gap, value):
    across = mobility(EQUAL, gap)[1]
    assert ONE * (across[0, 0] + across[0, 1]) == pytest.approx(value, abs=1e-4)


@pytest.mark.parametrize(("gap", "value"), [(0.01, 0.018719), (0.1, 0.134893)])
def test_pulled_apart(gap, value):
    along = mobility(EQUAL, gap)[0]
    assert ONE * (along[0, 0] - along[0, 1]) == pytest.approx(value, abs=1e-6)


def test_two_spheres_squeeze_water_as_in_brenners_series():
    # H. Brenner (1961), Chem. Eng. Sci. 16, 242, of two equal spheres that approach each other.
    for gap in (0.02, 0.2, 1.0):
        alpha, n = np.arccosh(1.0 + 0.5 * gap), np.arange(1, 400)
        m = (n + 0.5) * alpha
        keep = m < 300.0
        n, m = n[keep].astype(float), m[keep]
        top = 4.0 * np.cosh(m) ** 2 + (2 * n + 1) ** 2 * np.sinh(alpha) ** 2
        bottom = 2.0 * np.sinh(2.0 * m) - (2 * n + 1) * np.sinh(2.0 * alpha)
        weight = n * (n + 1) / ((2 * n - 1) * (2 * n + 3))
        series = 4.0 / 3.0 * np.sinh(alpha) * np.sum(weight * (top / bottom - 1.0))
        along = EQUAL.along(gap)[0][0]
        assert (along[0, 0] - along[0, 1]) / ONE == pytest.approx(series, rel=2e-6)


def test_straining_flow_near_touching():
    near = EQUAL.relative([1e-7, 1e-6])
    assert (1.0 - near.stretch) / [1e-7, 1e-6] == pytest.approx(4.077, abs=1e-3)


def test_straining_flow_far_away():
    # Batchelor and Green (1972): A = 5/s³ − 8/s⁵ …, B = 16/3 s⁻⁵ …
    far = EQUAL.relative(48.0)
    assert far.stretch[0] == pytest.approx(5.0 / 50.0**3 - 8.0 / 50.0**5, rel=2e-3)
    assert far.shear[0] == pytest.approx(16.0 / 3.0 / 50.0**5, rel=2e-2)


def test_a_rigid_doublet_in_shear():
    tension, turning = EQUAL.doublet([1e-8, 1e-4])
    # At most E_nn = G/2.
    assert 0.5 * tension / np.pi == pytest.approx(6.116, abs=2e-3)
    assert tension == pytest.approx(38.43, rel=1e-3)
    assert 4.0 * np.pi / np.sqrt(1.0 - turning**2) == pytest.approx(15.62, abs=0.01)
    # Of quartz of 5 um, 1 nm apart at least, the rate that opens it.
    pair = SpherePair((5e-6, 5e-6), 0.89e-3)
    attraction = 4.7e-20 * 2.5e-6 / (6.0 * 1e-9**2)
    assert attraction / (0.5 * pair.doublet(1e-9)[0][0]) == pytest.approx(4.58e4, rel=0.02)


@pytest.mark.parametrize("ratio", rest_slow([0.02, 0.1, *RATIOS], lambda ratio: ratio == 0.5))
def test_an_unequal_doublet(ratio):
    first, second = SpherePair((1.0, ratio)), SpherePair((ratio, 1.0))
    for own, other in zip(first.doublet([1e-6, 0.1]), second.doublet([1e-6, 0.1]), strict=True):
        assert own == pytest.approx(other, rel=1e-9)
    tension, turning = first.doublet([1e-6, 1e-8])
    assert tension[0] == pytest.approx(tension[1], rel=1e-3) and tension.min() > 0.0
    assert turning[0] == pytest.approx(turning[1], rel=1e-4) and 0.0 <= turning.min() < 0.6


def test_a_doublet_far_apart_is_held_by_two_drags():
    tension, turning = EQUAL.doublet(1e4)
    assert tension == pytest.approx(3.0 * np.pi * 1e4, rel=1e-3)
    assert turning == pytest.approx(1.0, rel=1e-3)


@pytest.mark.slow
def test_batchelors_settling_coefficient():
    def excess(s):
        along, across = mobility(EQUAL, s - 2.0)
        own = along[0, 0] + 2.0 * across[0, 0]
        other = along[0, 1] + 2.0 * across[0, 1]
        return (ONE * (own + other) - 3.0 - 3.0 / s) * s * s

    ends = [2.0 + 1e-9, 2.001, 2.1, 4.0, 40.0]
    near = sum(quad(excess, *each, epsabs=1e-6)[0] for each in itertools.pairwise(ends))
    # Beyond, −15/4 s⁻².
    assert -5.0 + near - 3.75 / 40.0 == pytest.approx(-6.5486, abs=3e-3)


@pytest.mark.parametrize("ratio", rest_slow([1.0, *RATIOS], lambda ratio: False))
def test_point_forces_say_the_same(ratio):
    gap = 1.0
    resistance, strain = resistances(ratio, gap)
    pair = SpherePair((1.0, ratio))
    for (known, known_strain), places, column in (
        (pair.along(gap), [0, 6], 0), (pair.across(gap), [1, 7, 5, 11], 1),
    ):  # fmt: skip
        largest = np.abs(known).max()
        assert known[0] == pytest.approx(resistance[np.ix_(places, places)], abs=2e-5 * largest)
        largest = np.abs(known_strain).max()
        assert known_strain[0] == pytest.approx(strain[places, column], abs=2e-4 * largest)


@pytest.mark.parametrize("ratio", rest_slow([0.02, 0.1, *RATIOS, 50.0], lambda ratio: ratio == 0.5))
def test_the_resistance_is_positive_and_reciprocal(ratio):
    pair = SpherePair((1.0, ratio))
    gap = np.geomspace(1e-7, 1e3, 60) * (1.0 + ratio)
    for resistance, _ in (pair.along(gap), pair.across(gap)):
        assert resistance == pytest.approx(np.swapaxes(resistance, 1, 2), rel=1e-8, abs=1e-12)
        scale = np.sqrt(np.diagonal(resistance, axis1=1, axis2=2))
        scaled = resistance / scale[:, :, None] / scale[:, None, :]
        assert np.linalg.eigvalsh(scaled).min() > 0.0


@pytest.mark.parametrize("ratio", rest_slow([0.1, *RATIOS], lambda ratio: ratio == 0.5))
def test_spheres_change_places(ratio):
    pair, other = SpherePair((1.0, ratio)), SpherePair((ratio, 1.0))
    gap = np.array([1e-4, 0.1, 2.0])
    first, second = pair.relative(gap), other.relative(gap)
    assert first.along == pytest.approx(-second.along[:, ::-1], rel=1e-9)
    assert first.across == pytest.approx(-second.across[:, ::-1], rel=1e-9)
    assert first.stretch == pytest.approx(second.stretch, rel=1e-9)
    assert first.shear == pytest.approx(second.shear, rel=1e-9)


@pytest.mark.parametrize("ratio", [0.01, 60.0, 0.0, -1.0, float("nan")])
def test_other_ratios_are_refused(ratio):
    assert SpherePair((1e-6, 5e-5)).functions.ratio == pytest.approx(50.0)
    with pytest.raises(UsageError, match=r"0\.02 to 50 times each other"):
        TwoSpheres(ratio)


@pytest.mark.parametrize("given", [((0.0, 1.0), 1.0), ((1.0, np.inf), 1.0), ((1.0, 1.0), -1.0),
                                   ((1.0, 1.0, 1.0), 1.0)])  # fmt: skip
def test_what_are_no_two_spheres_in_water(given):
    with pytest.raises(UsageError, match="need two radii and a viscosity above 0"):
        SpherePair(*given)


@pytest.mark.parametrize("gap", [0.0, -1e-9, float("nan"), [1.0, 0.0]])
def test_spheres_that_touch_are_refused(gap):
    with pytest.raises(UsageError, match="must be above 0 m"):
        EQUAL.along(gap)
