"""Whether a polygon is simple, and outlines as rings."""

import numpy as np
import pytest
import shapely

from flocsim import Composite, Sphere, SpheroPolygon
from flocsim.errors import ShapeError
from flocsim.geometry.shapes.cores import Part
from flocsim.geometry.shapes.outline import (
    feret_diameters,
    require_simple,
    simplicity_fault,
    swept_rings,
)
from tests.reference.samples import random_core
from tests.reference.scenes import c_shape, spiral, star


@pytest.mark.parametrize("make_core", [star, c_shape, spiral])
def test_simple_polygons_have_no_fault(make_core):
    core = random_core(make_core, np.random.default_rng(5))
    assert simplicity_fault(core) is None and simplicity_fault(core[::-1]) is None
    require_simple(core)


def test_the_place_of_a_crossing_is_named():
    bow_tie = np.array([[0.0, 0.0], [4.0, 4.0], [4.0, 0.0], [0.0, 4.0]])
    assert "2 2" in simplicity_fault(bow_tie)
    with pytest.raises(ShapeError, match=r"4 vertices .*\[2 2\]"):
        require_simple(bow_tie)


def test_rings_enclose_the_area_holes_included():
    angles = np.linspace(0.3, 2 * np.pi - 0.3, 12)
    arc = np.column_stack([np.cos(angles), np.sin(angles)])
    shape = SpheroPolygon(np.vstack([3 * arc, 2.5 * arc[::-1]]), 1.0)
    rings = shape.outline(1.0, 2.0, 0.4, points_per_quadrant=200)
    assert len(rings) == 2
    areas = [shapely.Polygon(ring).area for ring in rings]
    assert areas[0] - areas[1] == pytest.approx(shape.area, rel=1e-4)
    assert all(np.array_equal(ring[0], ring[-1]) for ring in rings)
    centroid = shapely.Polygon(rings[0], rings[1:]).centroid
    assert [centroid.x, centroid.y] == pytest.approx([1.0, 2.0], abs=1e-4)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_points_segments_and_polygons_have_one_ring(count):
    core = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 3.0]])[:count]
    (ring,) = swept_rings([Part((core,), 1.0)])
    distance = shapely.Polygon(ring).exterior.distance(shapely.Point(core[0]))
    assert distance == pytest.approx(1.0, rel=1e-2)


RIGHT = pytest.approx


def turned(points, angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(points, float) @ np.array([[c, s], [-s, c]])


def test_a_sphere_is_a_disc():
    found = Sphere(2e-6).measures
    assert found.perimeter == RIGHT(4e-6 * np.pi)
    assert (found.feret_max, found.feret_min) == (4e-6, 4e-6)
    assert (found.aspect_ratio, found.circularity, found.solidity) == (1.0, 1.0, 1.0)


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.2])
@pytest.mark.parametrize(("a", "b", "r"), [(3.0, 1.0, 0.5), (2.0, 2.0, 1e-3), (8.0, 1.0, 3.0)])
def test_a_rounded_rectangle(a, b, r, angle):
    corners = turned([(0, 0), (a, 0), (a, b), (0, b)], angle)
    shape = SpheroPolygon(1e-6 * corners, 1e-6 * r)
    area, perimeter = a * b + 2 * (a + b) * r + np.pi * r**2, 2 * (a + b) + 2 * np.pi * r
    found = shape.measures
    assert found.perimeter == RIGHT(1e-6 * perimeter, rel=1e-4)
    assert found.circularity == RIGHT(4 * np.pi * area / perimeter**2, rel=1e-3)
    assert found.solidity == RIGHT(1.0, abs=1e-9)
    assert found.feret_max == RIGHT(1e-6 * (np.hypot(a, b) + 2 * r), rel=1e-3)
    assert found.feret_min == RIGHT(1e-6 * (min(a, b) + 2 * r), rel=1e-3)


def test_a_thin_rectangle_has_the_aspect_ratio_of_its_sides():
    shape = SpheroPolygon([(0, 0), (5, 0), (5, 2), (0, 2)], 1e-6)
    assert shape.measures.aspect_ratio == RIGHT(2.5, rel=1e-5)


def test_a_bay_lowers_the_solidity():
    """An L of three unit squares in a hull of 3.5."""
    shape = SpheroPolygon([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], 1e-6)
    assert shape.measures.solidity == RIGHT(3.0 / 3.5, rel=1e-4)
    assert shape.measures.perimeter == RIGHT(8.0, rel=1e-4)


def test_two_discs_that_overlap():
    """Radius 1, centres 1 apart: 4π/3 of each outline is left, the hull is a stadium."""
    found = Composite([(Sphere(1.0), (0.0, 0.0)), (Sphere(1.0), (1.0, 0.0))]).measures
    assert found.perimeter == RIGHT(8 * np.pi / 3, rel=1e-4)
    area = 2 * np.pi - (2 * np.pi / 3 - np.sqrt(3) / 2)
    assert found.solidity == RIGHT(area / (np.pi + 2), rel=1e-3)
    assert (found.feret_max, found.feret_min) == RIGHT((3.0, 2.0), rel=1e-3)


def test_a_hole_adds_its_outline():
    ring = [np.array([(1.0, 1.0), (1.0, 2.0), (2.0, 2.0), (2.0, 1.0)])]
    square = [(0, 0), (3, 0), (3, 3), (0, 3)]
    whole, holed = SpheroPolygon(square, 1e-6), SpheroPolygon(square, 1e-6, holes=ring)
    assert holed.measures.perimeter == RIGHT(whole.measures.perimeter + 4.0, rel=1e-4)
    assert holed.measures.solidity == RIGHT(8.0 / 9.0, rel=1e-4)


def test_measures_do_not_depend_on_size_and_lengths_grow_with_it():
    rng = np.random.default_rng(3)
    angle = np.sort(rng.uniform(0, 2 * np.pi, 24))
    core = np.stack([np.cos(angle), np.sin(angle)], axis=1) * rng.uniform(0.5, 1.0, (24, 1))
    one = SpheroPolygon(core, 0.1)
    other = one.scaled(1e-5).measures
    for name in ("aspect_ratio", "circularity", "solidity"):
        assert getattr(other, name) == RIGHT(getattr(one.measures, name), rel=1e-9)
    for name in ("perimeter", "feret_max", "feret_min"):
        assert getattr(other, name) == RIGHT(1e-5 * getattr(one.measures, name), rel=1e-9)


@pytest.mark.parametrize("angle", [0.0, 0.4, 0.9])
def test_the_least_feret_of_a_triangle_is_its_height(angle):
    corners = turned([(0, 0), (4, 0), (1, 3)], angle)
    sides = np.hypot(*(corners - np.roll(corners, 1, axis=0)).T)
    assert feret_diameters(corners) == RIGHT((sides.max(), 2 * 6.0 / sides.max()))
