"""A swarm in progress: from one common time to the next.

A window is tried until no body of it has been in reach of one of another island: where one has,
both islands are run anew as one, and after some tries the window is made shorter. What islands have
come to is taken over all at once, so that a window leaves nothing behind that is half done. An
island of the same bodies as before is not run again (`Finished`).
"""

import itertools
import math

import attrs
import numpy as np

import flocsim.swarms.arrays as sw
from flocsim.integrators.base import Status
from flocsim.run import known_error
from flocsim.state.bodies import VX, VY
from flocsim.state.contacts import SavedContact
from flocsim.swarms.arrays import Swarm, with_links
from flocsim.swarms.placement import REMOVE, Leaving
from flocsim.swarms.runner import Islands, Look, Runner
from flocsim.swarms.together.clusters import WAY, Shielding

NONE = -1
"""Label of a body whose island has not been run."""


class Finished:
    """The islands that have been run to the end of one window, of ``free`` (n,) bodies that move.

    ``labels`` (n,): which of them a free body is of; ``sizes`` (k,): bodies of each;
    ``links``: the contacts that they leave, in any order.
    """

    def __init__(self, free: np.ndarray) -> None:
        self.free = free
        self.labels = np.full(len(free), NONE)
        self.sizes = np.zeros(0, dtype=np.int64)
        self.links = SavedContact.rows(0)

    def missing(self, islands: Islands) -> np.ndarray:
        """Which islands are not among them. One of the same free bodies, and as many fixed ones,
        has the same of these: it can reach no fewer than before."""
        if not len(self.sizes):
            return np.arange(len(islands.sizes))
        free, starts = self.free[islands.members], islands.starts[:-1]
        labels = self.labels[islands.members]
        last = np.maximum.reduceat(np.where(free, labels, NONE), starts)
        first = np.minimum.reduceat(np.where(free, labels, len(self.sizes)), starts)
        return np.flatnonzero((first != last) | (islands.sizes != self.sizes[last]))

    def add(self, islands: Islands, links: np.ndarray) -> None:
        """Add islands, with the contacts that they leave; what was known of their bodies goes."""
        island = np.repeat(np.arange(len(islands.sizes)), islands.sizes)
        free = self.free[islands.members]
        bodies = islands.members[free]
        self.labels[bodies] = NONE
        later = self.links["later"]
        owners = np.where(self.free[later], later, self.links["earlier"])  # free ones
        kept = self.labels[owners] != NONE
        self.labels[bodies] = len(self.sizes) + island[free]
        self.sizes = np.append(self.sizes, islands.sizes)
        self.links = SavedContact.joined([self.links[kept], links])


LEAST_WANDER = 0.05
"""A body may stray by so many bounding radii at least."""

MORE_WANDER, LESS_WANDER = 1.5, 0.7
"""It may stray by so many times as far as it has, and by no less than this share of as far as it
might before."""

MOST_TRIES = 4
"""Tries of a window before it is made shorter."""

CROWDED, SPARSE = 1.2, 1.05
"""Windows get shorter where their islands take more than so many times the work of the least ones,
those of no time at all, longer where they take less."""

AGAIN = 1.2
"""Shorter as well where more than so many times that work has been done: islands that meet within a
window are run again."""

ENOUGH_STEPS = 20
"""Windows in which bodies take so many steps, in the mean, get no longer: that would save nothing.
"""

SHORTER, LONGER = 0.6, 1.4

FIRST_WAY = 0.1
"""Bodies go so many radii against each other in the first window."""

LONGEST_WAY = 0.2
"""Bodies go by no more than this share of a periodic box against each other in a window."""

ALL_BUT = 0.999
"""A window that ends behind this share of what is left ends with it."""


STATE = ("motion", "carried", "errors", "steps", "methods", "wander", "links")
"""Arrays of a swarm that the rest of a run follows from."""


@attrs.define
class Effort:
    """What a swarm has taken so far: windows and their tries; steps of islands, taken and rejected,
    those times their bodies; forces summed."""

    windows: int = 0
    tries: int = 0
    steps: int = 0
    rejected: int = 0
    body_steps: int = 0
    evaluations: int = 0

    def add(self, islands: Islands) -> None:
        """Add what islands have taken."""
        self.tries += 1
        steps = islands.costs[:, sw.STEPS_TAKEN]
        self.steps += int(steps.sum())
        self.rejected += int(islands.costs[:, sw.STEPS_REJECTED].sum())
        self.body_steps += int(np.sum(steps * islands.sizes))
        self.evaluations += int(islands.costs[:, sw.FORCES_SUMMED].sum())


class Progress:
    """A swarm on its way.

    Parameters: ``runner``; ``swarm``, its arrays; ``until`` [s]; ``leaving``, what becomes of
    bodies that leave the box (None: they go on); ``shielding``, what clusters make of drag (None:
    nothing).
    """

    def __init__(
        self, runner: Runner, swarm: Swarm, until: float, leaving: Leaving | None = None,
        shielding: Shielding | None = None,
    ) -> None:  # fmt: skip
        self.runner, self.swarm = runner, swarm
        self.leaving, self.shielding = leaving, shielding
        self.gone = np.zeros(len(swarm.bodies), bool)
        self.returns = np.zeros(len(swarm.bodies), dtype=np.int64)
        self.free = swarm.bodies["free"] == 1.0
        self.least_wander = LEAST_WANDER * swarm.bodies["bounding_radius"]
        swarm.wander[:] = self.least_wander
        swarm.times[sw.HORIZON_AT] = until
        self.time, self.effort = 0.0, Effort()
        # Its own: a window that fails leaves that of the swarm half written.
        self.stated = np.zeros(len(swarm.bodies))
        self.span = min(self.time_to_go(FIRST_WAY * self.mean_radius), 1e-3 * until)
        self.failed: np.ndarray | None = None

    @property
    def mean_radius(self) -> float:
        """The mean bounding radius of the bodies that move [m]."""
        return float(np.mean(self.swarm.bodies[self.free]["bounding_radius"]))

    def time_to_go(self, way: float) -> float:
        """The time in which no body goes further than that against the mean of all [s]."""
        velocity = self.swarm.motion[self.free][:, [VX, VY]]
        fastest = float(np.hypot(*(velocity - velocity.mean(axis=0)).T).max())
        return way / fastest if fastest > 0.0 else math.inf

    @property
    def errors(self) -> np.ndarray:
        """The stated errors of position of the bodies that move [m]; inf where not known."""
        free, swarm = self.free, self.swarm
        sizes = swarm.bodies[free]["bounding_radius"]
        return known_error(self.stated[free], swarm.motion[free][:, VX:], sizes, self.time)

    @property
    def median_error(self) -> float:
        """The stated error of position that half of the bodies that move keep below [m]."""
        return float(np.median(self.errors)) if self.free.any() else 0.0

    def seen(self) -> tuple[float, np.ndarray, float]:
        """(time [s], motion (n, 6), the largest stated error [m]) now; NaN for bodies that are
        gone."""
        motion = self.swarm.motion.copy()
        motion[self.gone] = math.nan
        return self.time, motion, float(self.errors.max(initial=0.0))

    def state(self) -> dict[str, np.ndarray]:
        """All that the rest of the run follows from, as arrays by name."""
        return {name: getattr(self.swarm, name).copy() for name in STATE} | {
            "time": np.array(self.time),
            "span": np.array(self.span),
            "effort": np.array(attrs.astuple(self.effort), dtype=np.int64),
            "gone": self.gone.astype(np.int64),
            "returns": self.returns.copy(),
            "stated": self.stated.copy(),
        }

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Go on from a `state` of a run of the same swarm: to the same bytes as that run itself."""
        for name in STATE:
            if name != "links":
                getattr(self.swarm, name)[...] = state[name]
        self.swarm = with_links(self.swarm, state["links"])
        self.time, self.span = float(state["time"]), float(state["span"])
        self.effort = Effort(*state["effort"].tolist())
        self.returns[...] = state["returns"]
        self.stated[...] = state["stated"]
        self.forget(state["gone"] == 1)

    def advance(self, stop: float, look: Look | None = None) -> Status:
        """Go on to the next common time, ``stop`` at the latest: PAUSED, FINISHED where that is
        ``stop``, or the Status with which an island ended for good, ``failed`` being its bodies.

        ``look(tried)`` is called now and then within the window, with the steps that its islands
        have tried so far, and leaves off where it returns what counts as true: STOPPED, everything
        being as before.
        """
        before = self.swarm.wander.copy(), self.span, attrs.evolve(self.effort)
        status = Status.STOPPED
        try:
            status = self.advance_window(stop, look)
        finally:
            # Also where an interrupt has come in between.
            if status == Status.STOPPED:
                self.swarm.wander[:], self.span, self.effort = before
        return status

    def advance_window(self, stop: float, look: Look | None) -> Status:
        """The same, with what trying has changed left as it is."""
        if not self.free.any():
            self.time = stop
            return Status.FINISHED
        swarm, began = self.swarm, self.effort.body_steps
        way = LONGEST_WAY * min(self.runner.box)
        if self.shielding is not None:
            way = min(way, WAY * self.mean_radius)
            self.shielding.apply(swarm.bodies, swarm.motion[:, :3])
        span = min(self.span, self.time_to_go(way))
        least = swarm._replace(wander=self.least_wander)
        clusters = Islands.of(self.runner.reached(least, 0.0))
        finished, reached, done = Finished(self.free), None, 0.0
        for tried in itertools.count(1):
            whole = span >= ALL_BUT * (stop - self.time)
            swarm.times[sw.BEGIN] = self.time
            swarm.times[sw.END] = stop if whole else self.time + span
            length = swarm.times[sw.END] - self.time
            reached = self.runner.reached(swarm, length, reached)
            islands = Islands.of(reached)
            fresh = islands.chosen(finished.missing(islands))
            if not len(fresh.sizes):
                break
            if tried % MOST_TRIES == 0:
                self.span = span = 0.5 * length
                finished, reached = Finished(self.free), None
                continue
            done += fresh.work
            status = self.run_fresh(fresh, finished, look)
            if status != Status.FINISHED:
                return status
        self.take_over(finished)
        self.let_leave()
        if whole:
            return Status.FINISHED
        crowd = islands.work / clusters.work
        steps = self.effort.body_steps - began
        if crowd > CROWDED or done > AGAIN * islands.work:
            self.span = SHORTER * span
        elif crowd < SPARSE and steps < ENOUGH_STEPS * self.free.sum():
            self.span = LONGER * span
        return Status.PAUSED

    def run_fresh(self, fresh: Islands, finished: Finished, look: Look | None) -> Status:
        """Run islands to the window's end, and let their bodies stray as far as they have: FINISHED
        or the Status with which one of them ended."""
        contacts = self.runner.run(self.swarm, fresh, look)
        if contacts is None:
            return Status.STOPPED
        finished.add(fresh, contacts)
        self.effort.add(fresh)
        for each in np.flatnonzero(fresh.codes != Status.FINISHED).tolist():
            self.failed = fresh.members[fresh.starts[each] : fresh.starts[each + 1]]
            return Status(int(fresh.codes[each]))
        members, swarm = fresh.members, self.swarm
        swarm.wander[members] = np.maximum(swarm.wander[members], swarm.strayed[members])
        return Status.FINISHED

    def take_over(self, finished: Finished) -> None:
        """Make what the islands have come to the state of the swarm."""
        swarm, free = self.swarm, self.free
        for old, new in (
            (swarm.motion, swarm.new_motion), (swarm.carried, swarm.new_carried),
            (swarm.errors, swarm.new_errors), (swarm.steps, swarm.new_steps),
            (swarm.methods, swarm.new_methods),
        ):  # fmt: skip
            old[free] = new[free]
        length = swarm.times[sw.END] - swarm.times[sw.BEGIN]
        swarm.motion[~free, :VX] += length * swarm.motion[~free, VX:]
        strayed, wander = MORE_WANDER * swarm.strayed, LESS_WANDER * swarm.wander
        np.maximum(np.maximum(strayed, wander), self.least_wander, out=swarm.wander)
        self.swarm = with_links(swarm, finished.links)
        self.time = float(swarm.times[sw.END])
        self.stated[...] = swarm.stated
        self.effort.windows += 1

    def forget(self, gone: np.ndarray) -> None:
        """From now on some bodies are gone."""
        self.gone |= gone
        self.free &= ~gone
        swarm = self.swarm
        swarm.bodies["free"][gone] = swarm.bodies["mass"][gone] = 0.0

    def let_leave(self) -> None:
        """Deal with what has left the box, as ``leaving`` says."""
        if self.leaving is None:
            return
        for members in self.leaving.leaving(self.swarm, self.free):
            if self.leaving.rule == REMOVE:
                gone = np.isin(np.arange(len(self.gone)), members)
                self.forget(gone)
                self.swarm = self.leaving.removed(self.swarm, gone)
            else:
                self.returns[members] += 1
                count = int(self.returns[members[0]])
                self.leaving.returned(self.swarm, members, self.free, count)
