"""Which bodies form an island: who may meet in a window, and who has met."""

import itertools
import math

import numpy as np
import pytest

import flocsim.arrays as at
import flocsim.swarms.arrays as sw
from flocsim import Body, Sphere
from flocsim.compiler.composer import compose
from flocsim.forces import Contact, Gravity, StokesDrag
from flocsim.swarms.arrays import swarm_of
from flocsim.swarms.grouping import have_met, join_islands, share_to_touch
from flocsim.swarms.islands import stretch_at, watch_paths, widen
from flocsim.swarms.placement import floor
from flocsim.swarms.runner import Runner
from flocsim.swarms.swarm import Swarm
from tests.helpers.swarm_scenes import WATER, R, crowd, forces

WIDE = (math.inf, math.inf)


def arrays_of(places, velocities=None):
    """The arrays of a swarm of discs."""
    bodies = [Body(Sphere(R), (x * R, y * R), density=2650.0) for x, y in places]
    swarm = Swarm(bodies, [Gravity(), StokesDrag(), Contact()], fluid=WATER)
    scene = swarm.system.scene(jit=False)
    arrays = swarm_of(scene, *swarm.system.motion(), swarm.integrator.fresh_clock())
    if velocities is not None:
        arrays.motion[:, at.VX : at.VX + 2] = R * np.array(velocities)
    return arrays


def fill_ways(arrays, *paths):
    """Write down paths (STRETCHES + 1, 2) in radii, straight on within a stretch."""
    for body, path in enumerate(paths):
        ends = R * np.array(path)
        for stretch in range(sw.STRETCHES):
            two = ends[stretch : stretch + 2]
            (left, low), (right, high) = two.min(axis=0), two.max(axis=0)
            arrays.ways[body, stretch] = left, right, low, high


def straight(start, end):
    return np.linspace(start, end, sw.STRETCHES + 1)


def joined(arrays, box=WIDE, reach=0.0):
    """Names of the islands of bodies that were alone before they have been where they have."""
    n = len(arrays.bodies)
    labels, pairs = np.arange(n), np.zeros((n * n, 2), dtype=np.int64)
    join = compose(join_islands, {}, jit=False)
    no_walls = np.zeros(0, dtype=np.int64), np.zeros((n, 0), dtype=np.bool_)
    found = join(arrays, 1.0, reach, *box, pairs, labels, *no_walls)
    assert found <= len(pairs)
    return labels.tolist()


def test_bodies_that_cross_a_place_at_other_times_have_not_met():
    arrays = arrays_of([(0.0, 0.0), (50.0, 0.0)])
    fill_ways(arrays, straight((0.0, -20.0), (0.0, 20.0)), straight((-15.0, 0.0), (25.0, 0.0)))
    assert joined(arrays) == [0, 1]
    fill_ways(arrays, straight((0.0, -20.0), (0.0, 20.0)), straight((-20.0, 0.0), (20.0, 0.0)))
    assert joined(arrays) == [0, 0]


def test_reach_counts_and_so_do_images():
    arrays = arrays_of([(0.0, 0.0), (3.0, 0.0)])
    fill_ways(arrays, straight((0.0, 0.0), (0.0, 5.0)), straight((3.0, 0.0), (3.0, 5.0)))
    assert joined(arrays) == [0, 1]
    assert joined(arrays, reach=1.01 * R) == [0, 0]
    fill_ways(arrays, straight((0.0, 0.0), (0.0, 5.0)), straight((18.1, 0.0), (18.1, 5.0)))
    assert joined(arrays) == [0, 1]
    assert joined(arrays, box=(20.0 * R, math.inf)) == [0, 0]


def test_islands_of_all_who_have_met_are_one():
    arrays = arrays_of([(5.0 * k, 0.0) for k in range(6)])
    still = [straight((5.0 * k, 0.0), (5.0 * k, 0.0)) for k in range(6)]
    still[2] = straight((10.0, 0.0), (13.5, 0.0))
    still[4] = straight((20.0, 0.0), (16.5, 0.0))
    fill_ways(arrays, *still)
    assert joined(arrays) == [0, 1, 2, 2, 2, 5]


@pytest.mark.parametrize("seed", range(20))
def test_who_has_met_is_what_a_plain_search_says(seed):
    """Random walks, at a thousand times each: who came near has met, and none who stayed away by
    more than the boxes are wide."""
    rng = np.random.default_rng(seed)
    n = 12
    arrays = arrays_of([(5.0 * k, 0.0) for k in range(n)])
    steps = rng.normal(0.0, 0.7, (n, sw.STRETCHES + 1, 2)).cumsum(axis=1)
    paths = rng.uniform(-15.0, 15.0, (n, 1, 2)) + steps
    fill_ways(arrays, *paths)
    met = compose(have_met, {}, jit=False)
    widest = R * np.hypot(*np.abs(np.diff(paths, axis=1)).max(axis=(0, 1)))
    times = np.linspace(0.0, sw.STRETCHES, 1000)
    finer = R * np.array([
        [np.interp(times, range(sw.STRETCHES + 1), path[:, axis]) for axis in range(2)]
        for path in paths
    ])  # fmt: skip
    for a, b in itertools.combinations(range(n), 2):
        nearest = np.hypot(*(finer[a] - finer[b])).min()
        found = met(arrays, a, b, 0.5 * R, *WIDE)
        assert found or nearest >= 2.5 * R
        assert not found or nearest < 2.5 * R + 2.0 * widest


def test_boxes_hold_all_of_a_way():
    """Steps of any lengths, straight on between: every place of a way is in the box of its time."""
    rng = np.random.default_rng(4)
    swarm = Swarm(
        [Body(Sphere(R), (0.0, 0.0), density=2650.0)], [StokesDrag(), Contact()], fluid=WATER
    )
    begun = swarm.begin(1.0)
    place = begun.runner.threads[0].of_size(1, swarm.integrator)
    observed, work, scene = place.observed, place.work, place.scene
    observed[0] = 0.0
    observed[0, sw.SINCE], observed[0, sw.LENGTH], observed[0, sw.SEEN_AT] = 2.0, 0.5, 2.0
    boxes = observed[0, sw.BOXES :].reshape(sw.STRETCHES, sw.BOX_COLUMNS)
    boxes[:] = math.inf, -math.inf, math.inf, -math.inf
    times = np.sort(np.append(2.0 + 0.5 * rng.random(9), [2.0, 2.5]))
    path = rng.normal(size=(len(times), 2)).cumsum(axis=0)
    observed[0, [sw.SEEN_X, sw.SEEN_Y]] = path[0]
    widen(observed, 0, 0, *path[0])
    scene.bodies[0, at.FREE] = 1.0
    watch = compose(watch_paths, {}, jit=False)
    for time, (x, y) in zip(times[1:], path[1:], strict=True):
        work.motion[at.NOW, 0, at.X], work.motion[at.NOW, 0, at.Y] = x, y
        assert watch(scene, work, observed, time) == 0
    for time in np.linspace(2.0, 2.5, 997):
        left, right, low, high = boxes[stretch_at(observed, time)]
        x, y = (np.interp(time, times, path[:, axis]) for axis in range(2))
        assert left - 1e-12 <= x <= right + 1e-12 and low - 1e-12 <= y <= high + 1e-12


@pytest.mark.parametrize(
    ("away", "speed", "expected"),
    [(6.0, 8.0, 0.5), (6.0, 2.0, 1.0), (6.0, -8.0, 1.0), (2.0, 8.0, 0.0)],
)
def test_the_share_of_a_window_until_circles_touch(away, speed, expected):
    arrays = arrays_of([(0.0, 0.0), (away, 0.0)], [(speed, 0.0), (0.0, 0.0)])
    share = compose(share_to_touch, {}, jit=False)
    assert share(arrays, 0, 1, 1.0, *WIDE) == pytest.approx(expected)
    assert share(arrays, 1, 0, 1.0, *WIDE) == pytest.approx(expected)


def test_who_follows_one_that_lands_is_of_its_island_from_the_first():
    """Along straight paths the two would never meet: the first one stops, the other does not."""
    lying = Body(Sphere(R), (0.0, R), density=2650.0)
    falling = [
        Body(Sphere(R), (0.0, y * R), velocity=(0.0, -1e-4), density=2650.0) for y in (3.3, 5.6)
    ]
    bodies = [floor(50.0 * R, beyond=0.0), lying, *falling]
    swarm = Swarm(bodies, [Gravity(), StokesDrag(), Contact()], fluid=WATER)
    progress = swarm.begin(1.0)
    reached = progress.runner.reached(progress.swarm, 1.5 * R / 1e-4, progress.reach, progress.box)
    assert reached.labels[1:].tolist() == [1, 1, 1]


def test_no_two_of_different_islands_have_been_near(monkeypatch):
    """What makes a window right; in windows so long that bodies meet whom straight paths miss."""
    bodies, side = crowd(30, 2)
    swarm = Swarm(bodies, forces(), fluid=WATER, box=(side, side))
    progress, seen = swarm.begin(0.05), 0
    take_over, reached = progress.take_over, Runner.reached
    labels = None

    def known(*arguments):
        nonlocal labels
        found = reached(*arguments)
        labels = found.labels
        return found

    def watched(finished):
        nonlocal seen
        low, high = progress.swarm.ways[:, :, ::2], progress.swarm.ways[:, :, 1::2]
        centres, widths = 0.5 * (low + high), high - low
        radii = progress.swarm.bodies[:, at.BOUNDING_RADIUS]
        for a, b in itertools.combinations(range(len(labels)), 2):
            if labels[a] != labels[b]:
                between = centres[a] - centres[b]
                between -= side * np.round(between / side)
                gaps = np.maximum(np.abs(between) - 0.5 * (widths[a] + widths[b]), 0.0)
                assert np.hypot(*gaps.T).min() >= radii[a] + radii[b] + progress.reach
        seen += 1
        take_over(finished)

    progress.take_over = watched
    monkeypatch.setattr(Runner, "reached", known)
    progress.span *= 300.0
    while progress.advance(0.05).name == "PAUSED":
        pass
    assert seen > 3


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
