"""Beds: bodies that come down on a floor come to rest, and cost nothing from then on."""

import math

import numpy as np
import pytest

from benchmarks.speed.swarms import bulk_fraction, pile_of
from flocsim import Body, Sphere, Swarm, floor
from flocsim.forces import Contact, Gravity, StokesDrag
from flocsim.integrators import Implicit, Status
from flocsim.swarms.placement import place_at_random
from tests.helpers.swarm_scenes import WATER, R, forces
from tests.helpers.tiers import rest_slow

SPREAD = 1.4


def falling(number, seed, tolerance=1e-9, wide=5.0, fraction=0.3, **contact):
    """(a swarm of two sizes of discs over a floor, their radii)."""
    rng = np.random.default_rng(seed)
    radii = rng.permutation(np.where(np.arange(number) % 2 == 0, R, SPREAD * R))
    width = 2.4 * R * wide
    shapes = [Sphere(float(radius)) for radius in radii]
    height = math.pi * float(np.sum(radii**2)) / (fraction * width)
    places = place_at_random(shapes, (width, height), rng)
    bodies = [floor(width, beyond=4.0 * R)]
    bodies += [
        Body(shape, (x, y + 3.0 * R), density=2650.0)
        for shape, (x, y, _) in zip(shapes, places.tolist(), strict=True)
    ]
    held = [Gravity(), StokesDrag(), Contact(**contact)]
    swarm = Swarm(bodies, held, Implicit(tolerance=tolerance), WATER, box=(width, None))
    return swarm, radii


def test_a_pile_comes_to_rest_and_costs_nothing_from_then_on():
    swarm, _ = falling(30, 0, k_t=0.0)
    progress = swarm.begin(100.0)
    while progress.advance(3.0) == Status.PAUSED:
        pass
    speed = np.hypot(progress.swarm.motion[1:, 3], progress.swarm.motion[1:, 4])
    assert speed.max() < 1e-9
    spent = progress.effort.body_steps
    while progress.advance(100.0) == Status.PAUSED:
        pass
    assert progress.time == 100.0
    assert progress.effort.body_steps - spent < 0.02 * spent
    # What presses the floor is the weight of all: by springs of the mean of all overlaps.
    weight = sum(9.81 * body.buoyant_mass(WATER) for body in swarm.bodies[1:])
    near = swarm.gauge().neighbours(progress.swarm.motion[:, :3])
    on_floor = (near.pairs == 0).any(axis=1)
    assert 20.0 * -near.gap[on_floor].sum() == pytest.approx(weight, rel=1e-6)


def test_steps_across_switches_are_taken_and_change_no_bit_with_threads():
    runs = []
    for threads in (1, 2):
        swarm, _ = falling(30, 1)
        progress = swarm.begin(1.0, threads=threads)
        across = False
        while progress.advance(1.0) == Status.PAUSED:
            across = across or bool(np.any(progress.swarm.methods == 1.0))
        assert across
        runs.append(progress.swarm.motion.tobytes())
    assert runs[0] == runs[1]


def test_bodies_that_bounce_are_not_stopped_by_long_steps():
    """Without damping, drag and weight energy stays: no step across switches is taken."""
    rng = np.random.default_rng(3)
    places = [(2.2 * R * (k % 5), 2.2 * R * (k // 5)) for k in range(20)]
    bodies = [
        Body(Sphere(R), place, 0.0, tuple(1e-2 * rng.normal(size=2)), density=2650.0)
        for place in places
    ]
    law = Contact(damping_n=0.0, k_t=0.0)
    swarm = Swarm(bodies, [law], Implicit(1e-10), box=(12.0 * R, 12.0 * R))
    run = swarm.run(2.5e-3)

    def energy(at):
        """Of the motion, and of the springs that are pressed just then [J]."""
        apart = run.position[at, :, None, :2] - run.position[at, None, :, :2]
        apart -= 12.0 * R * np.round(apart / (12.0 * R))
        overlaps = np.triu(np.maximum(2.0 * R - np.hypot(*np.moveaxis(apart, -1, 0)), 0.0), 1)
        moving = bodies[0].mass * np.sum(run.velocity[at, :, :2] ** 2)
        return 0.5 * float(moving + law.k_n * np.sum(overlaps**2))

    assert energy(-1) == pytest.approx(energy(0), rel=1e-4)


@pytest.mark.slow
def test_a_frictionless_bed_of_two_sizes_is_packed_at_random():
    """Area fraction .84 in the bulk for 1 : 1.4 (O'Hern et al. 2003)."""
    found = []
    for seed in range(3):
        swarm, radii = falling(300, seed, tolerance=1e-8, wide=14.0, fraction=0.4, k_t=0.0)
        run = swarm.run(8.0)
        assert run.status == Status.FINISHED
        assert np.abs(run.velocity[-1]).max() < 1e-6
        found.append(bulk_fraction(run.position[-1, 1:], radii, swarm.box[0], 4.0 * R))
    assert np.mean(found) == pytest.approx(0.84, abs=0.015)


def test_thin_floors_hold_what_falls_in_long_steps_across_switches():
    """A polygon that sinks steadily beside one at rest: within a step its vertices went from one
    side of the floor to the other, and nothing stopped it."""
    run = pile_of(10, 0.4, False, 1e-9).run(0.25, max_steps=20_000)
    assert run.status == Status.FINISHED
    assert run.position[-1, 1, 1] > 5e-6


def test_friction_keeps_a_heap_from_flattening():
    """A triangle of three rows on a floor: without friction it falls apart, with it it stays."""
    ends = {}
    for friction in ("none", 0.0):
        rows = [(3, 0.0), (2, 1.0), (1, 2.0)]
        places = [
            (2.0 * R * k + R * row + 8.0 * R, R + math.sqrt(3.0) * R * row)
            for count, row in rows
            for k in range(count)
        ]
        bodies = [floor(30.0 * R, beyond=4.0 * R)]
        bodies += [Body(Sphere(R), place, density=2650.0) for place in places]
        run = Swarm(bodies, forces(friction=friction), fluid=WATER, box=(30.0 * R, None)).run(2.0)
        assert run.status == Status.FINISHED
        ends[friction] = run.position[-1, 1:, 1].max()
    assert ends["none"] > 4.0 * R
    assert ends[0.0] < 1.01 * R


@pytest.mark.parametrize(
    "friction", rest_slow(["none", 0.01, 0.4], lambda friction: friction == 0.4)
)
def test_polygons_pile_up_as_cheaply_as_those_that_stick(friction):
    """Pairs that nothing attracts slide one way and the other within a step, or bear next to
    nothing."""
    steps = {}
    for attraction in (True, False):
        run = pile_of(10, friction, attraction, 1e-9).run(3.0, max_steps=20_000)
        assert run.status == Status.FINISHED
        assert np.abs(run.velocity[-1, :, :2]).max() < 1e-9
        assert run.position[-1, 1:, 1].min() > 0.0  # none has fallen through the floor
        steps[attraction] = run.effort.steps
    assert steps[False] <= 3.0 * steps[True]


def test_sticking_polygons_settle_though_some_part_by_their_tangential_force():
    """One parts here so fast that its own force, which hardly lifts it, cannot hold its gap."""
    run = pile_of(50, "none", True, 1e-9).run(0.2, max_steps=20_000)
    assert run.status == Status.FINISHED
