"""From one common time to the next: which islands there are, their runs, and what is kept of them.

A window is tried until no body of it strays further from its straight path than others have counted
on: those that did may stray further in the next try, islands that merge by that are run anew, and
after some tries the window is made shorter. What islands have come to is taken over all at once.
"""

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import attrs
import numpy as np

from flocsim.arrays import FREE, FULL, NOTHING_FULL, Scene, Work, with_room, work_of
from flocsim.integrators.base import Integrator, Status
from flocsim.swarms.arrays import (
    BEGIN,
    COST_COLUMNS,
    END,
    TRACK_COLUMNS,
    Found,
    Swarm,
    found_of,
    with_links,
)

LEAST_WANDER = 0.02
"""A body may stray by so many bounding radii at least."""

MORE_WANDER = 2.0
"""It may stray by so many times as far as it has in the last window."""

MOST_TRIES = 4
"""Tries of a window before it is made shorter."""

CROWDED, SPARSE = 3.0, 1.5
"""A window is made shorter where its islands take more than so many times the work of the clusters
that there are, longer where they take less."""

SHORTER, LONGER = 0.6, 1.4

SMALL_ROOM = 24
"""Room for so many pairs of features of a body, at first."""

CHUNK = 64
"""Bodies of islands that a thread takes at once."""


@attrs.define
class Place:
    """Arrays for islands of a number of bodies."""

    scene: Scene
    work: Work
    observed: np.ndarray
    clock: np.ndarray
    counts: np.ndarray


class Bench:
    """The arrays of one thread: places by size, what its islands have found."""

    def __init__(self, template: Scene, most_points: int) -> None:
        self.template, self.most_points = template, most_points
        self.places: dict[int, Place] = {}
        self.found: Found = found_of(256)

    def place_of(self, size: int, integrator: Integrator) -> Place:
        """Arrays for islands of so many bodies."""
        if size not in self.places:
            points = size * self.most_points
            scene = self.template._replace(
                bodies=np.ones((size, self.template.bodies.shape[1])),
                first=np.zeros(size + 1, dtype=np.int64),
                vertices=np.zeros((points, 2)),
                tree=np.zeros((2 * points, 3)),
            )
            zeros = np.zeros((size, 3))
            room = max(16, min(SMALL_ROOM * size, 256) if size < 12 else 6 * size)
            work = work_of(scene, zeros, zeros, room if size > 1 else 1, 4 * size, 8 * size)
            self.places[size] = Place(
                scene, work, np.zeros((size, TRACK_COLUMNS)),
                integrator.fresh_clock(), integrator.fresh_counts(0),
            )  # fmt: skip
        return self.places[size]

    def forget_above(self, size: int) -> None:
        """Give back the arrays for more bodies than that: no island is so large any more."""
        for each in [each for each in self.places if each > size]:
            del self.places[each]


@attrs.define
class Islands:
    """The islands of a window: members of each, sorted, fixed bodies among them."""

    members: np.ndarray
    starts: np.ndarray
    codes: np.ndarray
    costs: np.ndarray

    @classmethod
    def of(cls, labels: np.ndarray, walls: np.ndarray, touches: np.ndarray) -> "Islands":
        """From the name of every body's island, and which fixed bodies it can reach."""
        bodies, names = np.arange(len(labels)), labels
        free = labels >= 0
        rows, columns = np.nonzero(touches[free]) if len(walls) else ((), ())
        bodies = np.concatenate([bodies[free], walls[np.array(columns, dtype=int)]])
        names = np.concatenate([names[free], names[free][np.array(rows, dtype=int)]])
        pairs = np.unique(np.column_stack([names, bodies]), axis=0)
        starts = np.flatnonzero(np.diff(pairs[:, 0], prepend=-1))
        starts = np.append(starts, len(pairs)).astype(np.int64)
        count = len(starts) - 1
        return cls(
            np.ascontiguousarray(pairs[:, 1]), starts, np.zeros(count, dtype=np.int64),
            np.zeros((count, COST_COLUMNS), dtype=np.int64),
        )  # fmt: skip

    @property
    def sizes(self) -> np.ndarray:
        return np.diff(self.starts)

    def key(self, island: int) -> bytes:
        """What tells an island from others."""
        return self.members[self.starts[island] : self.starts[island + 1]].tobytes()

    def sorted_by_size(self) -> "Islands":
        """The same, the largest first, islands of a size one after another."""
        order = np.argsort(-self.sizes, kind="stable")
        sizes = self.sizes[order]
        starts = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        members = np.concatenate(
            [self.members[self.starts[each] : self.starts[each + 1]] for each in order]
        )
        return Islands(members, starts, self.codes[order], self.costs[order])


@attrs.define
class Runner:
    """Runs islands: the compiled functions, and each thread's arrays."""

    finder: Callable[..., int]
    driver: Callable[..., int]
    integrator: Integrator
    benches: list[Bench]
    max_steps: int
    pool: ThreadPoolExecutor | None
    pairs: np.ndarray

    def islands_of(
        self, swarm: Swarm, span: float, share: float, reach: float, box: tuple[float, float]
    ) -> Islands:
        """The islands of a window of so many seconds."""
        walls = np.flatnonzero(swarm.bodies[:, FREE] == 0.0)
        labels = np.zeros(len(swarm.bodies), dtype=np.int64)
        touches = np.zeros((len(swarm.bodies), len(walls)), dtype=np.bool_)
        while True:
            found = self.finder(
                swarm, span, share, reach, *box, self.pairs, labels, walls, touches
            )
            if found <= len(self.pairs):
                return Islands.of(labels, walls, touches)
            self.pairs = np.zeros((2 * found, 2), dtype=np.int64)

    def run_chunk(
        self, bench: Bench, swarm: Swarm, islands: Islands, first: int, last: int, all_in: bool
    ) -> None:
        """Run islands of one size."""
        place = bench.place_of(int(islands.sizes[first]), self.integrator)
        start_clock = self.integrator.fresh_clock()
        start_counts = self.integrator.fresh_counts(self.max_steps)
        record = np.zeros((0, 1))
        while True:
            first = self.driver(
                swarm, place.scene, place.work, place.observed, place.clock, place.counts, record,
                start_clock, start_counts, islands.members, islands.starts, islands.codes,
                islands.costs, bench.found, first, last, all_in,
            )  # fmt: skip
            if first == last:
                return
            if place.work.tally[FULL] == NOTHING_FULL:
                bench.found = larger(bench.found)
            else:
                place.work = with_room(place.work)

    def run(self, swarm: Swarm, islands: Islands, all_in: bool) -> list:
        """Run islands, sorted by size, in all threads; the contacts that they have found."""
        chunks = chunks_of(islands.sizes)
        for bench in self.benches:
            bench.found.count[0] = 0
            bench.forget_above(int(islands.sizes[0]) if len(islands.sizes) else 0)

        def work_off(bench: Bench) -> None:
            while True:
                try:
                    first, last = chunks.pop()
                except IndexError:
                    return
                self.run_chunk(bench, swarm, islands, first, last, all_in)

        if self.pool is None:
            work_off(self.benches[0])
        else:
            list(self.pool.map(work_off, self.benches))
        return [
            (bench.found.links[: bench.found.count[0]].copy(),
             bench.found.slips[: bench.found.count[0]].copy())
            for bench in self.benches
        ]  # fmt: skip


def larger(found: Found) -> Found:
    """The same with twice the room."""
    other = found_of(2 * len(found.links))
    count = found.count[0]
    other.links[:count], other.slips[:count] = found.links[:count], found.slips[:count]
    other.count[0] = count
    return other


def chunks_of(sizes: np.ndarray) -> list[tuple[int, int]]:
    """(first, last) of islands of one size that a thread takes at once, the smallest first: they
    are taken from behind."""
    found, first = [], 0
    while first < len(sizes):
        last, most = first + 1, max(1, CHUNK // int(sizes[first]))
        while last < len(sizes) and sizes[last] == sizes[first] and last - first < most:
            last += 1
        found.append((first, last))
        first = last
    return found[::-1]


def work_in(islands: Islands) -> float:
    """What islands cost as long as all have steps alike: bodies of each, times bodies."""
    return float(np.sum(islands.sizes.astype(float) ** 2))
