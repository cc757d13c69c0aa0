"""Shapes with holes and of several parts: areas and moments of unions, and what is refused."""

import pickle

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from flocsim import Body, Composite, Sphere, SpheroPolygon
from flocsim.errors import ShapeError
from flocsim.geometry.shapes.cores import parts_in, table_of
from flocsim.geometry.shapes.spheropolygon import resized, shape_of_parts
from tests.helpers.compound_shapes import MAKERS, SQUARE, beads, drawn, framed


def lens(r, s, apart):
    """Area that two disks share."""
    a = r * r * np.arccos((apart**2 + r * r - s * s) / (2.0 * apart * r))
    b = s * s * np.arccos((apart**2 + s * s - r * r) / (2.0 * apart * s))
    root = (-apart + r + s) * (apart + r - s) * (apart - r + s) * (apart + r + s)
    return a + b - 0.5 * np.sqrt(root)


@given(st.floats(0.2, 3.0), st.floats(0.2, 3.0), st.floats(0.01, 0.99))
def test_two_disks_share_a_lens(r, s, place):
    apart = abs(r - s) + place * (r + s - abs(r - s))
    pair = Composite([(Sphere(r), (0.0, 0.0)), (Sphere(s), (apart, 0.0), 1.0)])
    assert pair.area == pytest.approx(np.pi * (r * r + s * s) - lens(r, s, apart), rel=1e-9)


def test_a_frame_is_a_square_less_its_hole():
    found = framed()
    solid = SpheroPolygon(5.0 * SQUARE, 1.0)
    assert found.area == pytest.approx(solid.area - 16.0, rel=1e-13)
    assert found.second_moment == pytest.approx(solid.second_moment - 16.0 * 32.0 / 12.0, rel=1e-13)
    assert found.bounding_radius == solid.bounding_radius
    assert np.array_equal(found.vertices[:4], solid.vertices)


@pytest.mark.parametrize("make", MAKERS)
def test_moments_are_those_of_shapely(make):
    found = make()
    for points, close in ((200, 2e-5), (800, 1.3e-6)):
        known = drawn(found, points)
        assert found.area == pytest.approx(known.area, rel=close)
        assert [known.centroid.x, known.centroid.y] == pytest.approx([0.0, 0.0], abs=4.0 * close)
        assert found.second_moment == pytest.approx(polar(known), rel=4.0 * close)


def polar(region):
    """∫ρ² dA of a shapely region, by Green's theorem over its rings."""
    total = 0.0
    for piece in getattr(region, "geoms", [region]):
        for ring, sign in ((piece.exterior, 1.0), *((hole, -1.0) for hole in piece.interiors)):
            p = np.asarray(ring.coords)
            q, p = p[1:], p[:-1]
            turn = p[:, 0] * q[:, 1] - q[:, 0] * p[:, 1]
            squares = np.sum(p * p + p * q + q * q, axis=1)
            total += sign * abs(np.sum(turn * squares)) / 12.0
    return total


def test_parts_that_share_their_outline_count_once():
    """The same disk, polygon and frame twice; halves side by side, over each other and in line."""
    for shape in (Sphere(1.3), SpheroPolygon(SQUARE, 0.2), framed()):
        twice = Composite([(shape, (1.0, 2.0), 0.3), (shape, (1.0, 2.0), 0.3)])
        assert twice.area == pytest.approx(shape.area, rel=1e-8)
        assert twice.second_moment == pytest.approx(shape.second_moment, rel=1e-8)
    brick = SpheroPolygon(SQUARE * (2.0, 1.0), 0.5)
    for way, size in (((3.0, 0.0), (3.5, 1.0)), ((4.0, 0.0), (4.0, 1.0)), ((0.0, 1.0), (2.0, 1.5))):
        wall = Composite([(brick, (0.0, 0.0)), (brick, way)])
        whole = SpheroPolygon(SQUARE * size, 0.5)
        assert wall.area == pytest.approx(whole.area, rel=1e-8)
        assert wall.second_moment == pytest.approx(whole.second_moment, rel=1e-8)
    # Back to back: the outlines run along each other, in opposite senses.
    stacked = Composite([(brick, (0.0, 0.0)), (brick, (0.0, 3.0))])
    assert stacked.area == pytest.approx(2.0 * brick.area, rel=1e-8)


@settings(max_examples=25)
@given(st.sampled_from(MAKERS), st.floats(-7.0, 7.0), st.floats(0.01, 100.0), st.booleans())
def test_frames_and_units_do_not_matter(make, angle, factor, as_one):
    known = make()
    given_parts = [(known, (3.0, -5.0), angle)] if as_one else [
        (shape_of_parts([part]), at, 0.0)
        for part in known.parts
        for at in [part.points[0] if len(part.points) == 1 else shape_of_parts([part]).centroid]
    ]  # fmt: skip
    again = Composite(given_parts)
    assert again.area == pytest.approx(known.area, rel=1e-10)
    assert again.second_moment == pytest.approx(known.second_moment, rel=1e-10)
    larger = again.scaled(factor)
    fresh = shape_of_parts(larger.parts)
    assert larger.area == pytest.approx(known.area * factor**2, rel=1e-10)
    assert fresh.second_moment == pytest.approx(larger.second_moment, rel=1e-9)
    assert np.abs(fresh.vertices - larger.vertices).max() < 1e-9 * larger.bounding_radius


def test_holes_go_round_the_other_way():
    for hole in (3.0 * SQUARE, 3.0 * SQUARE[::-1]):
        shape = SpheroPolygon(5.0 * SQUARE[::-1], 1.0, holes=[hole])
        outer, inner = shape.parts[0].rings
        assert shapely.LinearRing(outer).is_ccw and not shapely.LinearRing(inner).is_ccw
        assert shape.area == pytest.approx(framed().area, rel=1e-13)


@pytest.mark.parametrize("make", MAKERS)
def test_sizes_and_radii_are_exact(make):
    """Of parts, which would come apart, radii grow with the whole."""
    found = resized(make(), 2e-5, 7e-7)
    assert found.equivalent_radius == pytest.approx(2e-5, rel=1e-9)
    known = [part.radius / make().radius for part in make().parts]
    assert [part.radius / found.radius for part in found.parts] == pytest.approx(known)
    wanted = 7e-7 if len(known) == 1 else 2e-5 * make().radius / make().equivalent_radius
    assert found.radius == pytest.approx(wanted, rel=1e-6)
    assert resized(found, 1e-5, 3.5e-7).area == pytest.approx(0.25 * found.area, rel=1e-9)


def test_a_disk_as_large_as_the_body_is_refused():
    with pytest.raises(ShapeError, match="leaves no room for a core"):
        resized(framed(), 1e-6, 1e-6)


def test_a_body_of_parts_has_the_mass_of_their_union():
    body = Body(beads(1e-6), density=2650.0, depth=1e-6)
    assert body.mass == pytest.approx(2650.0 * 1e-6 * drawn(beads(1e-6)).area, rel=1e-5)
    assert body.inertia == pytest.approx(body.areal_density * body.shape.second_moment)


@pytest.mark.parametrize("make", MAKERS)
def test_outlines_are_closed_rings_around_the_area(make):
    rings = make().outline(1.0, 2.0, 0.7)
    assert all(np.array_equal(ring[0], ring[-1]) for ring in rings)
    signed = [shapely.Polygon(ring).area * (1 if shapely.LinearRing(ring).is_ccw else -1)
              for ring in rings]  # fmt: skip
    assert abs(sum(signed)) == pytest.approx(make().area, rel=3e-3)


def test_disks_that_touch_in_a_point_have_two_outer_rings():
    pair = Composite([(Sphere(1.0), (0.0, 0.0)), (Sphere(1.0), (2.0, 0.0))])
    assert pair.area == pytest.approx(2.0 * np.pi, rel=1e-9)
    assert len(pair.outline()) == 2


def test_tables_tell_the_parts_again():
    for make in MAKERS:
        parts = make().parts
        again = parts_in(table_of(parts))
        assert len(again) == len(parts)
        for one, other in zip(parts, again, strict=True):
            assert one.radius == other.radius and len(one.rings) == len(other.rings)
            assert all(map(np.array_equal, one.rings, other.rings))


def test_shapes_travel():
    for make in MAKERS:
        there = pickle.loads(pickle.dumps(make()))
        assert there.area == make().area and there.is_compound


@pytest.mark.parametrize("parts, words", [
    ([], "a Composite needs parts"), (7, "a Composite needs parts"),
    ([Sphere(1.0)], r"part 0 must be \(shape, \(x, y\)\)"),
    ([(1.0, (0.0, 0.0))], "part 0 must begin with a shape, found 1.0"),
    ([(Sphere(1.0), (0.0, 0.0)), (Sphere(1.0), (0.0, np.nan))], "part 1 must lie at a finite"),
    ([(Sphere(1.0), 3.0)], "part 0 must lie at a finite"),
    ([(Sphere(1.0), (0.0, 0.0)), (Sphere(1.0), (2.1, 0.0))], "part 1 of 2 is not connected"),
    ([(framed(), (0.0, 0.0)), (Sphere(0.5), (0.0, 0.0))], "part 1 of 2 is not connected"),
])  # fmt: skip
def test_what_makes_no_body_is_refused(parts, words):
    with pytest.raises(ShapeError, match=words):
        Composite(parts)


@pytest.mark.parametrize("holes, words", [
    (5, "holes must be a list of rings"), ([SQUARE[:2]], r"a hole must have shape \(N, 2\)"),
    ([SQUARE + 9.0], "polygon with 1 holes is not simple"),
    ([SQUARE, SQUARE * 0.5], "polygon with 2 holes is not simple"),
    ([SQUARE[[0, 1, 3, 2]]], "is not simple"), ([SQUARE[[0, 0, 1, 2]]], "repeat the same point"),
])  # fmt: skip
def test_holes_that_cannot_be_are_refused(holes, words):
    with pytest.raises(ShapeError, match=words):
        SpheroPolygon(5.0 * SQUARE, 1.0, holes=holes)


def test_segments_have_no_holes():
    with pytest.raises(ShapeError, match="a point or a segment has no holes"):
        SpheroPolygon(SQUARE[:2], 0.1, holes=[SQUARE * 0.1])
