"""Which bodies form an island: who may meet in a window, and who has met."""

import itertools
import math

import numpy as np
import pytest

import flocsim.swarms.arrays as sw
from flocsim import Body, Sphere
from flocsim.compiler.composer import compose
from flocsim.forces import Contact, Gravity, StokesDrag
from flocsim.swarms.arrays import swarm_of
from flocsim.swarms.grouping import have_met
from flocsim.swarms.placement import floor
from flocsim.swarms.swarm import Swarm
from tests.helpers.swarm_scenes import WATER, R


@pytest.mark.parametrize("seed", range(12))
def test_who_has_met_is_what_a_plain_search_says(seed):
    """Random walks, at a thousand times each: who came near has met, and none who stayed away by
    more than the boxes are wide."""
    rng, n = np.random.default_rng(seed), 12
    bodies = [Body(Sphere(R), (5.0 * R * k, 0.0), density=2650.0) for k in range(n)]
    swarm = Swarm(bodies, [Contact()])
    clock = swarm.integrator.fresh_clock()
    arrays = swarm_of(swarm.system.scene(jit=False), *swarm.system.motion(), clock)
    steps = rng.normal(0.0, 0.7, (n, sw.STRETCHES + 1, 2)).cumsum(axis=1)
    paths = R * (rng.uniform(-15.0, 15.0, (n, 1, 2)) + steps)
    ends = np.stack([paths[:, :-1], paths[:, 1:]])
    (left, low), (right, high) = (np.moveaxis(f(ends, axis=0), -1, 0) for f in (np.min, np.max))
    arrays.ways[:] = np.stack([left, right, low, high], axis=-1)
    met = compose(have_met, {}, jit=False)
    widest = np.hypot(*np.abs(np.diff(paths, axis=1)).max(axis=(0, 1)))
    times = np.linspace(0.0, sw.STRETCHES, 1000)
    finer = np.array([
        [np.interp(times, range(sw.STRETCHES + 1), path[:, axis]) for axis in range(2)]
        for path in paths
    ])  # fmt: skip
    for a, b in itertools.combinations(range(n), 2):
        nearest = np.hypot(*(finer[a] - finer[b])).min()
        found = met(arrays, a, b, 0.5 * R, math.inf, math.inf)
        assert found or nearest >= 2.5 * R
        assert not found or nearest < 2.5 * R + 2.0 * widest


def test_who_follows_one_that_lands_is_of_its_island_from_the_first():
    """Along straight paths the two would never meet: the first one stops, the other does not."""
    lying = Body(Sphere(R), (0.0, R), density=2650.0)
    falling = [
        Body(Sphere(R), (0.0, y * R), velocity=(0.0, -1e-4), density=2650.0) for y in (3.3, 5.6)
    ]
    bodies = [floor(50.0 * R, beyond=0.0), lying, *falling]
    swarm = Swarm(bodies, [Gravity(), StokesDrag(), Contact()], fluid=WATER)
    progress = swarm.begin(1.0)
    reached = progress.runner.reached(progress.swarm, 1.5 * R / 1e-4)
    assert reached.labels[1:].tolist() == [1, 1, 1]


def cradle():
    """A heavy disc that hits a light one, which flies on faster than it and hits a third one:
    nothing else acts on them."""
    heavy = Body(Sphere(R), (-2.5 * R, 0.0), velocity=(1e-3, 0.0), density=60_000.0)
    light = [Body(Sphere(R), (x * R, 0.0), density=2650.0) for x in (0.0, 6.3)]
    return Swarm([heavy, *light], [Contact(k_t=0.0, damping_n=0.0)])


def test_who_is_met_by_one_that_was_hit_is_run_again_with_it():
    """In one long window, or in many short ones."""
    until, ends = 3.5 * R / 1e-3, []
    for span in (until, 0.02 * until):
        progress = cradle().begin(until)
        progress.span = span
        while progress.advance(until).name == "PAUSED":
            progress.span = span
        ends.append(progress.seen()[1])
        if span == until:
            assert progress.effort.windows == 1 and progress.effort.tries > 1
    assert ends[0][2, 3] > 1e-4  # the last one moves
    np.testing.assert_allclose(ends[0][:, :2], ends[1][:, :2], rtol=0.0, atol=2e-9)
