"""Area, centroid and second moment: closed forms, scaling, and outlines that meet themselves."""

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from flocsim.geometry.shapes.cores import Part, edges_of, from_edges, inside_polygon
from flocsim.geometry.shapes.moments import all_moments, area_and_growth
from tests.helpers.tiers import rest_slow
from tests.reference.outline import area_centroid_inertia
from tests.reference.samples import random_core
from tests.reference.scenes import c_shape, convex, spiral, star
from tests.reference.shapes import rotation


def swept_moments(vertices, radius):
    """Area, centroid and second moment of one swept ring (N, 2)."""
    return all_moments((Part((vertices,), radius),))[:3]


SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])


def test_disk_and_capsule():
    area, centroid, moment = swept_moments(np.array([[1.0, 2.0]]), 3.0)
    assert [area, moment] == pytest.approx([9 * np.pi, 81 * np.pi / 2], rel=1e-14)
    assert centroid == pytest.approx([1.0, 2.0])
    length, r = 5.0, 0.7
    ends = np.pi * r**4 / 2 + np.pi * r**2 * length**2 / 4 + 4 / 3 * r**3 * length
    bar = length * 2 * r * (length**2 + 4 * r**2) / 12
    area, centroid, moment = swept_moments(np.array([[1.0, 0.0], [1.0, length]]), r)
    assert [area, moment] == pytest.approx([2 * r * length + np.pi * r**2, bar + ends], rel=1e-13)
    assert centroid == pytest.approx([1.0, length / 2], rel=1e-13)


def test_rounded_square():
    r = 0.5
    area, centroid, moment = swept_moments(SQUARE, r)
    assert area == pytest.approx(4 + 8 * r + np.pi * r**2, rel=1e-14)
    assert centroid == pytest.approx([1.0, 1.0], rel=1e-14)
    # Core, four rectangles beside it, and four quarter disks at its corners.
    quarter_centroid = 1 + 4 * r / (3 * np.pi)
    quarter = np.pi * r**4 / 8 - np.pi * r**2 / 4 * 2 * (4 * r / (3 * np.pi)) ** 2
    beside = 2 * r * (4 + r**2) / 12 + 2 * r * (1 + r / 2) ** 2
    corner = quarter + np.pi * r**2 / 4 * 2 * quarter_centroid**2
    assert moment == pytest.approx(4 * 8 / 12 + 4 * beside + 4 * corner, rel=1e-13)


@given(st.integers(3, 40), st.floats(0.01, 3.0))
def test_convex_outlines_obey_steiner(count, radius):
    angles = 2 * np.pi * (np.arange(count) + 0.3 * np.sin(np.arange(count))) / count
    core = np.column_stack([np.cos(angles), 0.6 * np.sin(angles)])
    polygon = shapely.Polygon(core)
    expected = polygon.area + polygon.length * radius + np.pi * radius**2
    assert swept_moments(core, radius)[0] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    "make_core", rest_slow([convex, star, c_shape, spiral], lambda make: make is c_shape)
)
@given(seed=st.integers(0, 40), radius=st.floats(0.02, 0.4))
def test_the_area_grows_with_the_radius_by_the_length_of_the_outline(make_core, seed, radius):
    core = random_core(make_core, np.random.default_rng(seed))
    area, growth = area_and_growth([Part((core,), radius)])
    assert area == swept_moments(core, radius)[0]
    assert growth == pytest.approx(shapely.Polygon(core).buffer(radius, 400).length, rel=1e-4)


def test_the_outline_of_a_hole_counts():
    outer, hole = SQUARE * 5.0, (SQUARE * 2.0 + 3.0)[::-1]
    _, growth = area_and_growth([Part((outer, hole), 0.5)])
    assert growth == pytest.approx(40 + np.pi + 4 * (4 - 1), rel=1e-13)


def ring(mouth):
    """A square ring, 10 wide and 2 thick, with a mouth of the given width on its right."""
    low, high = 5 - mouth / 2, 5 + mouth / 2
    return np.array([
        [0, 0], [10, 0], [10, low], [8, low], [8, 2], [2, 2], [2, 8], [8, 8], [8, high],
        [10, high], [10, 10], [0, 10],
    ], dtype=float)  # fmt: skip


def test_a_mouth_that_the_sweep_closes_leaves_a_hole():
    # Outline and hole both dip into the mouth, between the arcs about its corners.
    dip = 1 - (0.5 * np.sqrt(0.75) + np.arcsin(0.5))
    area, _, _ = swept_moments(ring(1.0), 1.0)
    assert area == pytest.approx(100 + 40 + np.pi - 16 - 2 * dip, rel=1e-13)


@pytest.mark.parametrize("mouth", [1.0, 1.9, 1.999999, 2.0, 2.000001, 2.1, 3.0])
def test_area_is_continuous_while_the_mouth_closes(mouth):
    area, centroid, moment = swept_moments(ring(mouth), 1.0)
    expected = area_centroid_inertia(ring(mouth), 1.0)
    assert [area, moment] == pytest.approx([expected[0], expected[2]], rel=1e-12)
    assert centroid == pytest.approx(expected[1], rel=1e-12)


def test_a_hole_that_the_sweep_fills_is_gone():
    area, _, _ = swept_moments(ring(1.0), 3.1)
    filled = swept_moments(SQUARE * 5.0, 3.1)[0]
    # What is left is the square less the dip of the mouth.
    half = np.arccos(0.5 / 3.1)
    dip = 2 * (0.5 * 3.1 - 0.5 * (0.5 * 3.1 * np.sin(half) + 3.1**2 * (np.pi / 2 - half)))
    assert area == pytest.approx(filled - dip, rel=1e-12)


@pytest.mark.parametrize(
    "make_core", rest_slow([convex, star, c_shape, spiral], lambda make: make is c_shape)
)
@given(seed=st.integers(0, 50), scale=st.floats(1e-3, 1e3), angle=st.floats(-7.0, 7.0))
def test_scaling_turning_and_moving(make_core, seed, scale, angle):
    core = random_core(make_core, np.random.default_rng(seed))
    radius = 0.02 + 0.3 * (seed % 7) / 7
    area, centroid, moment = swept_moments(core, radius)
    placed = scale * core @ rotation(angle).T + (3.0, -2.0)
    other = swept_moments(placed, scale * radius)
    assert other[0] == pytest.approx(area * scale**2, rel=1e-9)
    assert other[2] == pytest.approx(moment * scale**4, rel=1e-9)
    expected = scale * rotation(angle) @ centroid + (3.0, -2.0)
    assert other[1] == pytest.approx(expected, abs=1e-9 * (scale + 4.0))


def bent_square(bend):
    """A square of side 2 whose edges are bent by ``bend`` at their middles, and its area swept
    by r = 1: outwards (bend > 0) it is convex, inwards the offsets meet over the corner."""
    rise = np.tan(bend / 2)
    middles = np.array([[0, -1 - rise], [1 + rise, 0], [0, 1 + rise], [-1 - rise, 0]])
    core = np.stack([SQUARE - 1.0, middles], axis=1).reshape(-1, 2)
    steps = np.hypot(*(np.roll(core, -1, axis=0) - core).T).sum()
    if bend >= 0.0:
        return core, 4 + 4 * rise + steps + np.pi
    corners = np.pi / 2 - bend
    return core, 4 + 4 * rise + steps + 4 * (corners / 2 - np.tan(-bend / 2))


@pytest.mark.parametrize("size", [0.0, 1e-14, 1e-11, 1e-8, 1e-6, 1e-5, 6e-5, 8e-5, 1e-4, 1e-2])
@pytest.mark.parametrize("sign", [1, -1])
def test_edges_bent_ever_so_little(size, sign):
    core, expected = bent_square(sign * size)
    assert swept_moments(core, 1.0)[0] == pytest.approx(expected, rel=1e-9)


@given(st.integers(0, 30), st.floats(-1.5, 1.5), st.floats(-1.5, 1.5))
def test_distances_and_insides_are_those_of_shapely(seed, x, y):
    core = random_core(star, np.random.default_rng(seed))
    polygon, point = shapely.Polygon(core), shapely.Point(x, y)
    nearest = np.linalg.norm(from_edges(np.array([[x, y]]), *edges_of(core)), axis=-1).min()
    assert nearest == pytest.approx(polygon.exterior.distance(point), rel=1e-12, abs=1e-15)
    if nearest > 1e-12:
        assert inside_polygon(np.array([[x, y]]), core)[0] == polygon.contains(point)
