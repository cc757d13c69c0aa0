"""Contact geometry where there is no reference: degenerate places."""

import numpy as np
import pytest

from flocsim import Body, Sphere, SpheroPolygon
from flocsim.body import Fluid, scene_of
from flocsim.geometry.contact.candidates import rebuild_list
from flocsim.geometry.contact.points import locate_contacts
from flocsim.state.work import NOW, work_of


def arrays(*bodies):
    """Scene and listed work arrays of bodies at rest."""
    scene = scene_of(bodies, Fluid())
    position = np.array([[*body.position, body.angle] for body in bodies])
    work = work_of(scene, position, np.zeros((len(bodies), 3)))
    assert rebuild_list(scene, work)
    return scene, work


def sphere(radius, x, y):
    return Body(Sphere(radius), (x, y), surface_density=2.0)


def test_a_vertex_right_on_an_edge_gets_a_unit_normal_and_no_nan():
    square = SpheroPolygon(np.array([[-2, -2], [2, -2], [2, 2], [-2, 2]]) * 1e-6, 1e-6)
    scene, work = arrays(Body(square, surface_density=2.0), sphere(1e-6, 2e-6, 0.0))
    assert locate_contacts(scene, work, NOW) == pytest.approx(-2e-6)
    listed = work.geometry[NOW, : work.tally.candidates]
    assert all(np.isfinite(listed[name]).all() for name in listed.dtype.names)
    assert np.hypot(listed["normal_x"], listed["normal_y"]) == pytest.approx(np.ones(len(listed)))
