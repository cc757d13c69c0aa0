"""Shape integrals against a drawn union of pieces, and masses."""

import numpy as np
import pytest
import shapely

from tests.reference.outline import area_centroid_inertia, core_geometry
from tests.reference.samples import random_core
from tests.reference.scenes import c_shape, convex, segment, spiral, star
from tests.reference.shapes import make_body


@pytest.mark.parametrize("make_core", [segment, convex, star, c_shape, spiral])
@pytest.mark.parametrize("seed", range(4))
def test_integrals_agree_with_a_union_of_many_sided_pieces(make_core, seed):
    rng = np.random.default_rng(seed)
    core, radius = random_core(make_core, rng), rng.uniform(0.03, 0.5)
    area, centroid, inertia = area_centroid_inertia(core, radius)
    drawn = swept_by_union(core, radius)
    assert area == pytest.approx(drawn.area, rel=1e-10)
    assert centroid == pytest.approx(drawn.centroid.coords[0], abs=1e-10)
    assert inertia == pytest.approx(polar_moment(drawn, centroid), rel=1e-9)
    if make_core in (segment, convex):
        perimeter = core_geometry(core).length * (2 if len(core) == 2 else 1)
        expected = core_geometry(core).area + perimeter * radius + np.pi * radius**2
        assert area == pytest.approx(expected, rel=1e-13)


def swept_by_union(core, radius, sides=4000):
    """Core, a rectangle along each edge, a disk at each vertex (a polygon of the disk's area)."""
    angles = np.arange(sides) * 2 * np.pi / sides
    equal_area = radius * np.sqrt(2 * np.pi / sides / np.sin(2 * np.pi / sides))
    disk = equal_area * np.array([np.cos(angles), np.sin(angles)]).T
    edges = zip(core, np.roll(core, -1, axis=0), strict=True)
    bars = [shapely.LineString(edge).buffer(radius, cap_style="flat") for edge in edges]
    return shapely.union_all(
        [core_geometry(core), *bars, *(shapely.Polygon(v + disk) for v in core)]
    )


def polar_moment(polygon, centroid):
    """Σ cross (a·a + a·b + b·b)/12 over the edges a → b of all rings: exact for a polygon."""
    ordered = shapely.orient_polygons(polygon)
    total = 0.0
    for ring in [ordered.exterior, *ordered.interiors]:
        points = np.array(ring.coords) - centroid
        a, b = points[:-1], points[1:]
        cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        total += np.sum(cross * np.sum(a * a + a * b + b * b, axis=1)) / 12
    return total


def test_mass_conventions():
    sheet = make_body(convex(np.random.default_rng(0)), 0.1, surface_density=2.0)
    solid = make_body(convex(np.random.default_rng(0)), 0.1, density=2650.0)
    assert sheet.mass == pytest.approx(2.0 * np.pi * sheet.equivalent_radius**2)
    assert solid.mass == pytest.approx(2650.0 * 4 / 3 * np.pi * solid.equivalent_radius**3)
    assert solid.inertia / solid.mass == pytest.approx(sheet.inertia / sheet.mass)
