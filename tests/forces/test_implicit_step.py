"""The implicit step against the explicit sum of forces: equal to first order in the step."""

from functools import cache

import numpy as np
import pytest
from fast_cases import random_case
from fast_scene import FastScene

from flocsim.geometry.candidates import list_candidates
from flocsim.integrators.implicit import single_step
from flocsim.layout import BOUNDING_RADIUS, FREE, INERTIA, MASS, NEW, NOW

SCENES = range(25)


def implicit_step(scene, work, step):
    """List the candidates and take one implicit step from NOW to NEW."""
    return list_candidates(scene, work) and single_step(scene, work, 0.0, 1e-9, NOW, NEW, step)


@cache
def scene_and_gain(seed):
    """The scene with both functions, and the acceleration M⁻¹F (n, 3) of the explicit sum."""
    case = random_case(seed)
    fast = FastScene(case.system(), jit=False)
    loads = fast.loads(case.slips)
    known = fast.scene.bodies
    inertia = known[:, [MASS, MASS, INERTIA]]
    stepper = fast.system.compose(entry=implicit_step, jit=False)
    return fast, stepper, known[:, FREE, None] * loads / inertia


def miss(seed, step):
    """|Δv − h M⁻¹F| over |h M⁻¹F| after one step of length h."""
    fast, stepper, acceleration = scene_and_gain(seed)
    assert stepper(fast.scene, fast.work, step)
    change = (fast.work.motion[NEW, :, 3:] - fast.work.motion[NOW, :, 3:]) / step
    size = fast.scene.bodies[:, BOUNDING_RADIUS, None] ** [0, 0, 1]
    return np.abs(size * (change - acceleration)).max() / np.abs(size * acceleration).max()


@pytest.mark.parametrize("seed", SCENES)
def test_a_short_step_gains_the_explicit_acceleration(seed):
    # Contacts have 1/ω0 of about 1e-6 s, drag relaxes in 1e-5 s.
    long, short = miss(seed, 1e-10), miss(seed, 1e-11)
    assert short < 1e-3
    assert short < 0.2 * long or short < 1e-6


@pytest.mark.parametrize("seed", SCENES)
def test_fixed_bodies_gain_nothing_and_places_follow_the_new_velocity(seed):
    fast, stepper, _ = scene_and_gain(seed)
    step = 1e-7
    assert stepper(fast.scene, fast.work, step)
    before, after = fast.work.motion[NOW], fast.work.motion[NEW]
    moved = before[:, :3] + step * after[:, 3:]
    assert after[:, :3] == pytest.approx(moved, rel=1e-12, abs=1e-20)
    fixed = fast.scene.bodies[:, FREE] == 0.0
    assert np.array_equal(after[fixed, 3:], before[fixed, 3:])
