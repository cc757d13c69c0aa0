"""resized: the equivalent radius is exact, and the spheroradius is the one that was asked for."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from flocsim import SpheroPolygon
from flocsim.errors import ShapeError
from flocsim.geometry.shapes.resize import resized
from tests.helpers.tiers import rest_slow
from tests.reference.outline import area_centroid_inertia
from tests.reference.samples import random_core
from tests.reference.scenes import c_shape, convex, segment, spiral, star

TYPES = [4.62e-6, 4.95e-6, 16.41e-6, 23.02e-6]


@pytest.mark.parametrize(
    "make_core",
    rest_slow([segment, convex, star, c_shape, spiral], lambda make: make is star),
)
@given(seed=st.integers(0, 40), size=st.sampled_from(TYPES), share=st.floats(0.02, 0.95))
@example(seed=3, size=4.62e-6, share=0.2417179327071084)  # arcs that cross at some 1e-5 rad
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


def test_resizing_what_already_fits_changes_nothing():
    shape = SpheroPolygon(1e-5 * random_core(star, np.random.default_rng(2)), 1e-6)
    body = resized(shape, shape.equivalent_radius, shape.radius)
    assert body.vertices == pytest.approx(shape.vertices, rel=1e-8, abs=1e-14)


@pytest.mark.parametrize("radius", [5e-6, 6e-6])
def test_a_spheroradius_that_leaves_no_room_is_refused(radius):
    shape = SpheroPolygon([[0, 0], [1e-5, 0], [0, 1e-5]], 1e-6)
    with pytest.raises(ShapeError, match=r"leaves no room .* r_eq = 5e-06 m: choose a smaller"):
        resized(shape, 5e-6, radius)
