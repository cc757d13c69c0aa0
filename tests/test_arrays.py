"""The arrays that kernels see."""

import numpy as np

import flocsim.arrays as at
from flocsim import Body, Fluid, Sphere, SpheroPolygon
from flocsim.arrays import Work, begin_anew, with_capacity, work_of
from flocsim.body import scene_of

BALL = Sphere(5e-6)
SQUARE = SpheroPolygon(np.array([[0, 0], [8, 0], [8, 8], [0, 8]]) * 1e-6, 1e-6)


def test_the_scene_lists_all_bodies_one_after_another():
    fluid = Fluid(buoyancy=True)
    bodies = [Body(BALL, density=2650.0), Body(SQUARE, density=1500.0, fixed=True)]
    scene = scene_of(bodies, fluid, [1.0, 2.0])
    assert scene.first.tolist() == [0, 1, 5]
    assert np.array_equal(scene.vertices[1:], SQUARE.vertices)
    assert scene.parameters.tolist() == [1.0, 2.0]
    for row, body in zip(scene.bodies, bodies, strict=True):
        shape = body.shape
        assert [row[at.MASS], row[at.BUOYANT_MASS], row[at.INERTIA]] == [
            body.mass, body.buoyant_mass(fluid), body.inertia,
        ]  # fmt: skip
        assert row[at.EQUIVALENT_RADIUS] == shape.equivalent_radius
        assert [row[at.BOUNDING_RADIUS], row[at.RADIUS]] == [shape.bounding_radius, shape.radius]
    assert scene.bodies[:, at.FREE].tolist() == [1.0, 0.0]


def test_work_arrays_grow_and_keep_what_they_hold():
    scene = scene_of([Body(BALL, density=2650.0)] * 3, Fluid(), [])
    position, velocity = np.arange(9.0).reshape(3, 3), -np.arange(9.0).reshape(3, 3)
    work = work_of(scene, position, velocity, capacity=2)
    assert np.array_equal(work.motion[at.NOW], np.hstack([position, velocity]))
    assert len(work.budget) == 3 and np.all(work.budget < 0.0)
    for array in (work.slip, work.candidates, work.geometry, work.kept):
        array[...] = np.arange(array.size).reshape(array.shape)
    larger = with_capacity(work, 7)
    for name in ("slip", "candidates", "geometry", "kept"):
        before, after = getattr(work, name), getattr(larger, name)
        assert np.array_equal(after[tuple(slice(size) for size in before.shape)], before)
        assert 7 in after.shape and after.dtype == before.dtype
    assert larger.motion is work.motion


def test_work_arrays_of_an_earlier_run_begin_like_new_ones():
    bodies = [Body(BALL, density=2650.0), Body(SQUARE, density=1500.0)]
    scene = scene_of(bodies, Fluid(), [])
    places, velocities = np.arange(6.0).reshape(2, 3), -np.arange(6.0).reshape(2, 3)
    used, new = (work_of(scene, places, velocities, capacity=5) for _ in range(2))
    for name, array in zip(Work._fields, used, strict=True):
        if name not in ("elimination", "rules"):
            array[...] = 3
    begin_anew(used, scene, places, velocities)
    for one, other in zip((*used, *used.elimination), (*new, *new.elimination), strict=True):
        if isinstance(one, np.ndarray):
            np.testing.assert_array_equal(one, other)
