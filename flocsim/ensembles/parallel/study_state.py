"""What rank 0 knows of a running study: what is finished, what has failed, whether it is enough.

Nothing here sends a message or waits: the same calls give the same state.
"""

import enum
from collections import Counter
from collections.abc import Callable
from typing import Any

import attrs

from flocsim.ensembles.chunks import Chunk
from flocsim.ensembles.parallel.messages import ChunkResult, Kept
from flocsim.ensembles.parallel.schedule import Schedule
from flocsim.ensembles.storage.row_store import RowStore
from flocsim.errors import FlocsimError
from flocsim.io.journal.records import data_digest, record_at
from flocsim.io.results.run_words import describe_note

MOST_NOTES = 1000
"""Notes on failed replicates that are kept."""


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
    ``allowed``: how many may fail; ``failed``, ``notes``: how many have, and what is known of
    them; ``computed``: how many this run has taken in. ``pieces`` of a replicate are what progress
    counts, ``begun`` has how many are there of unfinished ones; ``left_of(records)``: where a
    replicate goes on of which these were kept.
    """

    schedule: Schedule
    store: RowStore
    is_enough: Callable[[int], bool]
    allowed: float
    failed: int = 0
    notes: list[dict] = attrs.Factory(list)
    computed: int = 0
    phase: Phase = Phase.RUNNING
    pieces: int = 1
    begun: Counter[tuple[int, int]] = attrs.Factory(Counter)
    left_of: Callable[[list], Any] = lambda records: None

    @property
    def missing(self) -> int:
        """How many pieces are."""
        return self.schedule.remaining * self.pieces - self.begun.total()

    @property
    def is_running(self) -> bool:
        return self.phase is Phase.RUNNING

    def next_chunk(self) -> Chunk | None:
        chunk = self.schedule.take() if self.is_running else None
        if chunk is None or not (records := self.store.parts.get(chunk[:2])):
            return chunk
        return chunk._replace(left=self.left_of(records))

    def keep(self, kept: Kept) -> None:
        """Write down what was kept of an unfinished replicate."""
        if self.phase is Phase.GIVEN_UP:
            return
        offset = self.store.journal.append(kept.record)
        task = kept.condition, kept.replicate
        self.store.parts[task].append(record_at(kept.record, offset))
        self.begun[task] += kept.counts

    def take_in(self, result: ChunkResult) -> None:
        """Write a ChunkResult down, and see whether that is enough.

        Raises TooManyFailures beyond the allowed number.
        """
        if self.phase is Phase.GIVEN_UP:
            return
        if result.count:
            condition, first = result.chunk[:2]
            offset = self.store.journal.append(result.record) + result.data_start
            digest = data_digest(result.record)
            self.store.add(condition, first, first + result.count, offset, digest)
            for replicate in range(first, first + result.count) if self.begun else ():
                self.begun.pop((condition, replicate), None)
        self.computed += result.count
        self.schedule.give_back(result.chunk, result.count)
        self.failed += result.failed
        self.notes += result.notes[: MOST_NOTES - len(self.notes)]
        if self.failed > self.allowed:
            raise TooManyFailures(
                f"{self.failed} replicate{'s' if self.failed > 1 else ''} failed, more than "
                "stop.failed allows; the first: "
                f"{describe_note(self.notes[0]) if self.notes else 'see the journal'}"
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
