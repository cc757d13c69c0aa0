"""Islands of a window as arrays, and how threads run them.

The thread that calls waits for the others and looks, every now and then, at how far they are and at
whether to go on: compiled code hears nothing by itself, and one window may take minutes.
"""

import itertools
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import NamedTuple

import attrs
import numpy as np

import flocsim.swarms.arrays as sw
from flocsim.integrators.base import Integrator
from flocsim.run import extended
from flocsim.state.clock import NOTHING_FULL, Clock, Counts
from flocsim.state.contacts import BodyPair, SavedContact
from flocsim.state.declared import block_of, enlarged, zeros_of
from flocsim.state.outlines import CorePoint
from flocsim.state.scene import Scene
from flocsim.state.work import Work, work_of
from flocsim.swarms.arrays import Found, Swarm

FEW, ROOM_OF_FEW, ROOM_OF_MANY = 12, 24, 6
"""Room at first for pairs of features, for every body of so few, and of more."""

PAIRS, BLOCKS, LINKS = 4, 8, 8
"""Room at first for pairs of bodies, for blocks of sparse systems, and for what contacts leave
behind, for every body."""

CHUNK = 64
"""Bodies of islands that a thread takes at once."""

LOOK_SECONDS = 0.1
"""Seconds between two looks at islands that run."""

FULL_BUDGET = 50
"""Islands of so many bodies may try as many steps in a window as one may: more of them, so many
fewer, as each costs so much more."""

Look = Callable[[int], bool]
"""Is given the steps tried in a window so far; whether to leave off."""


def budget_of(max_steps: int, bodies: int) -> int:
    """How many steps an island of so many bodies may try in a window."""
    return max(1, max_steps * FULL_BUDGET // max(bodies, FULL_BUDGET))


class IslandArrays(NamedTuple):
    """Arrays for islands of a number of bodies; ``block``: the memory of ``work``.

    ``clocks`` and ``counts``: of the island that runs, RUNNING, and as each of them begins, FRESH.
    """

    scene: Scene
    work: Work
    block: np.ndarray
    observed: np.ndarray
    clocks: np.ndarray
    counts: np.ndarray
    record: np.ndarray


class ThreadArrays:
    """The arrays of one thread: for islands of every size that there is, and what they found."""

    def __init__(self, template: Scene) -> None:
        self.template, self.most_points = template, int(np.diff(template.first).max())
        self.by_size: dict[int, IslandArrays] = {}
        self.room_of_many: tuple[int, ...] = (ROOM_OF_MANY, PAIRS, BLOCKS)
        self.found: Found = zeros_of(Found, k=256)
        self.running: IslandArrays | None = None
        self.halted = False

    @property
    def tried(self) -> int:
        """Steps tried in the island that runs."""
        if self.running is None:
            return 0
        counts = self.running.counts[sw.RUNNING]
        return int(counts.steps + counts.rejected)

    def halt(self, halted: bool = True) -> None:
        """Let the islands that run stop at their next steps; or those to come run on."""
        self.halted = halted
        for each in [*self.by_size.values()]:
            each.observed[0, sw.HALT] = float(halted)

    def of_size(self, size: int, integrator: Integrator) -> IslandArrays:
        """Arrays for islands of so many bodies."""
        if size not in self.by_size:
            points = size * self.most_points
            scene = self.template._replace(
                bodies=np.resize(self.template.bodies, size),
                first=np.zeros(size + 1, dtype=np.int64),
                vertices=CorePoint.rows(points),
            )
            zeros = np.zeros((size, 3))
            few = 1 < size <= FEW
            rooms = (ROOM_OF_FEW, PAIRS, BLOCKS) if few else self.room_of_many
            room, pairs, blocks = (size * each for each in rooms)
            work = work_of(scene, zeros, zeros, room, pairs=pairs, blocks=blocks)
            self.by_size[size] = IslandArrays(
                scene, work, block_of(work), np.zeros((size, sw.TRACK_COLUMNS)),
                Clock.rows(2), Counts.rows(2), np.zeros((0, 1)),
            )  # fmt: skip
        return self.by_size[size]

    def make_room(self, more: int) -> None:
        """See to it that so many more contacts can be found."""
        room = int(self.found.filled[0]) + more
        if room > len(self.found.links):
            larger = max(room, 2 * len(self.found.links))
            self.found = enlarged(self.found, k=larger)

    def enlarge(self, size: int, work: Work) -> None:
        """Use arrays with more room for islands of so many bodies, and of more than a few at once
        for all to come: one that finds none begins its window again."""
        self.by_size[size] = self.by_size[size]._replace(work=work, block=block_of(work))
        if size > FEW:
            have = len(work.candidates), len(work.pairs), len(work.elimination.column)
            self.room_of_many = tuple(
                max(room, -(-each // size))
                for room, each in zip(self.room_of_many, have, strict=True)
            )


class Reached(NamedTuple):
    """Who can reach whom in a window: ``labels`` (n,), the first body of every body's island;
    ``walls`` (k,), fixed bodies; ``touches`` (n, k), which of them each body can reach."""

    labels: np.ndarray
    walls: np.ndarray
    touches: np.ndarray


class Islands(NamedTuple):
    """The islands of a window: members of each, sorted, fixed bodies among them."""

    members: np.ndarray
    starts: np.ndarray
    codes: np.ndarray
    costs: np.ndarray

    @classmethod
    def of(cls, reached: Reached) -> "Islands":
        """From who can reach whom."""
        labels, walls, touches = reached
        bodies = np.flatnonzero(labels >= 0)
        names = labels[bodies]
        if touches[bodies].any():
            rows, columns = np.nonzero(touches[bodies])
            both = np.unique(np.column_stack([names[rows], walls[columns]]), axis=0)
            names, bodies = np.append(names, both[:, 0]), np.append(bodies, both[:, 1])
        order = np.lexsort((bodies, names))
        starts = np.flatnonzero(np.diff(names[order], prepend=-1))
        starts = np.append(starts, len(names)).astype(np.int64)
        count = len(starts) - 1
        return cls(
            bodies[order], starts, np.zeros(count, dtype=np.int64),
            np.zeros((count, sw.COST_COLUMNS), dtype=np.int64),
        )  # fmt: skip

    @property
    def sizes(self) -> np.ndarray:
        return np.diff(self.starts)

    def chosen(self, which: np.ndarray) -> "Islands":
        """Some of them, the largest first, those of a size one after another."""
        order = which[np.argsort(-self.sizes[which], kind="stable")]
        sizes = self.sizes[order]
        starts = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        # Where each member stands now: as far behind its island's first as it will.
        places = np.arange(starts[-1]) + np.repeat(self.starts[order] - starts[:-1], sizes)
        return Islands(self.members[places], starts, self.codes[order], self.costs[order])

    @property
    def work(self) -> float:
        """What they cost as long as all steps are alike: bodies of each, times bodies."""
        return float(np.sum(self.sizes.astype(float) ** 2))


@attrs.define
class Runner:
    """Finds and runs islands: the compiled functions, each thread's arrays, the ``box`` [m] and the
    ``reach`` [m] of all forces."""

    finder: Callable[..., int]
    joiner: Callable[..., int]
    driver: Callable[..., int]
    integrator: Integrator
    threads: list[ThreadArrays]
    max_steps: int
    box: tuple[float, float]
    reach: float
    pairs: np.ndarray = attrs.field(factory=lambda: BodyPair.rows(256))
    pool: ThreadPoolExecutor | None = None

    def reached(self, swarm: Swarm, span: float, before: Reached | None = None) -> Reached:
        """Who can reach whom in a window of so many seconds; with what was known ``before`` it was
        run: who has."""
        n, gone = len(swarm.bodies), swarm.bodies["mass"] == 0.0
        walls = np.flatnonzero((swarm.bodies["free"] == 0.0) & ~gone)
        labels = np.zeros(n, dtype=np.int64) if before is None else before.labels
        touches = np.zeros((n, len(walls)), dtype=np.bool_)
        find = self.finder if before is None else self.joiner
        while (
            found := find(swarm, span, self.reach, *self.box, self.pairs, labels, walls, touches)
        ) > len(self.pairs):  # fmt: skip
            self.pairs = BodyPair.rows(2 * found)
        labels[gone] = -1
        return Reached(labels, walls, touches)

    def run_chunk(
        self, own: ThreadArrays, swarm: Swarm, islands: Islands, first: int, last: int
    ) -> None:
        """Run islands of one size."""
        size = int(islands.sizes[first])
        own.running = arrays = own.of_size(size, self.integrator)
        arrays.clocks[sw.FRESH] = self.integrator.fresh_clock()
        arrays.counts[sw.FRESH] = self.integrator.fresh_counts(budget_of(self.max_steps, size))
        own.make_room(LINKS * size * (last - first))
        while not own.halted:
            arrays = own.by_size[size]
            first = self.driver(swarm, arrays, islands, own.found, first, last)
            if first == last:
                return
            if arrays.work.tally.full == NOTHING_FULL:
                own.make_room(len(own.found.links))
            else:
                self.driver, work = extended(self.driver, arrays.work)
                own.enlarge(size, work)

    def run(self, swarm: Swarm, islands: Islands, look: Look | None = None) -> np.ndarray | None:
        """Run islands, those of a size one after another, in all threads: the contacts that they
        leave behind (k,), in any order; None where a look at them said to leave off."""
        chunks = chunks_of(islands.sizes)
        largest = int(islands.sizes.max(initial=0))

        def work_off(own: ThreadArrays) -> None:
            # No island is larger any more.
            own.by_size = {each: its for each, its in own.by_size.items() if each <= largest}
            while chunks and not own.halted:
                try:
                    first, last = chunks.pop()
                except IndexError:
                    break
                self.run_chunk(own, swarm, islands, first, last)
            own.running = None

        def tried() -> int:
            done = islands.costs[:, [sw.STEPS_TAKEN, sw.STEPS_REJECTED]].sum()
            return int(done) + sum(own.tried for own in self.threads)

        for own in self.threads:
            own.halt(False)
            own.running, own.found.filled[0] = None, 0
        if self.pool is None:
            # Compiled here, by one thread, and where an interrupt is answered.
            self.run_chunk(self.threads[0], swarm, islands, 0, 0)
            self.pool = ThreadPoolExecutor(len(self.threads))
        at_work = [self.pool.submit(work_off, own) for own in self.threads]
        try:
            halted = self.watched(at_work, tried, look)
        finally:
            # Where this one is interrupted, the others stop as well.
            while wait(at_work, 0.0).not_done:
                for own in self.threads:
                    own.halt()
                wait(at_work, LOOK_SECONDS)
        for each in at_work:
            each.result()
        if halted:
            return None
        found = (own.found for own in self.threads)
        links: np.ndarray = SavedContact.joined([each.links[: each.filled[0]] for each in found])
        return links

    def watched(
        self, at_work: list[Future[None]], tried: Callable[[], int], look: Look | None
    ) -> bool:
        """Wait for all threads, and look at them meanwhile; whether they are to leave off."""
        while wait(at_work, LOOK_SECONDS).not_done:
            if any(each.done() and each.exception() for each in at_work):
                return True
            if look is not None and look(tried()):
                return True
        return False


def chunks_of(sizes: np.ndarray) -> list[tuple[int, int]]:
    """(first, last) of islands of one size that a thread takes at once, the smallest first: they
    are taken from behind. ``sizes``: the largest first."""
    bounds = np.flatnonzero(np.diff(sizes, prepend=-1, append=-1)).tolist()
    found = []
    for begin, end in itertools.pairwise(bounds):
        most = max(1, CHUNK // int(sizes[begin]))
        found += [(first, min(first + most, end)) for first in range(begin, end, most)]
    return found[::-1]
