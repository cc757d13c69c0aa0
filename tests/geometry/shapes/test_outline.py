"""Whether a polygon is simple, and outlines as rings."""

import numpy as np
import pytest
import shapely

from flocsim import SpheroPolygon
from flocsim.errors import ShapeError
from flocsim.geometry.shapes.outline import require_simple, simplicity_fault, swept_rings
from flocsim.geometry.shapes.parts import Part
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
