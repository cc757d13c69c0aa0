"""The arrays that kernels see."""

import numpy as np

from flocsim import Body, Fluid, Sphere, SpheroPolygon
from flocsim.arrays import Work, begin_anew, work_of
from flocsim.body import scene_of

BALL = Sphere(5e-6)
SQUARE = SpheroPolygon(np.array([[0, 0], [8, 0], [8, 8], [0, 8]]) * 1e-6, 1e-6)


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
