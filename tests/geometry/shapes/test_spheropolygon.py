"""SpheroPolygon: what it stores, what it refuses, and in which words."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from flocsim import SpheroPolygon
from flocsim.errors import ShapeError
from flocsim.geometry.shapes.spheropolygon import resized
from tests.helpers.tiers import rest_slow
from tests.reference.outline import area_centroid_inertia
from tests.reference.samples import random_core
from tests.reference.scenes import c_shape, convex, segment, spiral, star
from tests.reference.shapes import rotation

SQUARE = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]]) * 1e-6

WRONG = {
    "crossing edges": ([[0, 0], [4, 4], [4, 0], [0, 4]], 1.0, "of 4 vertices is not simple"),
    "a vertex on another edge": ([[0, 0], [4, 0], [4, 4], [2, 0], [0, 4]], 1.0, "not simple"),
    "the same vertex twice": ([[0, 0], [4, 0], [4, 0], [0, 4]], 1.0, r"1 and 2 repeat .*\(4.0, 0"),
    "the first vertex again": ([[0, 0], [4, 0], [0, 4], [0, 0]], 1.0, "3 and 0 repeat"),
    "a vertex met twice": ([[0, 0], [4, 0], [2, 2], [4, 4], [0, 4], [2, 2]], 1.0, "not simple"),
    "points on one line": ([[0, 0], [1, 0], [3, 0]], 1.0, "not simple"),
    "a repeated end": ([[1, 1], [1, 1]], 1.0, "repeat the same point"),
    "nan": ([[0, 0], [4, float("nan")], [4, 4]], 1.0, "vertex 1 is not finite"),
    "too large": ([[0, 0], [1e160, 0], [0, 1e160]], 1.0, "vertices must lie within"),
    "too small a radius": ([[0, 0], [4, 0], [0, 4]], 1e-160, "the radius must be between"),
    "infinity": ([[0, 0], [4, 0], [-float("inf"), 4]], 1.0, "vertex 2 is not finite"),
    "one point": ([[0, 0]], 1.0, r"found \(1, 2\); for one point use Sphere"),
    "no point": ([], 1.0, "N ≥ 2"),
    "a flat list": ([0, 0, 4, 0], 1.0, r"found \(4,\)"),
    "points in space": ([[0, 0, 0], [4, 0, 0], [4, 4, 0]], 1.0, r"found \(3, 3\)"),
    "ragged rows": ([[0, 0], [4, 0, 1], [4, 4]], 1.0, "must be numbers"),
    "words": ([["a", "b"], ["c", "d"]], 1.0, "must be numbers"),
    "no radius": (SQUARE, 0.0, "radius must be .* above 0 .*, found 0.0"),
    "a negative radius": (SQUARE, -1e-6, "found -1e-06"),
    "a radius of nan": (SQUARE, float("nan"), "found nan"),
    "a radius in words": (SQUARE, "wide", "wide"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_makes_no_body_is_refused_in_one_line(case):
    vertices, radius, pattern = WRONG[case]
    with pytest.raises(ShapeError, match=pattern) as caught:
        SpheroPolygon(vertices, radius)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "make_core", rest_slow([convex, star, c_shape, spiral], lambda make: make is c_shape)
)
@given(seed=st.integers(0, 30), radius=st.floats(0.3e-6, 4e-6))
def test_moments_agree_with_the_reference(make_core, seed, radius):
    core = 1e-5 * random_core(make_core, np.random.default_rng(seed))
    shape = SpheroPolygon(core, radius)
    area, centroid, moment = area_centroid_inertia(core, radius)
    assert shape.area == pytest.approx(area, rel=1e-12)
    assert shape.second_moment == pytest.approx(moment, rel=1e-12)
    near = {"rel": 0.0, "abs": 1e-11 * shape.bounding_radius}
    assert shape.centroid == pytest.approx(centroid, **near)
    assert shape.vertices == pytest.approx(core - centroid, **near)


def test_two_vertices_make_a_capsule():
    shape = SpheroPolygon([[1e-6, 0.0], [1e-6, 8e-6]], 2e-6)
    assert shape.area == pytest.approx((4 * 8 + 4 * np.pi) * 1e-12, rel=1e-13)
    assert shape.centroid == pytest.approx([1e-6, 4e-6])
    assert shape.bounding_radius == pytest.approx(6e-6)
    assert shape.vertices == pytest.approx(np.array([[0.0, -4e-6], [0.0, 4e-6]]), abs=1e-20)


def test_vertices_run_counter_clockwise_from_the_first_one_given():
    shape = SpheroPolygon(SQUARE[::-1], 1e-6)
    assert shape.vertices + 2e-6 == pytest.approx(
        np.array([[0, 4], [0, 0], [4, 0], [4, 4]]) * 1e-6, abs=1e-18
    )


def test_a_shape_is_frozen_and_keeps_no_hold_on_what_it_was_made_from():
    given_vertices = SQUARE.copy()
    shape = SpheroPolygon(given_vertices, 1e-6)
    given_vertices[0] = 9.0
    assert shape.vertices.max() < 1e-5
    with pytest.raises(ValueError, match="read-only"):
        shape.vertices[0, 0] = 1.0
    with pytest.raises(AttributeError):
        shape.radius = 2e-6


@given(st.integers(0, 30), st.floats(1e-3, 1e3))
def test_scaled_is_what_scaled_vertices_make(seed, factor):
    shape = SpheroPolygon(1e-5 * random_core(star, np.random.default_rng(seed)), 1e-6)
    scaled = shape.scaled(factor)
    made = SpheroPolygon(shape.vertices * factor, shape.radius * factor)
    assert scaled.area == pytest.approx(made.area, rel=1e-12)
    assert scaled.second_moment == pytest.approx(made.second_moment, rel=1e-12)
    assert scaled.vertices == pytest.approx(made.vertices, rel=1e-12, abs=1e-12 * made.radius)
    assert scaled.radius == made.radius
    assert not scaled.vertices.flags.writeable


@pytest.mark.parametrize("factor", [0.0, -1.0, float("nan"), float("inf")])
def test_a_shape_cannot_be_scaled_to_nothing(factor):
    with pytest.raises(ShapeError, match="above 0"):
        SpheroPolygon(SQUARE, 1e-6).scaled(factor)


@given(st.floats(-7.0, 7.0), st.floats(-1e-4, 1e-4), st.floats(-1e-4, 1e-4))
def test_placed_vertices_are_turned_then_moved(angle, x, y):
    shape = SpheroPolygon(SQUARE, 1e-6)
    expected = shape.vertices @ rotation(angle).T + (x, y)
    assert shape.placed_vertices(x, y, angle) == pytest.approx(expected, abs=1e-18)


TYPES = [4.62e-6, 4.95e-6, 16.41e-6, 23.02e-6]


@pytest.mark.parametrize(
    "make_core",
    rest_slow([segment, convex, star, c_shape, spiral], lambda make: make is star),
)
@given(seed=st.integers(0, 40), size=st.sampled_from(TYPES), share=st.floats(0.02, 0.95))
@example(seed=3, size=4.62e-6, share=0.2417179327071084)  # arcs that cross at some 1e-5 rad
@example(seed=20, size=4.62e-6, share=0.3)  # whose area is right to 1e-4 in the last but one step
def test_equivalent_radius_is_exact_and_the_spheroradius_as_wanted(make_core, seed, size, share):
    core = random_core(make_core, np.random.default_rng(seed))
    shape = SpheroPolygon(core, 0.1)
    body = resized(shape, size, share * size)
    assert body.equivalent_radius == pytest.approx(size, rel=1e-12)
    assert body.radius == pytest.approx(share * size, rel=1e-9)
    area, _, _ = area_centroid_inertia(body.vertices, body.radius)
    assert np.sqrt(area / np.pi) == pytest.approx(size, rel=1e-12)
    # The core keeps its form: all its sides are longer or shorter by one factor.
    sides = [np.hypot(*(np.roll(v, -1, axis=0) - v).T) for v in (body.vertices, shape.vertices)]
    assert np.ptp(sides[0] / sides[1]) <= 1e-9 * (sides[0] / sides[1]).max()


@pytest.mark.parametrize("radius", [5e-6, 6e-6])
def test_a_spheroradius_that_leaves_no_room_is_refused(radius):
    shape = SpheroPolygon([[0, 0], [1e-5, 0], [0, 1e-5]], 1e-6)
    with pytest.raises(ShapeError, match=r"leaves no room .* r_eq = 5e-06 m: choose a smaller"):
        resized(shape, 5e-6, radius)
