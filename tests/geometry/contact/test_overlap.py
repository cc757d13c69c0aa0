"""Whether bodies may start where they are, and where they touch."""

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from flocsim import Sphere
from flocsim.geometry.contact.points import (
    overlap_fault,
    placed_contacts,
    touching_points,
)
from flocsim.geometry.shapes.cores import Part
from flocsim.geometry.shapes.outline import core_gap
from tests.reference.contacts import contacts
from tests.reference.outline import core_geometry
from tests.reference.samples import SEEDS, random_core, scene_of
from tests.reference.scenes import c_shape, convex, segment, sphere, star
from tests.reference.shapes import rotation, world_vertices

MAKERS = [sphere, segment, convex, star, c_shape]


@given(
    st.integers(0, 30), st.sampled_from(MAKERS), st.sampled_from(MAKERS), st.floats(-2.0, 2.0),
    st.floats(-2.0, 2.0), st.floats(-4.0, 4.0),
)  # fmt: skip
def test_fault_and_distance_are_those_of_shapely(seed, make_a, make_b, x, y, angle):
    rng = np.random.default_rng(seed)
    a = random_core(make_a, rng)
    b = random_core(make_b, rng) @ rotation(angle).T + (x, y)
    distance = shapely.distance(core_geometry(a), core_geometry(b))
    fault = overlap_fault([Part((a,), 0.1)], [Part((b,), 0.2)])
    if distance == 0.0:
        assert fault is not None
    else:
        assert core_gap(Part((a,), 0.1), Part((b,), 0.2)) == pytest.approx(
            distance, rel=1e-9, abs=1e-14
        )
        assert (fault is not None) == (distance < 0.15)


def test_the_depth_is_named():
    one = np.zeros((1, 2))

    def fault(apart):
        return overlap_fault([Part((one,), 1.0)], [Part((one + (apart, 0.0),), 1.0)])

    assert fault(0.9) == "overlapping by 1.1 m, more than half of r_i + r_j"
    assert fault(1.1) is None


@pytest.mark.parametrize("seed", SEEDS)
def test_touching_points_are_the_contact_points(seed):
    scene = scene_of(seed)
    placed = [world_vertices(*each) for each in zip(scene.bodies, scene.positions, strict=True)]
    pairs = contacts(scene)
    for i in range(len(placed)):
        for j in range(i):
            both = np.sort(pairs.pair[:, ::2], axis=1).tolist()
            wanted = pairs.point[[row for row, two in enumerate(both) if two == [j, i]]]
            found = touching_points(
                placed[i], scene.bodies[i].radius, placed[j], scene.bodies[j].radius
            )
            # Two spheres touch once, but each is asked for its touching point.
            assert (len(found) > 0) == (len(wanted) > 0)
            apart = np.hypot(*(found[:, None] - wanted[None]).transpose(2, 0, 1))
            assert np.all(apart.min(axis=0, initial=np.inf) < 1e-15)
            assert np.all(apart.min(axis=1, initial=np.inf) < 1e-15)


def test_contacts_are_those_of_any_two():
    """Three in a row: two contacts, each seen from both bodies; one alone: none."""
    shapes = [Sphere(1e-6)] * 3
    places = np.array([[0.0, 0.0, 0.0], [1.5e-6, 0.0, 1.0], [3.0e-6, 0.0, 0.0]])
    found = placed_contacts(shapes, places)
    np.testing.assert_allclose(found, [[0.75e-6, 0.0]] * 2 + [[2.25e-6, 0.0]] * 2, atol=1e-20)
    assert placed_contacts(shapes[:1], places[:1]).shape == (0, 2)
    assert placed_contacts(shapes[:2], places[[0, 2]]).shape == (0, 2)
