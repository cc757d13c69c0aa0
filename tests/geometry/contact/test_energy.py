"""Van der Waals energies of outlines against published and independent numbers."""

import math

import numpy as np
import pytest

from flocsim import Sphere, SpheroPolygon
from flocsim.errors import ShapeError
from flocsim.geometry.contact.attraction import attraction_energy
from flocsim.geometry.shapes.pieces import (
    outline_pieces,
    polygon_pieces,
)

CORNERS = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
SQUARE = polygon_pieces(CORNERS)
CYLINDER = outline_pieces(Sphere(1.0).parts)
GROUND = polygon_pieces(np.array([[-2e3, -4e3], [2e3, -4e3], [2e3, 0.0], [-2e3, 0.0]]))


@pytest.mark.parametrize(
    ("gap", "energy", "share"),
    [(1.0, -0.00668183, 0.4575), (0.1, -2.27962, 0.8846), (0.01, -261.3031, 0.9857)],
)
def test_squares_and_cubes(gap, energy, share):
    """Squares without end along the third direction, and what a depth of one side leaves."""
    found = attraction_energy(SQUARE, SQUARE, (1.0 + gap, 0.0, 0.0), 1.0)
    assert found == pytest.approx(energy, rel=1e-6)
    cubes = attraction_energy(SQUARE, SQUARE, (1.0 + gap, 0.0, 0.0), 1.0, depth=1.0)
    assert cubes / found == pytest.approx(share, abs=6e-5)


def test_cubes_far_apart_are_points():
    """E = −H V²/(π² r⁶)."""
    found = attraction_energy(SQUARE, SQUARE, (100.0, 0.0, 0.3), 1.0, depth=1.0)
    assert found == pytest.approx(-1.0 / (math.pi**2 * 1e12), rel=1e-3)


@pytest.mark.parametrize(("gap", "share"), [(0.1, 0.850824), (0.02, 0.965715)])
def test_cylinders_over_derjaguin(gap, share):
    """Of −H √R/(24 d^{3/2})."""
    found = attraction_energy(CYLINDER, CYLINDER, (2.0 + gap, 0.0, 0.4), 1.0)
    assert found / (-1.0 / (24.0 * gap**1.5)) == pytest.approx(share, abs=1e-6)


@pytest.mark.parametrize(
    ("radius", "gap", "energy"),
    [(0.1, 0.01, -282.71267), (0.1, 0.001, -27110.840), (0.5, 0.01, -306.32818)],
)
def test_a_rounded_square_over_a_half_space(radius, gap, energy):
    rounded = outline_pieces(SpheroPolygon(CORNERS, radius=radius).parts)
    found = attraction_energy(rounded, GROUND, (0.0, 0.5 + radius + gap, 0.0), 1.0)
    assert found == pytest.approx(energy, rel=1e-6)


@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_the_far_field_is_that_of_areas(angle):
    """−(3H/8π) A₁ A₂/ρ⁵ (1 + 25/4 (i₁ + i₂)/(ρ²)), i the second moment of area over the area."""
    away, second = 60.0, 1.0 / 6.0
    found = attraction_energy(SQUARE, SQUARE, (away, 0.0, angle), 1.0)
    points = -3.0 / (8.0 * math.pi) / away**5
    assert found == pytest.approx(points * (1.0 + 6.25 * 2.0 * second / away**2), rel=2e-5)


def test_what_is_no_polygon_is_refused():
    with pytest.raises(ShapeError, match="N of 3 or more"):
        polygon_pieces(CORNERS[:2])
