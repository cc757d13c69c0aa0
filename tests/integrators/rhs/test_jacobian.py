"""STIFFNESS and DAMPING against central differences of the forces, on random scenes.

The flags of the pairs stay, and tangential displacements move along with the bodies, as they do
inside a step. Stiffness is compared at rest: what turning does to the rates is left out of it.
"""

from functools import cache

import numpy as np
import pytest

from flocsim import Body
from flocsim.integrators.rhs.forces import locate_with_slip_rates, sum_forces
from flocsim.integrators.rhs.jacobian import assemble_jacobian
from flocsim.integrators.rhs.views import tangential_rate
from flocsim.state.work import DAMPING, FIRST_STAGE, NOW, STIFFNESS, motion_of, put_motion
from tests.helpers.fast_scene import FORCES, GAPS, FastScene, random_case
from tests.helpers.matrices import whole_matrix
from tests.helpers.tiers import rest_slow
from tests.helpers.trial_scenes import (
    Hertz,
    Lubrication,
    PolygonSystem,
    Spring,
    Trap,
    head_on,
    star,
)

SCENES = range(40)
ALL = {gap: tuple(name for name in FORCES if not name.endswith(gap)) for gap in GAPS}


def forces_in_first(scene, work):
    """Forces in state FIRST_STAGE by the flags that are there."""
    locate_with_slip_rates(scene, work, FIRST_STAGE)
    sum_forces(scene, work, 0.0, FIRST_STAGE)


def derivatives_now(scene, work):
    """Both matrices in state NOW."""
    assemble_jacobian(scene, work, 0.0, 1.0)


class Differences:
    """A scene whose forces are differenced coordinate by coordinate."""

    def __init__(self, system, slips=None, moving=True):
        """List, flag and locate the pairs of a system where its bodies are."""
        self.fast = FastScene(system, jit=False)
        self.fast.loads(slips)
        self.scene, self.work = self.fast.scene, self.fast.work
        if not moving:
            self.work.velocity[NOW] = 0.0
        self.evaluate = system.compose(entry=forces_in_first, jit=False)
        self.assemble = system.compose(entry=derivatives_now, jit=False)

    @property
    def lever(self):
        """How far the outlines move for a unit of each coordinate (3n,)."""
        return (self.scene.bodies["bounding_radius"][:, None] ** [0, 0, 1]).ravel()

    def carried(self, body, axis):
        """Change of every pair's displacement for a unit of a coordinate."""
        work = self.work
        kept = work.velocity[NOW].copy()
        work.velocity[NOW] = 0.0
        work.velocity[NOW, body, axis] = 1.0
        rows = range(work.tally.candidates)
        rates = [
            tangential_rate(work, NOW, row) * work.candidates[row].contact_mode for row in rows
        ]
        work.velocity[NOW] = kept
        return np.array(rates)

    def loads(self, body, axis, by):
        """All forces (3n,) with one coordinate (axis 0–2) or velocity (3–5) changed."""
        work = self.work
        put_motion(work, FIRST_STAGE, motion_of(work, NOW))
        (work.place, work.velocity)[axis // 3][FIRST_STAGE, body, axis % 3] += by
        work.slip[FIRST_STAGE] = work.slip[NOW]
        if axis < 3:
            work.slip[FIRST_STAGE, : work.tally.candidates] += by * self.carried(body, axis)
        self.evaluate(self.scene, work)
        return work.force[FIRST_STAGE].ravel().copy()

    def measured(self, part, size):
        """Minus the derivatives by places (part 0) or velocities (part 3), per metre of outline."""
        columns = []
        for k, lever in enumerate(self.lever):
            by = size / lever
            ends = [self.loads(k // 3, k % 3 + part, sign * by) for sign in (1.0, -1.0)]
            columns.append((ends[1] - ends[0]) / (2.0 * by))
        return self.scaled(np.array(columns).T)

    def scaled(self, matrix):
        """Torques as forces at the outline, angles as its displacements."""
        return matrix / self.lever / self.lever[:, None]

    def assembled(self, which):
        """The matrix that the implicit methods use."""
        self.assemble(self.scene, self.work)
        return self.scaled(whole_matrix(self.work, which))

    def miss(self, which, size):
        """The largest difference, as a share of the largest entry."""
        found = self.measured(3 if which == DAMPING else 0, size)
        scale = np.abs(found).max()
        return np.abs(self.assembled(which) - found).max() / scale if scale > 0.0 else 0.0


@cache
def differences(seed, names, moving):
    case = random_case(seed)
    slips = case.slips if "contact" in names else None
    return Differences(case.system(*names), slips, moving)


ARMS = 2e-3
"""Left out of STIFFNESS: the point of a tangential force shifts with the overlap."""


@pytest.mark.parametrize("seed", rest_slow(SCENES, lambda seed: seed < 8))
@pytest.mark.parametrize("gap", GAPS)
def test_stiffness_of_all_forces_together(seed, gap):
    assert differences(seed, ALL[gap], False).miss(STIFFNESS, 1e-12) < ARMS


@pytest.mark.parametrize("seed", rest_slow(SCENES, lambda seed: seed < 8))
@pytest.mark.parametrize("gap", GAPS)
def test_damping_of_all_forces_together(seed, gap):
    assert differences(seed, ALL[gap], True).miss(DAMPING, 1e-6) < 1e-5


def own_scene():
    """Every kind of a user's own force, without derivatives of its own, at work at once."""
    left, right = head_on(0.05, -2e-7)
    own = [Trap(0.02, 1e-13), Spring(5e-3, -2e-6), Lubrication(), Hertz(1e4, 20.0, 2.0)]
    ragged = Body(star(), (3e-6, 13e-6), 0.4, (0.0, -0.05), 300.0, surface_density=2.0)
    return PolygonSystem([left, right, ragged], own)


@pytest.mark.parametrize(
    ("which", "moving", "size"), [(STIFFNESS, False, 1e-12), (DAMPING, True, 1e-6)]
)
def test_forces_of_a_user_are_differenced(which, moving, size):
    assert Differences(own_scene(), moving=moving).miss(which, size) < 2e-3
