"""Curvilinear factors of solid spheres: values, limits, and the flows that they come from."""

import doctest

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flocsim.errors import UsageError
from flocsim.io.results import kernel_tables
from flocsim.io.results.kernel_tables import CORRECTIONS, curvilinear_factor

PAIRS = [(name, each) for name in CORRECTIONS for each in CORRECTIONS[name]]
RATIOS = np.geomspace(1e-6, 1.0, 200)


@pytest.mark.parametrize(("name", "mechanism", "equal"), [
    ("hill", "settling", 1.0 / 8.0), ("hill", "shear", 9.8 / 1.3 / 9.0),
    ("burd", "settling", 1.0 / 8.0), ("burd", "shear", 1.0 - 8.5 / 32.0),
])  # fmt: skip
def test_spheres_of_one_size_have_these(name, mechanism, equal):
    assert curvilinear_factor(name, mechanism, 3e-6, 3e-6) == pytest.approx(equal, rel=1e-14)


@pytest.mark.parametrize(("name", "mechanism"), PAIRS)
def test_factors_are_symmetric_below_one_and_rise_with_the_ratio(name, mechanism):
    factors = curvilinear_factor(name, mechanism, 1e-4 * RATIOS, 1e-4)
    assert np.array_equal(factors, curvilinear_factor(name, mechanism, 1e-4, 1e-4 * RATIOS))
    assert np.all((factors > 0.0) & (factors < 1.0)) and np.all(np.diff(factors) > 0.0)


@pytest.mark.parametrize(("name", "mechanism", "slope"), [
    ("hill", "settling", 0.5), ("hill", "shear", 9.8 / 1.3), ("burd", "shear", 7.5),
])  # fmt: skip
def test_a_small_one_is_met_by_the_square_of_its_size(name, mechanism, slope):
    assert curvilinear_factor(name, mechanism, 1e-9, 1e-3) == pytest.approx(slope * 1e-12, rel=1e-5)


def test_the_formulas_are_those_of_the_codes():
    p = RATIOS[100:]
    burd = 1.0 - (1.0 + 5.0 * p + 2.5 * p * p) / (1.0 + p) ** 5
    assert curvilinear_factor("burd", "shear", p, 1.0) == pytest.approx(burd, rel=1e-8)
    # As kernels, where the codes have them: 9.8 (p/(1 + 2p))² γ R³ for 1.3 γ R³, and
    # π/2 r_small² |Δw| for π R² |Δw|.
    small, large = 4e-6, 1e-5
    size, ratio = small + large, small / large
    shear = 1.3 * size**3 * curvilinear_factor("hill", "shear", small, large)
    theirs = 9.8 * (ratio / (1.0 + 2.0 * ratio)) ** 2 * size**3
    assert shear == pytest.approx(theirs, rel=1e-12, abs=0.0)
    settling = np.pi * size**2 * curvilinear_factor("hill", "settling", large, small)
    assert settling == pytest.approx(0.5 * np.pi * small**2, rel=1e-12, abs=0.0)


def strained(_, place):
    """Stokes's flow around a free sphere of radius 1 in a strain that draws in along x."""
    strain = np.array([-1.0, 0.5, 0.5])
    r2 = place @ place
    r5 = r2**2.5
    along = place @ (strain * place)
    return strain * place * (1.0 - 1.0 / r5) - 2.5 * along * place * (1.0 / r5) * (1.0 - 1.0 / r2)


@pytest.mark.parametrize("p", [0.1, 0.5, 1.0])
def test_points_of_a_strained_flow_reach_burds_share(p):
    # The last way that touches the distance R = 1 + p does so where its radial speed is 0,
    # cos² = 1/3. Far upstream, x y² is what it carries, and R³ (1/3)^(1/2) (2/3) without a sphere.
    size = 1.0 + p
    cosine = np.sqrt(1.0 / 3.0)
    start = size * np.array([cosine, np.sqrt(1.0 - cosine**2), 0.0])
    back = solve_ivp(
        lambda t, y: -strained(t, y), (0.0, 11.0), start, method="DOP853", rtol=1e-11, atol=1e-13
    )
    x, y, _ = back.y[:, -1]
    assert x > 1000.0
    undisturbed = start[0] * start[1] ** 2
    share = x * y**2 / undisturbed
    assert curvilinear_factor("burd", "shear", p, 1.0) == pytest.approx(share, rel=1e-6)


def test_a_small_sphere_of_the_same_density_is_caught_from_half_its_area():
    # Stokes's flow past a sphere comes to a distance 1 + p with this share of its speed; a small
    # sphere settles by itself with p² of it.
    p = 1e-3
    near = 1.0 + p
    speed = 1.0 - 1.5 / near + 0.5 / near**3
    share = (speed - p**2) / (1.0 - p**2)
    assert curvilinear_factor("hill", "settling", p, 1.0) == pytest.approx(share, rel=6e-3)


def test_what_has_no_factor_is_refused():
    for name, mechanism in (("hill", "extension"), ("han_lawler", "shear")):
        with pytest.raises(UsageError, match=f"{name} has no curvilinear factor for {mechanism}:"):
            curvilinear_factor(name, mechanism, 1e-6, 1e-6)
    for wrong in (0.0, -1e-6, np.nan, np.inf):
        with pytest.raises(UsageError, match="must be above 0 and finite"):
            curvilinear_factor("burd", "shear", 1e-6, [1e-6, wrong])


def test_the_example_of_its_docstring():
    assert doctest.testmod(kernel_tables).failed == 0
