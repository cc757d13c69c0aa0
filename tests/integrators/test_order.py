"""The order of the methods: how their errors fall with equal steps where the forces are smooth.

One scene is without contact, the other in contact throughout, with slip and damping.
"""

from functools import cache

import attrs
import numpy as np
import pytest

from flocsim import Body, Sphere
from flocsim.forces import Contact, StokesDrag
from flocsim.geometry.contact.points import locate_contacts
from flocsim.hooks import attempt
from flocsim.integrators import DormandPrince54, Implicit, Overdamped, VelocityVerlet
from flocsim.integrators.loop.driver import adopt_new_state, keep_lists
from flocsim.state.work import NEW, NOW, motion_of, work_of
from tests.helpers.methods import name_of
from tests.helpers.tiers import rest_slow
from tests.helpers.trial_scenes import PolygonSystem, Spring, Trap, head_on, hook

EXACT = 1e-18
"""A tolerance [m] at which Newton's method goes on to the last bit."""


def even_steps(scene, work, clock, counts, step, count):
    """Take equal steps whatever their error; False where one fails."""
    keep_lists(scene, work, 0.0)
    for _ in range(count):
        if attempt(scene, work, clock, step) < 0.0:
            return False
        locate_contacts(scene, work, NEW)
        adopt_new_state(work)
        clock.time += step
    return True


def trapped():
    """A hook and a sphere on springs in a fluid: (bodies, forces, time)."""
    left = Body(hook(), (3e-6, 1e-6), 0.5, (0.0, 2e-3), 40.0, surface_density=2.0)
    right = Body(Sphere(5e-6), (40e-6, -2e-6), 1.0, (0.1, -0.4), -90.0, surface_density=2.0)
    return [left, right], [Trap(0.02, 1e-12), Spring(5e-3, -2e-6), StokesDrag()], 3e-4


def pressed():
    """Two spheres that are pressed together and turn against each other: the same."""
    left, right = head_on(0.0, -1e-7)
    bodies = [attrs.evolve(left, velocity=(0.0, 1e-3), spin=300.0), attrs.evolve(right, spin=100.0)]
    forces = [Contact(k_n=20.0, k_t=2.0, damping_n=3e4), Spring(0.5, -2e-6), StokesDrag()]
    return bodies, forces, 6e-5


SCENES = {"trapped": trapped, "pressed": pressed}


@cache
def end_of(name, integrator, count):
    """Places and velocities times 0.1 ms (n, 6) [m] after so many equal steps, turns at 10 µm."""
    bodies, forces, until = SCENES[name]()
    system = PolygonSystem(bodies, forces, integrator)
    driver = system.compose(entry=even_steps, jit=False)
    scene = system.scene(jit=False)
    work, clock = work_of(scene, *system.motion()), integrator.fresh_clock()
    clock.tolerance = min(clock.tolerance, EXACT)
    clock.until, clock.largest_step = until, until / count
    assert driver(scene, work, clock, integrator.fresh_counts(count), until / count, count)
    return motion_of(work, NOW) * [1.0, 1.0, 1e-5, 1e-4, 1e-4, 1e-9]


def order_of(scene, integrator, counts, exact):
    """The order between two counts, one twice the other."""
    coarse, fine = (np.linalg.norm(end_of(scene, integrator, count) - exact) for count in counts)
    return np.log2(coarse / fine)


OWN = Overdamped()
"""Compared with itself: without inertia the motion is another one."""

CASES = [
    (VelocityVerlet(), "trapped", (256, 512), 2.0),
    (VelocityVerlet(), "pressed", (64, 128), 2.0),
    (DormandPrince54(), "trapped", (256, 512), 5.0),
    (DormandPrince54(), "pressed", (64, 128), 5.0),
    (Implicit(), "trapped", (64, 128), 6.0),
    (Implicit(), "pressed", (32, 64), 6.0),
    (OWN, "trapped", (256, 512), 5.0),
]


@pytest.mark.parametrize(
    ("integrator", "scene", "counts", "order"),
    rest_slow(CASES, lambda integrator, scene, *_: scene == "pressed"),
    ids=[f"{name_of(case[0])}-{case[1]}" for case in CASES],
)  # fmt: skip
def test_order(integrator, scene, counts, order):
    exact = end_of(scene, OWN if integrator is OWN else DormandPrince54(), 2048)
    assert order_of(scene, integrator, counts, exact) == pytest.approx(order, abs=0.4)


@pytest.mark.slow
def test_all_methods_go_to_the_same_end():
    for scene in SCENES:
        ends = [end_of(scene, method, 1024) for method in (Implicit(), DormandPrince54())]
        assert np.abs(ends[1] - ends[0]).max() < 1e-14
