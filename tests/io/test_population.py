"""Diameters by number and volume, and the perimeter-based fractal dimension, by closed forms."""

import numpy as np
import pytest

from flocsim.io.fit_report import diameters_at, perimeter_dimension


def test_of_flocs_of_one_size_all_diameters_are_that():
    assert diameters_at([3.0] * 5, True).tolist() == [3.0] * 3


def test_by_number_d50_is_the_median():
    for sizes in ([4.0, 1.0, 2.0], [1.0, 2.0, 5.0, 9.0]):
        assert diameters_at(sizes, False)[1] == np.median(sizes)


def test_of_a_lognormal_population_they_are_as_hatch_and_choate_have_them():
    """ln D50 by volume is ln D50 by number + 3σ²; D10 and D90 lie 1.2816 σ around each."""
    sigma, rng = 0.4, np.random.default_rng(5)
    sizes = 10e-6 * np.exp(sigma * rng.standard_normal(200_000))
    for by_volume, middle in ((False, 0.0), (True, 3 * sigma**2)):
        expected = middle + np.array([-1.2816, 0.0, 1.2816]) * sigma
        assert np.log(diameters_at(sizes, by_volume) / 10e-6) == pytest.approx(expected, abs=0.01)


def test_the_volume_of_a_large_floc_counts_as_such():
    """A floc of 10 holds as much as a thousand of 1."""
    assert diameters_at([1.0] * 1000 + [10.0], True, [0.25]) == pytest.approx([1.0])
    assert diameters_at([1.0] * 1000 + [10.0], True, [0.76]) == pytest.approx([10.0])


@pytest.mark.parametrize("dimension", [1.0, 1.2, 1.7])
def test_a_power_law_has_its_dimension(dimension):
    areas = np.geomspace(1e-12, 1e-9, 20)
    value, error = perimeter_dimension(areas, 4.0 * areas ** (dimension / 2))
    assert value == pytest.approx(dimension) and error < 1e-6


def test_the_interval_holds_the_dimension_of_scattered_flocs_95_times_in_100():
    rng, held = np.random.default_rng(2), 0
    areas = np.geomspace(1.0, 100.0, 12)
    for _ in range(400):
        scattered = areas ** (1.3 / 2) * np.exp(0.1 * rng.standard_normal(12))
        value, error = perimeter_dimension(areas, scattered)
        held += abs(value - 1.3) <= error
    assert 0.92 <= held / 400 <= 0.98


def test_two_sizes_have_no_dimension():
    assert perimeter_dimension(np.array([1.0, 2.0, 2.0]), np.array([4.0, 6.0, 6.1])) is None
