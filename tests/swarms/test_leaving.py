"""What leaves a box: nothing else is touched by it, and it comes back with all its contacts."""

import math

import numpy as np
import pytest

from flocsim import Body, Sphere
from flocsim.integrators import Status
from flocsim.state.contacts import CLOSED, SavedContact
from flocsim.swarms.arrays import with_links
from flocsim.swarms.placement import REENTER, REMOVE, Leaving
from flocsim.swarms.swarm import Swarm
from tests.helpers.swarm_scenes import WATER, R, forces

WIDE, HIGH = 24.0 * R, 30.0 * R


def swarm_at(places, **options):
    bodies = [Body(Sphere(R), place, density=2650.0) for place in places]
    return Swarm(bodies, forces(), fluid=WATER, box=(WIDE, None), **options)


def progress_of(swarm, rule, until=1.0, floor=False, key=(1, 0), repeats=(True, False)):
    leaving = Leaving(rule, (WIDE, HIGH), repeats, floor, key, swarm.gauge())
    return swarm.begin(until, leaving=leaving)


PLACES = [(4.0 * R, -1.5 * R), (12.0 * R, 10.0 * R), (14.1 * R, 10.0 * R), (20.0 * R, -0.5 * R)]
"""One below the box, two inside, one that lies across the lower side."""


def test_what_is_below_is_removed_and_nothing_else():
    progress = progress_of(swarm_at(PLACES), REMOVE)
    progress.let_leave()
    assert progress.gone.tolist() == [True, False, False, False]
    _, motion, _ = progress.seen()
    assert np.isnan(motion[0]).all()
    assert motion[1:, :2].tolist() == [list(place) for place in PLACES[1:]]
    progress.let_leave()
    assert progress.gone.sum() == 1


def test_a_floor_keeps_all():
    progress = progress_of(swarm_at(PLACES), REMOVE, floor=True)
    progress.let_leave()
    assert not progress.gone.any()


def test_a_cluster_leaves_when_all_of_it_is_outside():
    touch = 2.0 * R - 1e-9
    column = [(4.0 * R, y * touch - 1.2 * R) for y in range(3)]
    progress = progress_of(swarm_at(column), REMOVE)
    progress.let_leave()
    assert not progress.gone.any()
    progress.swarm.motion[:, 1] -= 5.0 * R
    progress.let_leave()
    assert progress.gone.all()
    # Nothing is left to be moved.
    assert progress.advance(0.5) == Status.FINISHED and progress.time == 0.5


def test_a_cluster_comes_back_as_it_is():
    """Turned and moving as before, with its tangential displacements, clear of all others."""
    touch = 2.0 * R - 1e-9
    pair = [(4.0 * R, -3.0 * R), (4.0 * R + touch, -3.0 * R)]
    others = [(x * 3.0 * R, HIGH - 0.2 * R) for x in range(1, 5)]
    swarm = swarm_at([*pair, *others])
    progress = progress_of(swarm, REENTER)
    links = SavedContact.rows(1)
    links[0] = (1, 0, 1, 0, CLOSED, 1e-9, 0.0, 0.0, 0.0, 0.0)
    progress.swarm = with_links(progress.swarm, links)
    progress.swarm.motion[:2, 3:] = [1e-4, -2e-4, 3.0]
    before = progress.swarm.motion.copy()
    progress.let_leave()
    after = progress.swarm.motion
    shift = after[:, :2] - before[:, :2]
    assert np.all(shift[2:] == 0.0) and np.all(after[:, 2:] == before[:, 2:])
    assert np.abs(shift[0] - shift[1]).max() < 1e-18
    assert after[:2, 1].min() - R >= HIGH - 1e-12
    near = swarm.gauge().neighbours(after[:, :3], 0.05 * R)
    assert near.pairs.tolist() == [[1, 0]]
    assert progress.swarm.links.tolist() == links.tolist()
    assert progress.returns.tolist() == [1, 1, 0, 0, 0, 0]


def test_where_it_comes_back_follows_from_the_key_alone():
    def places(key, rounds):
        progress = progress_of(swarm_at([(4.0 * R, 0.0)]), REENTER, key=key)
        found = []
        for _ in range(rounds):
            progress.swarm.motion[0, 1] = -1.5 * R
            progress.let_leave()
            found.append(float(progress.swarm.motion[0, 0]))
        return found

    assert places((1, 0), 3) == places((1, 0), 3)
    spread = [*places((1, 0), 40), *places((1, 1), 40)]
    assert len(set(spread)) == 80
    # Evenly over the width: mean and deviation of a uniform distribution.
    assert np.mean(spread) == pytest.approx(0.5 * WIDE + R, abs=3.0 * WIDE / math.sqrt(12 * 80))
    assert np.std(spread) == pytest.approx(WIDE / math.sqrt(12.0), rel=0.25)


def test_a_crowded_top_puts_it_further_out():
    row = [(2.05 * R * x + R, HIGH + y * R) for x in range(11) for y in (0.0, 2.2)]
    progress = progress_of(swarm_at([(4.0 * R, -1.5 * R), *row]), REENTER)
    progress.let_leave()
    assert progress.swarm.motion[0, 1] > HIGH + 3.9 * R


def test_a_state_with_bodies_gone_goes_on_to_the_same_bytes():
    places = [(4.0 * R, 1.0 * R), (12.0 * R, 3.0 * R), (14.1 * R, 9.0 * R), (20.0 * R, 24.0 * R)]

    def run(rule, stop_after=None):
        progress = progress_of(swarm_at(places), rule, 0.3)
        windows = 0
        while progress.advance(0.3) == Status.PAUSED:
            windows += 1
            if windows == stop_after:
                state = progress.state()
                progress = progress_of(swarm_at(places), rule, 0.3)
                progress.restore(state)
        return progress

    for rule in (REMOVE, REENTER):
        whole = run(rule)
        late = run(rule, max(whole.effort.windows - 2, 1))
        assert whole.gone.any() if rule == REMOVE else whole.returns.sum() > 1
        assert whole.seen()[1].tobytes() == late.seen()[1].tobytes()
        assert whole.effort == late.effort
