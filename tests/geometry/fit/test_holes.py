"""Fits that keep the holes of a floc."""

import numpy as np
import pytest
import shapely

from flocsim.errors import ShapeError
from flocsim.geometry.fit.coverage import wrong_pixels
from flocsim.geometry.fit.fit import find_holes, fit_mask

Y, X = np.mgrid[0:90, 0:100]
OUTER = (X - 50) ** 2 / 1.3 + (Y - 45) ** 2 < 38**2
ROUND, SQUARE = (X - 40) ** 2 + (Y - 40) ** 2 < 9**2, (abs(X - 68) < 6) & (abs(Y - 50) < 8)
SMALL = (X - 45) ** 2 + (Y - 70) ** 2 < 2.2**2
MASK = OUTER & ~ROUND & ~SQUARE & ~SMALL


@pytest.mark.parametrize("method", ["pattern", "paper", "even"])
def test_holes_are_kept_where_they_are(method):
    found = fit_mask(MASK, vertices=48, radius=1.5, holes=True, method=method)
    assert len(found.vertices) == 48 and found.shape.is_compound
    [part] = found.parts
    holes = [shapely.Polygon(ring).buffer(-1.5) for ring in part.rings[1:]]
    for hole, mask in zip(holes, (ROUND, SQUARE), strict=False):
        rows, columns = np.nonzero(mask)
        middle = [columns.mean(), -rows.mean()]
        assert [hole.centroid.x, hole.centroid.y] == pytest.approx(middle, abs=1.0)
        assert hole.area == pytest.approx(mask.sum(), rel=0.2)


def test_the_error_is_a_count_of_pixels():
    """Every pixel whose centre the shape covers, by shapely."""
    found = fit_mask(MASK, vertices=32, radius=1.5, holes=True)
    outer, *holes = found.parts[0].rings
    cover = shapely.Polygon(outer, holes).buffer(1.5, quad_segs=200)
    inside = shapely.contains_xy(cover, X, -Y)
    assert abs(np.count_nonzero(inside != MASK) - found.wrong_pixels) <= 2
    assert found.relative_error == pytest.approx(100.0 * found.wrong_pixels / MASK.sum())
    wrong, _ = wrong_pixels(MASK, found.parts[0].rings, 1.5)
    assert wrong == found.wrong_pixels


@pytest.mark.slow
def test_keeping_holes_never_makes_more_wrong():
    for count in (4, 8, 12, 24):
        kept = fit_mask(MASK, vertices=count, radius=1.5, holes=True)
        assert len(kept.vertices) == count
        assert kept.wrong_pixels <= fit_mask(MASK, vertices=count, radius=1.5).wrong_pixels
    assert kept.relative_error < 0.4 * fit_mask(MASK, vertices=24, radius=1.5).relative_error


def test_area_is_that_of_the_floc_without_its_holes():
    found = fit_mask(MASK, vertices=32, radius=1.5, holes=True, preserve_area=True)
    assert found.hole_sizes and found.shape.area == pytest.approx(MASK.sum(), rel=1e-9)


def test_an_inscribed_shape_covers_nothing_of_the_holes():
    found = fit_mask(MASK, vertices=32, radius=1.5, holes=True, inscribed=True)
    _, outside = wrong_pixels(MASK, found.parts[0].rings, 1.5)
    assert outside == 0 and len(found.hole_sizes) >= 2


def test_masks_without_holes_are_fitted_as_ever():
    one = fit_mask(OUTER, vertices=16, radius=1.5)
    other = fit_mask(OUTER, vertices=16, radius=1.5, holes=True)
    assert np.array_equal(one.vertices, other.vertices) and not other.hole_sizes


def test_a_hole_open_by_a_corner_is_none():
    """A floc is 8-connected, so that what is around it goes through sides of pixels only."""
    ring = np.ones((12, 12), bool)
    ring[4:8, 4:8] = False
    assert len(find_holes(ring, 16)) == 1
    ring[3, 5] = ring[2, 5] = ring[1, 5] = ring[0, 5] = False
    assert find_holes(ring, 16) == []


def test_thin_walls_leave_a_hole_closed_or_a_shape_that_is_simple():
    thin = (np.hypot(X - 50, Y - 45) < 30) & (np.hypot(X - 50, Y - 45) > 28)
    found = fit_mask(thin, vertices=32, radius=3.0, holes=True)
    assert found.shape.area > 0.0
    try:
        inscribed = fit_mask(thin, vertices=32, radius=3.0, holes=True, inscribed=True)
    except ShapeError as error:
        assert "use a smaller spheroradius" in str(error)
    else:
        assert inscribed.wrong_pixels <= thin.sum()
