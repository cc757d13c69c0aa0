"""Switches: where in a step a pair touches or parts."""

import math
from functools import cache

import attrs
import numpy as np
import pytest

from flocsim import Body, Fluid, Sphere
from flocsim.body import scene_of
from flocsim.geometry.contact.candidates import rebuild_list
from flocsim.geometry.contact.points import locate_contacts
from flocsim.integrators.events.crossings import first_switch, interpolate
from flocsim.integrators.events.first_event import set_modes
from flocsim.state.work import NEW, NOW, TRIAL, work_of
from tests.helpers.fast_scene import bodies_of
from tests.helpers.methods import by_adaptive
from tests.helpers.tiers import rest_slow
from tests.helpers.trial_scenes import ELASTIC, PolygonSystem, Spring, head_on, star, watched
from tests.reference.samples import scene_of as random_scene

RESOLUTION = 1e-13
RADIUS = 5e-6
SCENES = range(30)


def stepped(bodies, change, velocities):
    """Scene and work arrays at the start of a step of 1 s that changes the places by so much."""
    scene = scene_of(bodies, Fluid())
    start = np.array([[*body.position, body.angle] for body in bodies])
    work = work_of(scene, start, velocities[0], capacity=4096)
    assert rebuild_list(scene, work)
    locate_contacts(scene, work, NOW)
    set_modes(scene, work)
    work.place[NEW], work.velocity[NEW] = start + change, velocities[1]
    locate_contacts(scene, work, NEW)
    return scene, work


def fly_by(depth, integrator):
    """A whole run of one sphere past another, in steps far longer than the touch lasts."""
    left, right = head_on(0.05, 0.0)
    left = attrs.evolve(left, position=(-2e-6, 2.0 * RADIUS - depth))
    right = attrs.evolve(right, position=(0.0, 0.0))
    return watched(PolygonSystem([left, right], [ELASTIC, Spring()], integrator), 8e-5)


@by_adaptive
def test_no_graze_is_missed_in_a_run(integrator):
    for tolerance in (1e-9, 1e-10):
        setting = attrs.evolve(integrator, tolerance=tolerance)
        grazes = [fly_by(depth, setting).contacts for depth in (1e-10, 2e-12, -1e-12, -1e-10)]
        assert grazes == [1, 1, 0, 0]


def wandering(seed):
    """A random scene whose bodies move and turn by some of the skin in one step."""
    rng = np.random.default_rng([seed, 3])
    bodies = bodies_of(random_scene(seed), surface_density=2.0)
    size = [3e-7, 3e-7, 3e-2]
    change = rng.normal(size=(len(bodies), 3)) * size
    velocities = [change + 0.7 * rng.normal(size=change.shape) * size for _ in range(2)]
    return stepped(bodies, change, velocities)


def worst_margin(scene, work, shares):
    """The least of all that must not become negative, at every share [m]."""
    rows = work.tally.candidates
    closed = work.geometry[NOW, :rows]["gap"] < 0.0
    worst = []
    for share in shares:
        for body in range(len(scene.bodies)):
            interpolate(work, 1.0, share, body)
        locate_contacts(scene, work, TRIAL)
        gaps = work.geometry[TRIAL, :rows]["gap"]
        worst.append(np.where(closed, -gaps, gaps).min(initial=math.inf))
    return np.array(worst)


@cache
def found(seed):
    """Scene, work arrays, and the share at which the first switch is found."""
    scene, work = wandering(seed)
    return scene, work, first_switch(scene, work, 1.0, RESOLUTION, RESOLUTION)


@pytest.mark.parametrize("seed", rest_slow(SCENES, lambda seed: seed < 10))
def test_the_first_switch_is_located_to_the_resolution(seed):
    scene, work, share = found(seed)
    before = np.linspace(0.0, min(share, 1.0), 200)
    assert worst_margin(scene, work, before).min() >= -RESOLUTION
    if share < 1.0:
        assert -RESOLUTION <= worst_margin(scene, work, [share])[0] < 0.0


@pytest.mark.slow
def test_these_scenes_switch_and_some_do_not():
    shares = [found(seed)[2] for seed in SCENES]
    assert sum(share < 1.0 for share in shares) > 8
    assert math.inf in shares


@by_adaptive
def test_a_run_that_ends_steps_at_switches_is_as_smooth_as_its_forces(integrator):
    """A turning star on a sphere: pairs open and close; no step near them is rejected for long."""
    bodies = [
        Body(star(), (0.0, 0.0), 0.3, (0.02, 0.0), 4e3, surface_density=2.0),
        Body(Sphere(4e-6), (14e-6, 1e-6), velocity=(-0.05, 0.0), surface_density=2.0),
    ]
    end = watched(PolygonSystem(bodies, [ELASTIC, Spring(1e-2)], integrator), 1e-3)
    assert end.status.name == "FINISHED"
    assert end.contacts >= 3
    assert end.rejected < 0.5 * end.steps
