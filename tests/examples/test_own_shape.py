"""A shape of a user's own, from its parameters to two of them that collide."""

import pickle

import attrs
import numpy as np
import pytest

from examples.own_shape import Dumbbell
from flocsim import Body, Shape, Sphere, SpheroPolygon, System
from flocsim.errors import ShapeError
from flocsim.forces import Contact
from flocsim.integrators import Implicit
from tests.reference.outline import area_centroid_inertia

DUMBBELL = Dumbbell(length=10e-6, lobe=3e-6, neck=1.5e-6, radius=1e-6)


def head_on(shape):
    """Two bodies without anything around them that meet and fly apart, the second one askew."""
    bodies = [
        Body(shape, (0.0, 0.0), 0.0, (0.0, 0.0), density=2650.0),
        Body(shape, (4e-6, 9e-6), 0.8, (0.0, -1e-3), density=2650.0),
    ]
    forces = [Contact(k_n=0.1, damping_n=0.0, k_t=0.0, tension=False)]
    return bodies, System(bodies, forces, Implicit(1e-9)).run(until=2e-2)


def test_all_that_follows_from_a_core_is_there():
    area, centroid, moment = area_centroid_inertia(DUMBBELL.core, DUMBBELL.radius)
    assert DUMBBELL.area == pytest.approx(area, rel=1e-12)
    assert DUMBBELL.second_moment == pytest.approx(moment, rel=1e-12)
    assert DUMBBELL.centroid == pytest.approx(centroid, abs=1e-18)
    assert DUMBBELL.bounding_radius == pytest.approx(8e-6, rel=0.02)
    lobes_and_neck = 2 * np.pi * 9e-12 + 3e-6 * 4e-6
    assert DUMBBELL.area == pytest.approx(lobes_and_neck, rel=0.05)
    assert DUMBBELL.vertices is DUMBBELL.vertices and not DUMBBELL.vertices.flags.writeable
    assert np.array_equal(pickle.loads(pickle.dumps(DUMBBELL)).vertices, DUMBBELL.vertices)


def test_it_moves_as_the_same_polygon_does_and_keeps_momentum():
    bodies, found = head_on(DUMBBELL)
    assert found.status.name == "FINISHED"
    momentum = sum(body.mass * found.velocity[:, k, :2] for k, body in enumerate(bodies))
    assert np.allclose(momentum, momentum[0], rtol=0.0, atol=1e-9 * abs(momentum[0, 1]))
    assert np.abs(found.velocity[-1, 0, :2]).max() > 1e-4 and abs(found.velocity[-1, 0, 2]) > 1.0
    _, same = head_on(SpheroPolygon(DUMBBELL.core, DUMBBELL.radius))
    assert np.array_equal(found.position, same.position)


def test_its_copy_of_another_size_is_a_polygon():
    larger = DUMBBELL.scaled(2.0)
    assert isinstance(larger, SpheroPolygon) and larger.area == 4.0 * DUMBBELL.area
    assert isinstance(Point(1e-6).scaled(2.0), Sphere)


@attrs.frozen
class Point(Shape):
    radius: float
    core = np.zeros((1, 2))


@attrs.frozen
class Given(Shape):
    core: object
    radius: object = 1e-6


class Bare(Shape):
    radius = 1e-6


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        (Given([[0, 0], [4, 4], [4, 0], [0, 4]]), "not simple"),
        (Given([0, 1]), r"core must have shape \(N, 2\) with N ≥ 1, found \(2,\)"),
        (Given([[0, 0]], radius=-1.0), "radius must be a finite number above 0"),
        (Bare(), "the shape Bare gives no core"),
    ],
)
def test_what_makes_no_body_is_refused_in_one_line(shape, message):
    with pytest.raises(ShapeError, match=message) as caught:
        _ = Body(shape, density=2650.0).mass
    assert "\n" not in str(caught.value)
