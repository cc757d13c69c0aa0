"""Roots of attraction = repulsion, against the numbers of MODEL sections 5 and 7."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import lambertw

from flocsim.ensembles.collision.start import (
    LARGEST_RATIO,
    attraction_ratio,
    balance,
    neutral_distance,
    zone_distance,
)
from flocsim.ensembles.config.schema import ZoneConfig
from flocsim.ensembles.study import Study
from flocsim.errors import ZoneError
from flocsim.forces import DoubleLayer, VanDerWaals
from flocsim.state.views import PairView
from tests.helpers.small_study import small_config

PAPER = (1e-18, 15e-3, 0.98e-6, 78.5)
RADII = (16.41e-6, 23.02e-6)

ROOTS = [
    (PAPER, 343.52e-9, 5924.98e-9, 2e-5),
    ((1e-18, 25e-3, 98e-9, 78.5), 83.9e-9, 380e-9, 2e-3),
    ((4.7e-20, 15e-3, 9.6e-9, 78.5), 10.9e-9, 30.9e-9, 5e-3),
    ((1e-20, 25e-3, 0.98e-9, 78.5), 0.839e-9, 3.80e-9, 2e-3),
]
"""(H_A, φ, 1/κ, ε_r), inner and outer root [m], relative accuracy of the printed digits."""


def pair_forces(hamaker, potential, debye_length, permittivity):
    """Attraction and double layer of such numbers."""
    layer = DoubleLayer(potential=potential, debye_length=debye_length, permittivity=permittivity)
    return VanDerWaals(hamaker=hamaker), layer


def net_force(numbers, gap, radius_i, radius_j):
    """(repulsion, attraction) [N] that the package's own kernels give."""
    _, layer = pair_forces(*numbers)
    reduced = radius_i * radius_j / (radius_i + radius_j)
    pair = PairView(0.0, gap, 0.0, 0.0, radius_i, radius_j, reduced, 1.0)
    attraction = -VanDerWaals.kernel(pair, numbers[0], 1e-12)
    return DoubleLayer.kernel(pair, layer.strength, 1.0 / numbers[2]), attraction


@pytest.mark.parametrize(("numbers", "inner", "outer", "digits"), ROOTS)
def test_roots_are_the_known_ones(numbers, inner, outer, digits):
    assert neutral_distance(*pair_forces(*numbers), "inner") == pytest.approx(inner, rel=digits)
    assert neutral_distance(*pair_forces(*numbers), "outer") == pytest.approx(outer, rel=digits)


@pytest.mark.parametrize("numbers", [row[0] for row in ROOTS])
@pytest.mark.parametrize("radii", [RADII, (4.62e-6, 4.95e-6), (1e-7, 1e-3)])
@pytest.mark.parametrize("root", ["inner", "outer"])
def test_the_two_forces_balance_at_a_root_for_bodies_of_any_size(numbers, radii, root):
    distance = neutral_distance(*pair_forces(*numbers), root)
    repulsion, attraction = net_force(numbers, distance, *radii)
    assert repulsion == pytest.approx(attraction, rel=1e-9)
    # Between the roots repulsion wins, beyond them attraction.
    inwards = net_force(numbers, 0.99 * distance, *radii)
    assert (inwards[0] > inwards[1]) == (root == "outer")


def test_the_ratio_of_the_paper_and_of_its_printed_length():
    assert attraction_ratio(*pair_forces(*PAPER)) == pytest.approx(0.086541, abs=5e-7)
    assert attraction_ratio(*pair_forces(1e-18, 15e-3, 0.98e-9, 78.5)) == pytest.approx(
        86.5, abs=0.05
    )


@pytest.mark.parametrize("debye_length", [0.98e-9, 98e-9])
@pytest.mark.parametrize("root", ["inner", "outer"])
def test_no_root_is_an_error_and_no_number(debye_length, root):
    with pytest.raises(ZoneError, match=r"no attraction zone.*give zone\.distance") as caught:
        neutral_distance(*pair_forces(1e-18, 15e-3, debye_length, 78.5), root)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("hamaker", "potential"), [(0.0, 15e-3), (1e-18, 0.0)], ids=["no attraction", "no repulsion"]
)
def test_without_one_of_the_forces_there_is_no_root(hamaker, potential):
    with pytest.raises(ZoneError, match="no attraction zone"):
        neutral_distance(*pair_forces(hamaker, potential, 0.98e-6, 78.5), "outer")


def test_the_roots_meet_where_they_vanish():
    hamaker = PAPER[0] * LARGEST_RATIO / attraction_ratio(*pair_forces(*PAPER))
    below, above = hamaker * (1.0 - 1e-9), hamaker * (1.0 + 1e-9)
    for root in ("inner", "outer"):
        assert neutral_distance(*pair_forces(below, *PAPER[1:]), root) == pytest.approx(
            2 * 0.98e-6, rel=1e-4
        )
        with pytest.raises(ZoneError):
            neutral_distance(*pair_forces(above, *PAPER[1:]), root)


def forces(count=1):
    """The paper's pair forces, the attraction ``count`` times."""
    return [VanDerWaals(hamaker=1e-18)] * count + [DoubleLayer(potential=15e-3, debye_length=98e-8)]


def test_the_zone_is_the_radii_and_the_root():
    expected = sum(RADII) + neutral_distance(*pair_forces(*PAPER), "outer")
    assert zone_distance(ZoneConfig(), forces(), *RADII) == pytest.approx(expected, rel=1e-12)
    smaller = zone_distance(ZoneConfig(), forces(), 1e-6, 2e-6)
    assert smaller - 3e-6 == pytest.approx(expected - sum(RADII), rel=1e-9)


def test_a_zone_that_is_given_needs_no_root():
    assert zone_distance(ZoneConfig(distance=5e-6), (), *RADII) == sum(RADII) + 5e-6
    assert zone_distance(ZoneConfig(centre=45e-6), (), *RADII) == 45e-6


@pytest.mark.parametrize("some", [forces()[:1], forces()[1:], (), forces(2)])
def test_a_root_needs_just_one_force_of_each_kind(some):
    with pytest.raises(ZoneError, match=r"needs just one \w+ force to balance, found [02]"):
        zone_distance(ZoneConfig(), some, *RADII)


def test_the_paper_as_printed_has_no_zone(tmp_path):
    config = small_config(tmp_path, {"preset": "tang2014-literal"})
    study = Study(config, flocs=[])
    with pytest.raises(ZoneError, match=r"S = 86\.5"):
        study.encounter(0, 1, study.numbers(0))


@pytest.mark.parametrize(("root", "branch"), [("inner", 0), ("outer", -1)])
@given(ratio=st.floats(1e-300, 0.999 * LARGEST_RATIO))
def test_the_balance_is_lamberts_function(root, branch, ratio):
    expected = -2.0 * lambertw(-0.5 * math.sqrt(ratio), branch).real
    assert balance(ratio, root) == pytest.approx(expected, rel=1e-12)
