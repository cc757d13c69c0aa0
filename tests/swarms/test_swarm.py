"""Swarms: the same motion as in one run, whatever the islands, the order, the box and the
threads."""

import math

import attrs
import numpy as np
import pytest

from flocsim import Body, Sphere, System
from flocsim.body import Fluid
from flocsim.errors import UsageError
from flocsim.forces import CentreForce, Contact, Gravity, StokesDrag
from flocsim.integrators import Status
from flocsim.swarms.placement import floor, wall
from flocsim.swarms.swarm import Swarm
from tests.helpers.swarm_scenes import WATER, R, crowd, forces
from tests.helpers.tiers import rest_slow

SIDE = 12.0 * R
UNTIL = 0.05


def ends(bodies, box=None, until=UNTIL, **options):
    """The Trajectory of a swarm of these bodies."""
    trajectory = Swarm(bodies, forces(), fluid=WATER, box=box).run(until, **options)
    assert trajectory.status == Status.FINISHED
    return trajectory


def furthest(a, b):
    """The largest distance between places (n, 3) of the same bodies [m]."""
    return np.hypot(*(a - b)[:, :2].T).max()


@pytest.mark.slow
def test_islands_end_as_one_run_does():
    bodies, _ = crowd(16, 1)
    swarm = ends(bodies)
    one = System(bodies, forces(), fluid=WATER).run(UNTIL)
    assert swarm.effort.windows > 3
    assert swarm.effort.body_steps < 0.9 * len(bodies) * one.steps
    assert furthest(swarm.position[-1], one.position[-1]) < 1e-9 + swarm.error[-1] + one.error
    # They have met, or this shows nothing.
    alone = [System([body], forces(), fluid=WATER).run(UNTIL).position[-1][0] for body in bodies]
    assert furthest(swarm.position[-1], np.array(alone)) > 0.1 * R


@pytest.mark.parametrize("seed", range(2))
def test_a_box_may_be_shifted_by_any_vector(seed):
    bodies, side = crowd(14, seed)
    there = ends(bodies, (side, side))
    shift = np.random.default_rng(seed).uniform(-3.0 * side, 3.0 * side, 2)
    moved = [attrs.evolve(body, position=tuple(body.position + shift)) for body in bodies]
    here = ends(moved, (side, side))
    back = here.position[-1] - [*shift, 0.0]
    assert furthest(back, there.position[-1]) < 1e-9 + here.error[-1] + there.error[-1]
    open_air = ends(bodies)
    assert furthest(open_air.position[-1], there.position[-1]) > 0.1 * R


def test_bodies_may_be_numbered_in_any_order():
    bodies, side = crowd(14, 0)
    there = ends(bodies, (side, side))
    order = np.random.default_rng(1).permutation(len(bodies))
    here = ends([bodies[each] for each in order], (side, side))
    error = 1e-9 + here.error[-1] + there.error[-1]
    assert furthest(here.position[-1], there.position[-1][order]) < error


def test_threads_change_no_bit():
    bodies, side = crowd(30, 2)
    box = (side, side)
    one, two, three = (ends(bodies, box, threads=count) for count in (1, 2, 3))
    for other in (two, three):
        assert other.position.tobytes() == one.position.tobytes()
        assert other.velocity.tobytes() == one.velocity.tobytes()
        assert other.effort == one.effort


@pytest.mark.parametrize("gap", [0.0, 2e-8])
def test_a_column_of_spheres_carries_its_weight(gap):
    """Σ overlap = m g n (n + 1)/(2 k_n), from rest and after a fall."""
    n, k_n = 100, 20.0
    bodies = [Body(Sphere(R), (0.0, 0.0), density=2650.0, fixed=True)]
    bodies += [Body(Sphere(R), (0.0, (2.0 * R + gap) * (k + 1)), density=2650.0) for k in range(n)]
    trajectory = Swarm(bodies, forces(k_n=k_n)).run(0.5)
    assert trajectory.status == Status.FINISHED
    overlap = 2.0 * R * n - trajectory.position[-1, -1, 1]
    expected = bodies[1].mass * 9.81 * n * (n + 1) / (2.0 * k_n)
    assert overlap == pytest.approx(expected, rel=1e-8)
    assert np.abs(trajectory.velocity[-1]).max() < 1e-12


def test_pairs_far_apart_end_as_each_by_itself():
    pairs = [crowd(2, seed, centre=(100.0 * R * seed, 0.0))[0] for seed in range(8)]
    swarm = ends([body for pair in pairs for body in pair])
    for number, pair in enumerate(pairs):
        alone = System(pair, forces(), fluid=WATER).run(UNTIL)
        place = swarm.position[-1, 2 * number : 2 * number + 2]
        assert furthest(place, alone.position[-1]) < 1e-10 + alone.error + swarm.error[-1]


def test_walls_hold_from_all_sides():
    side = 8.0 * R
    corners = [(0.0, 0.0), (side, 0.0), (side, side), (0.0, side)]
    walls = [wall(corners[k - 1], corners[k]) for k in range(4)]
    bodies = [
        Body(Sphere(R), (2.0 * R + 3.0 * R * (k % 2), 2.0 * R + 3.0 * R * (k // 2)),
             0.0, (3e-3, 2e-3 * (k - 1.5)), density=2650.0)
        for k in range(4)
    ]  # fmt: skip
    trajectory = Swarm([*bodies, *walls], forces(gravity=0.0), fluid=WATER).run(0.02, every=0.001)
    inside = trajectory.position[:, :4, :2]
    assert inside.min() > 0.9 * R and inside.max() < side - 0.9 * R


@attrs.frozen
class Everywhere(CentreForce):
    """A force without a reach."""

    @staticmethod
    def kernel(pair):
        return 1e-20 / pair.centre_distance


def test_what_a_swarm_cannot_do_is_said():
    few, _ = crowd(3, 0)
    many = [Body(Sphere(R), (3.0 * R * k, 0.0), density=1e3) for k in range(201)]
    with pytest.raises(UsageError, match="Everywhere has no finite reach"):
        Swarm(many, [Everywhere()])
    Swarm(many, [Everywhere()], all_pairs=True)
    Swarm(few, [Everywhere()])
    with pytest.raises(UsageError, match="the box is 2e-05 m wide"):
        Swarm(few, forces(), box=(2e-5, None))
    with pytest.raises(
        UsageError, match="the flow varies along y, but the box is periodic along y"
    ):
        Swarm(few, forces(), fluid=Fluid(gradient=(0.0, 1.0, 0.0, 0.0)), box=(SIDE, SIDE))
    with pytest.raises(UsageError, match="at least one body that moves"):
        Swarm([floor(SIDE)], forces())
    with pytest.raises(UsageError, match="box must be"):
        Swarm(few, forces(), box=3.0)
    with pytest.raises(UsageError, match="the box's width must be"):
        Swarm(few, forces(), box=(-1.0, None))
    swarm = Swarm(few, forces())
    for wrong in ({"every": -1.0}, {"times": [0.2]}, {"threads": 0}, {"every": 1, "times": [1]}):
        with pytest.raises(UsageError):
            swarm.run(0.1, **wrong)
    with pytest.raises(UsageError, match="until must be"):
        swarm.run(math.inf)
    crossing = [few[0], attrs.evolve(few[0], position=tuple(np.add(few[0].position, 1e-7)))]
    with pytest.raises(UsageError, match="bodies 0 and 1 start"):
        Swarm(crossing, forces()).run(0.1)


@pytest.mark.parametrize("clusters", rest_slow([False, True], lambda clusters: not clusters))
def test_a_run_goes_on_from_its_state_to_the_same_bytes(clusters):
    bodies, side = crowd(20, 4)
    acting = [Gravity(), StokesDrag(clusters=clusters), Contact(k_t=5.0)]
    swarm = Swarm(bodies, acting, fluid=WATER, box=(side, side))
    whole, part, rest = (swarm.begin(UNTIL) for _ in range(3))
    while whole.advance(UNTIL) == Status.PAUSED:
        if len(whole.swarm.links) and whole.time < 0.5 * UNTIL:
            seen = whole.time
    while part.advance(UNTIL) == Status.PAUSED and part.time < seen:
        pass
    state = part.state()
    assert part.time == seen and len(state["links"])
    del part
    rest.restore({name: array.copy() for name, array in state.items()})
    while rest.advance(UNTIL) == Status.PAUSED:
        pass
    assert {name: array.tobytes() for name, array in rest.state().items()} == {
        name: array.tobytes() for name, array in whole.state().items()
    }


def test_a_run_can_be_watched_and_stopped():
    seen = []

    def watch(time):
        seen.append(time)
        return len(seen) == 3

    trajectory = Swarm(crowd(5, 0)[0], forces(), fluid=WATER).run(1.0, watch=watch)
    assert trajectory.status == Status.STOPPED
    assert trajectory.t.tolist() == [0.0, seen[-1]]
    assert sorted(seen) == seen and len(seen) == 3
