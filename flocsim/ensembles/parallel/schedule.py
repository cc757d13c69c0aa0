"""The order in which the replicates of a study are run, a stage after the other, and what rank 0
knows of them: what is finished, what has failed, whether it is enough.

Guided self-scheduling: a chunk is a share of what is left, so that the last ones are small, and a
rank gives back what it has not done when its time for the chunk is up, since replicates cost
1 to 1000 times as much as each other.

Nothing here sends a message or waits: the same calls give the same state.
"""

import enum
from collections import Counter
from collections.abc import Callable, Iterator, Sequence

import attrs
import numpy as np

from flocsim.ensembles.kind import MOST_ROWS, Chunk, Interval, StudyKind, missing, total
from flocsim.ensembles.parallel.communicator import ChunkResult, Kept
from flocsim.ensembles.storage.row_store import RowStore
from flocsim.errors import FlocsimError, plural
from flocsim.io.results.run_group import describe_note

SHORTEST_SECONDS = 0.25
"""Least time for a chunk [s]: asking costs about 1 ms."""

SECONDS_PER_RANK = 1e-3
"""Time for a chunk per rank [s]: keeps rank 0 below some thousand answers a second."""

SHARE = 3
"""A chunk is no more than what is left over so many chunks per rank."""


def chunk_seconds(size: int) -> float:
    """Return how long a chunk may take [s] on one of ``size`` ranks."""
    return max(SHORTEST_SECONDS, SECONDS_PER_RANK * size)


@attrs.define
class Stage:
    """Replicates [first, stop) of every condition.

    ``todo``: (condition, first, stop) of what may be handed out, and ``waiting`` how many
    replicates these are; ``unfinished``: how many are missing, those handed out included.
    """

    first: int
    stop: int
    todo: list[tuple[int, int, int]]
    waiting: int
    unfinished: int


@attrs.define
class Schedule:
    """What is to be run, and what is being run, on ``size`` ranks.

    ``remaining``: replicates that are missing; ``final``: with how many of each condition the
    study has ended, −1 while it goes on; ``most``: of a chunk.
    """

    size: int
    stages: list[Stage]
    remaining: int = 0
    final: int = -1
    most: int = MOST_ROWS

    @classmethod
    def of(
        cls, done: Sequence[Sequence[Interval]], borders: Sequence[int], size: int,
        most: int = MOST_ROWS,
    ) -> "Schedule":  # fmt: skip
        """Return the Schedule of what is missing.

        ``done``: of every condition the intervals that exist already; ``borders``: where stages
        end, [100, 125, …]; ``most``: replicates of a chunk.
        """
        stages = []
        for first, stop in zip([0, *borders[:-1]], borders, strict=True):
            gaps = [missing(intervals, first, stop) for intervals in done]
            places = reversed(list(enumerate(gaps)))
            todo = [(place, *gap) for place, each in places for gap in each[::-1]]
            count = sum(map(total, gaps))
            stages.append(Stage(first, stop, todo, count, count))
        return cls(size, stages, sum(stage.unfinished for stage in stages), most=most)

    def take(self) -> Chunk | None:
        """Return the next Chunk, None where all is handed out."""
        stage = next((stage for stage in self.stages if stage.todo), None)
        if stage is None:
            return None
        # Guided self-scheduling: the less is left, the shorter are the chunks.
        count = min(self.most, max(1, stage.waiting // (SHARE * self.size)))
        condition, first, stop = stage.todo.pop()
        if stop - first > count:
            stage.todo.append((condition, first + count, stop))
        chunk = Chunk(condition, first, min(stop, first + count))
        stage.waiting -= chunk.stop - chunk.first
        return chunk

    def give_back(self, chunk: Chunk, done: int) -> None:
        """Note that the first ``done`` replicates of a chunk are finished; hand out the rest."""
        stages = (stage for stage in self.stages if stage.first <= chunk.first < stage.stop)
        if (stage := next(stages, None)) is None:
            return  # more than was needed
        stage.unfinished -= done
        self.remaining -= done
        if chunk.first + done < chunk.stop:
            stage.todo.append((chunk.condition, chunk.first + done, chunk.stop))
            stage.waiting += chunk.stop - chunk.first - done

    def finished_stages(self) -> Iterator[int]:
        """Take away the leading stages of which all is there; the last replicate of each."""
        while self.stages and self.stages[0].unfinished == 0:
            yield self.stages.pop(0).stop

    def end_at(self, final: int) -> None:
        """Hand out nothing more: the study ends with this many replicates."""
        self.final, self.stages, self.remaining = final, [], 0


class TooManyFailures(FlocsimError):
    """More replicates have failed than the config allows."""


class Phase(enum.Enum):
    """How far a study is. Chunks are handed out while it is RUNNING, and no more after that."""

    RUNNING = "replicates are missing"
    INTERRUPTED = "a signal has come; what is finished is still taken in"
    FINISHED = "all replicates that are needed are there"
    GIVEN_UP = "an error; nothing is taken in any more"


@attrs.define(eq=False)
class StudyState:
    """The state of a study while it runs.

    ``is_enough(replicates)``: whether the study may end with so many of each condition;
    ``failed``: how many replicates have; ``computed``: how many this run has taken in; ``begun``:
    of unfinished replicates how many pieces are there, which progress counts.
    """

    schedule: Schedule
    store: RowStore
    study: StudyKind
    is_enough: Callable[[int], bool]
    failed: int = 0
    computed: int = 0
    phase: Phase = Phase.RUNNING
    begun: Counter[tuple[int, int]] = attrs.Factory(Counter)

    @property
    def missing(self) -> int:
        """Return how many pieces are missing, saved parts of unfinished replicates not counted."""
        return self.schedule.remaining * self.study.pieces - self.begun.total()

    @property
    def is_running(self) -> bool:
        return self.phase is Phase.RUNNING

    def next_chunk(self) -> Chunk | None:
        chunk = self.schedule.take() if self.is_running else None
        if chunk is None or not (parts := self.store.parts.get(chunk[:2])):
            return chunk
        return chunk._replace(left=self.study.left_of(parts))

    def keep(self, kept: Kept) -> None:
        """Write down what was kept of an unfinished replicate."""
        if self.phase is Phase.GIVEN_UP:
            return
        task = kept.condition, kept.replicate
        is_new = kept.name not in self.store.parts[task]
        self.store.add_part(*task, kept.name, kept.about, kept.data)
        self.begun[task] += is_new and self.study.counts_part(kept.name)

    def take_in(self, result: ChunkResult) -> None:
        """Write a ChunkResult down, and see whether that is enough.

        Raises TooManyFailures beyond the allowed number.
        """
        if self.phase is Phase.GIVEN_UP:
            return
        count, (condition, first) = len(result.rows), result.chunk[:2]
        if count:
            self.store.add(condition, first, result.rows, result.notes)
            for replicate in range(first, first + count) if self.begun else ():
                self.begun.pop((condition, replicate), None)
        self.computed += count
        self.schedule.give_back(result.chunk, count)
        self.failed += int(np.sum(self.study.has_failed(result.rows.__getitem__)))
        if self.failed > self.study.allowed:
            notes = self.store.notes
            raise TooManyFailures(
                f"{plural(self.failed, 'replicate')} failed, more than stop.failed allows; the "
                f"first: {describe_note(notes[0]) if notes else 'see the journal'}"
            )
        self.look_at_stages()

    def look_at_stages(self) -> None:
        """End the study where a finished stage is enough."""
        for stop in self.schedule.finished_stages():
            if not self.schedule.stages or self.is_enough(stop):
                self.phase = Phase.FINISHED
                self.schedule.end_at(stop)

    def interrupt(self) -> None:
        if self.is_running:
            self.phase = Phase.INTERRUPTED

    def give_up(self) -> None:
        self.phase = Phase.GIVEN_UP
