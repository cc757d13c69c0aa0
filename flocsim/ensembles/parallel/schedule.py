"""The order in which the replicates of a study are run, a stage after the other.

Guided self-scheduling: a chunk is a share of what is left, so that the last ones are small, and a
rank gives back what it has not done when its time for the chunk is up, since replicates cost
1 to 1000 times as much as each other.
"""

from collections.abc import Iterator, Sequence

import attrs

from flocsim.ensembles.chunks import MOST_ROWS, Chunk, Interval, missing, total

SHORTEST_SECONDS = 0.25
"""Least time for a chunk [s]: asking costs about 1 ms."""

SECONDS_PER_RANK = 1e-3
"""Time for a chunk per rank [s]: keeps rank 0 below some thousand answers a second."""

SHARE = 3
"""A chunk is no more than what is left over so many chunks per rank."""


def chunk_seconds(size: int) -> float:
    """How long a chunk may take [s] on one of ``size`` ranks."""
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
        """The Schedule of what is missing.

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
        """The next Chunk, None where all is handed out."""
        stage = next((stage for stage in self.stages if stage.todo), None)
        if stage is None:
            return None
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
