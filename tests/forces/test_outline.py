"""How smooth the gap of two outlines may be: lengths of change, and the line below them."""

import math

import attrs
import numpy as np
import pytest

from flocsim import Fluid, Sphere, SpheroPolygon
from flocsim.constants import LARGEST_BIAS
from flocsim.forces import DoubleLayer, SurfaceForce, VanDerWaals
from flocsim.forces.outline import change_lengths, smoothing_of, smoothness

GAPS = np.geomspace(1e-11, 1e-3, 160)


@pytest.mark.parametrize("force", [
    DoubleLayer(debye_length=0.98e-6, gap="surface"), DoubleLayer(debye_length=3e-9, gap="surface"),
])  # fmt: skip
def test_an_exponential_changes_over_its_decay_length(force):
    found = change_lengths(force, Fluid())[GAPS[:-1] < 0.4 * force.reach]
    assert found == pytest.approx(force.debye_length, rel=0.05)


@pytest.mark.parametrize("d_min", [1e-9, 2e-8, 1e-6])
def test_attraction_changes_over_half_the_gap(d_min):
    found = change_lengths(VanDerWaals(d_min=d_min, gap="surface"), Fluid())
    beyond = (GAPS[:-1] > d_min) & (GAPS[1:] < 99.0 * d_min)
    assert found[beyond] == pytest.approx(0.5 * GAPS[:-1][beyond], rel=0.07)
    assert np.isinf(found[GAPS[1:] < d_min]).all()


@attrs.frozen
class Even(SurfaceForce):
    """The same at all gaps."""

    @staticmethod
    def kernel(pair):
        return 1e-9


@attrs.frozen
class Film(SurfaceForce):
    """In proportion to the gap's rate, in either direction, and falling with it over 50 nm."""

    @staticmethod
    def kernel(pair):
        return -1e-3 * pair.gap_rate * math.exp(-pair.gap / 5e-8)


def test_a_force_that_is_the_same_everywhere_does_not_change():
    assert np.isinf(change_lengths(Even(), Fluid())).all()
    least, slope, most = smoothness([Even()], Fluid())
    assert least == most > 0.0 == slope


def test_a_force_that_hangs_on_the_gaps_rate_changes_too():
    found = change_lengths(Film(), Fluid())[GAPS[:-1] < 4e-7]
    assert found == pytest.approx(5e-8, rel=0.05)


@pytest.mark.parametrize("forces", [
    [VanDerWaals(gap="surface")],
    [DoubleLayer(debye_length=3e-8, gap="surface")],
    [VanDerWaals(d_min=1e-10, gap="surface"), DoubleLayer(debye_length=1e-7, gap="surface")],
    [Film(), Even()],
])  # fmt: skip
def test_the_line_stays_below_the_lengths_of_all_forces(forces):
    least, slope, most = smoothness(forces, Fluid())
    line = np.minimum(least + slope * GAPS[:-1], most)
    for force in forces:
        within = GAPS[:-1] < min(force.reach, 1e-4)
        assert np.all(line[within] <= change_lengths(force, Fluid())[within] * (1.0 + 1e-9))
    assert line.min() > 0.0


def test_smoothing_goes_with_the_number_of_pairs():
    square = SpheroPolygon(1e-6 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]), 1e-7)
    shortest, growth, end = smoothing_of((1e-9, 0.25, 1e-8), [Sphere(1e-6), square, square])
    share = LARGEST_BIAS / math.log(2 * 4 * 4)
    assert (shortest, growth, end) == pytest.approx((share * 1e-9, share * 0.25, 9e-9 / 0.25))
