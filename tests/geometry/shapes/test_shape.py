"""Sphere: one core point."""

import numpy as np
import pytest

from flocsim import Sphere
from flocsim.errors import ShapeError


def test_closed_forms():
    sphere = Sphere(3e-6)
    assert sphere.area == pytest.approx(9e-12 * np.pi, rel=1e-15)
    assert sphere.second_moment == pytest.approx(40.5e-24 * np.pi, rel=1e-15)
    assert [sphere.equivalent_radius, sphere.bounding_radius] == pytest.approx([3e-6, 3e-6])
    assert sphere.vertices.tolist() == [[0.0, 0.0]]
    assert sphere.placed_vertices(1.0, 2.0, 0.3).tolist() == [[1.0, 2.0]]


@pytest.mark.parametrize("radius", ["wide", "1 s", ""])
def test_a_text_that_is_no_length_is_refused_in_one_line(radius):
    with pytest.raises(ShapeError, match="the radius") as caught:
        Sphere(radius)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("radius", [0, -1e-6, np.nan, np.inf, None, True, [1e-6], 1j])
def test_a_radius_that_is_no_length_is_refused_in_one_line(radius):
    with pytest.raises(ShapeError, match=r"finite number above 0 \(metres\), found") as caught:
        Sphere(radius)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("radius", [np.float64(2.0), np.float32(2.0), np.int64(2), 2])
def test_any_real_number_will_do(radius):
    assert type(Sphere(radius).radius) is float and Sphere(radius).radius == 2.0


def test_scaled():
    assert Sphere(2e-6).scaled(2.5).radius == pytest.approx(5e-6)
    with pytest.raises(ShapeError, match="above 0"):
        Sphere(2e-6).scaled(-1.0)


def test_outline_is_a_closed_ring_on_the_circle():
    (ring,) = Sphere(2.0).outline(x=1.0, points_per_quadrant=8)
    assert ring[0] == pytest.approx(ring[-1])
    assert np.hypot(ring[:, 0] - 1.0, ring[:, 1]) == pytest.approx(np.full(len(ring), 2.0))
