"""Windows that take long: they end by a budget that goes with what steps cost, show that they live,
and can be left at any time without a trace."""

import _thread
import functools
import threading
import time

import pytest

from flocsim import Body, Sphere
from flocsim.integrators import Implicit, Status
from flocsim.swarms.runner import FULL_BUDGET, Runner, budget_of
from flocsim.swarms.swarm import Swarm
from tests.helpers.swarm_scenes import WATER, R, crowd, forces

TINY, LONG = 1e-9, 1e3
"""Steps, and a run whose windows would last for hours by them [s]."""


class Short(Implicit):
    """The same method, by such steps."""

    largest_step = TINY


def slow(count=1):
    """A swarm whose first window takes for ever."""
    bodies = [Body(Sphere(R), (1e-3 * k, 0.0), density=2650.0) for k in range(count)]
    return Swarm(bodies, forces(), Short(), WATER)


def bytes_of(progress):
    return {name: array.tobytes() for name, array in progress.state().items()}


@pytest.mark.parametrize("count", [3, 2 * FULL_BUDGET])
def test_an_island_that_uses_its_budget_up_is_named(count):
    """A row of discs that touch: one island, whose budget ends it; a lone disc goes on."""
    row = [Body(Sphere(R), (2.0 * R * k, 0.0), density=2650.0) for k in range(count)]
    bodies = [Body(Sphere(R), (0.0, 1.0), density=2650.0), *row]
    swarm = Swarm(bodies, forces(), Short(), WATER)
    run = swarm.run(1.0, max_steps=400)
    assert run.status == Status.STEP_BUDGET
    assert run.failed.tolist() in ([0], list(range(1, count + 1)))
    taken = run.effort.steps + run.effort.rejected
    assert taken <= budget_of(400, count) + 400 + 2


@pytest.mark.parametrize("threads", [1, 2])
def test_a_long_window_is_looked_at_and_left_as_it_was(threads):
    progress = slow(3).begin(LONG, threads=threads, max_steps=10**12)
    before, seen = bytes_of(progress), []

    def look(tried):
        seen.append(tried)
        return len(seen) == 4

    assert progress.advance(LONG, look) == Status.STOPPED, "the window itself takes for ever"
    assert sorted(seen) == seen and seen[-1] > seen[0]
    assert bytes_of(progress) == before


def test_looks_change_no_bit(monkeypatch):
    """However often a window is left and tried again, the run ends with the same bytes."""
    bodies, side = crowd(20, 4)
    watched, ends = Runner.watched, []

    def after(self, at_work, tried, look, pause):
        """A first look after a moment, wherever the islands are by then."""
        time.sleep(pause)
        return look(tried()) or watched(self, at_work, tried, look)

    for often, pause in ((0, 0.0), (1, 0.0), (1, 1e-4), (1, 1e-3)):
        monkeypatch.setattr(Runner, "watched", functools.partialmethod(after, pause=pause))
        progress = Swarm(bodies, forces(), fluid=WATER, box=(side, side)).begin(0.02)
        calls, left, status = 0, 0, Status.PAUSED
        while status != Status.FINISHED:
            status = progress.advance(0.02, lambda _, now=calls % 2 < often: now)
            left += status == Status.STOPPED
            calls += 1
        # After a pause a busy machine may have finished the window before it is looked at.
        assert left > 3 if often and not pause else left == 0 or often
        ends.append(bytes_of(progress))
    assert all(each == ends[0] for each in ends)


@pytest.mark.parametrize("threads", [1, 2])
def test_an_interrupt_is_answered_within_a_window(interruptible, threads):
    slow().begin(1e-8).advance(1e-8)  # compiled
    timer = threading.Timer(0.5, _thread.interrupt_main)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        slow().run(LONG, threads=threads, max_steps=10**12)
    assert not timer.is_alive()
