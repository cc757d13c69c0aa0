"""Contact geometry where there is no reference: degenerate places, and spheres by themselves."""

import numpy as np
import pytest

import flocsim.arrays as at
from flocsim import Body, Sphere, SpheroPolygon
from flocsim.arrays import work_of
from flocsim.body import Fluid, scene_of
from flocsim.geometry.contact.candidates import list_candidates
from flocsim.geometry.contact.points import locate_contacts, locate_polygons, locate_spheres


def arrays(*bodies):
    """Scene and listed work arrays of bodies at rest."""
    scene = scene_of(bodies, Fluid(), [])
    position = np.array([[*body.position, body.angle] for body in bodies])
    work = work_of(scene, position, np.zeros((len(bodies), 3)))
    assert list_candidates(scene, work)
    return scene, work


def sphere(radius, x, y):
    return Body(Sphere(radius), (x, y), surface_density=2.0)


@pytest.mark.parametrize("place", [(2.9e-6, 0.4e-6), (0.0, 0.0)])
def test_the_sphere_code_is_the_polygon_code_for_points(place):
    scene, work = arrays(sphere(1e-6, 0.0, 0.0), sphere(2e-6, *place))
    rows = []
    for locate in (locate_polygons, locate_spheres):
        locate(scene, work, at.NOW, 0)
        rows.append(work.geometry[at.NOW, 0].copy())
    assert rows[0] == pytest.approx(rows[1], rel=1e-14, abs=1e-25)
    assert np.hypot(*rows[1][:2]) == pytest.approx(1.0)


def test_two_spheres_touch_on_the_line_of_centres_at_the_middle_of_the_overlap():
    scene, work = arrays(sphere(1e-6, 0.0, 0.0), sphere(2e-6, 2.8e-6, 0.0))
    assert locate_contacts(scene, work, at.NOW) == pytest.approx(-0.2e-6)
    nx, ny, gap, a_n, a_t, b_n, b_t, turning = work.geometry[at.NOW, 0, :8]
    side = 1.0 if work.candidates[0, 0] == 1 else -1.0
    assert [nx, ny, gap] == pytest.approx([side, 0.0, -0.2e-6])
    assert [a_n, b_n] == pytest.approx([0.0, 0.0], abs=1e-22)
    assert turning == pytest.approx(1.0 / 2.8e-6)
    # From 1.0 µm − 0.1 µm beside the small one, and 2.0 µm − 0.1 µm before the large one.
    assert sorted([abs(a_t), abs(b_t)]) == pytest.approx([0.9e-6, 1.9e-6])


def test_a_vertex_right_on_an_edge_gets_a_unit_normal_and_no_nan():
    square = SpheroPolygon(np.array([[-2, -2], [2, -2], [2, 2], [-2, 2]]) * 1e-6, 1e-6)
    scene, work = arrays(Body(square, surface_density=2.0), sphere(1e-6, 2e-6, 0.0))
    assert locate_contacts(scene, work, at.NOW) == pytest.approx(-2e-6)
    listed = work.geometry[at.NOW, : work.tally[at.CANDIDATES]]
    assert np.isfinite(listed).all()
    assert np.hypot(listed[:, 0], listed[:, 1]) == pytest.approx(np.ones(len(listed)))
