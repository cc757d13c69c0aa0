"""Distances between points and segments, against shapely."""

import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from flocsim.body import Fluid, scene_of
from flocsim.geometry.shapes.cores import closest_share, edge_count, edge_end, segment_distance2
from tests.helpers.fast_scene import bodies_of
from tests.reference.samples import scene_of as random_scene

coordinates = st.integers(-1000, 1000).map(lambda count: count / 100.0)
places = st.tuples(coordinates, coordinates)


@given(places, places, places)
def test_distance_is_that_of_shapely(point, start, end):
    segment = shapely.LineString([start, end])
    distance = segment_distance2(*point, *start, *end) ** 0.5
    assert distance == pytest.approx(segment.distance(shapely.Point(point)), rel=1e-6, abs=1e-9)
    share = closest_share(*point, *start, *end)
    assert 0.0 <= share <= 1.0
    foot = [a + share * (b - a) for a, b in zip(start, end, strict=True)]
    assert shapely.Point(foot).distance(shapely.Point(point)) == pytest.approx(distance, abs=1e-9)


@given(places, places)
def test_a_segment_without_length_is_a_point(point, place):
    assert closest_share(*point, *place, *place) == 0.0
    expected = shapely.Point(point).distance(shapely.Point(place))
    assert segment_distance2(*point, *place, *place) ** 0.5 == pytest.approx(expected, abs=1e-150)


def test_a_point_has_no_edge_a_segment_one_a_polygon_as_many_as_points():
    assert [edge_count(points) for points in (1, 2, 3, 64)] == [0, 1, 3, 64]


def test_the_last_edge_of_each_body_ends_where_the_first_begins():
    scene = scene_of(bodies_of(random_scene(1), surface_density=2.0), Fluid(), [])
    for body, first in enumerate(scene.first[:-1]):
        count = scene.first[body + 1] - first
        starts = range(first, first + edge_count(count))
        ends = [edge_end(first, count, start) - first for start in starts]
        assert ends == [*range(1, len(ends)), 0] if count > 2 else ends in ([], [1])
