"""What every rank does: take a chunk, run its replicates, hand them in."""

import time
from collections.abc import Callable

import numpy as np

from flocsim.ensembles.chunks import Chunk, chunk_record, kept_record
from flocsim.ensembles.kind import StudyKind
from flocsim.ensembles.parallel.coordinator import Coordinator, RemoteCoordinator
from flocsim.ensembles.parallel.messages import ChunkResult, Going, Kept
from flocsim.ensembles.parallel.schedule import chunk_seconds

MOST_NOTES = 20
"""Notes on failed replicates that go with one chunk."""


def run_chunks(study: StudyKind, coordinator: Coordinator | RemoteCoordinator, key: str) -> None:
    """Run chunks until the coordinator has none left; ``key`` marks the records as the study's."""
    seconds = chunk_seconds(coordinator.comm.size)
    result = None
    while (chunk := coordinator.exchange(result)) is not None:
        result = run_chunk(study, chunk, coordinator.is_halted, seconds, key, coordinator.tell)


def run_chunk(
    study: StudyKind, chunk: Chunk, halted: Callable[[], bool], seconds: float, key: str,
    tell: Callable[[Kept | Going], object] = lambda message: None,
) -> ChunkResult:  # fmt: skip
    """Run a chunk until it is done, its time [s] is up or ``halted()``: a ChunkResult.

    ``tell`` takes what is kept of a replicate while it runs, and how far it is.
    """
    rows = np.zeros(chunk.stop - chunk.first, study.row)
    condition, place = study.conditions[chunk.condition], study.places[chunk.condition]
    notes: list[dict] = []
    count = 0
    until = time.monotonic() + seconds
    for replicate in range(chunk.first, chunk.stop):
        if halted() or (count and time.monotonic() > until):
            break

        def keep(description: dict, data: bytes, counts: bool, replicate: int = replicate) -> None:
            record = kept_record(condition, replicate, description, data, key)
            tell(Kept(chunk.condition, replicate, record, counts))

        row, note = study.run_task(
            place, replicate, halted, chunk.left, keep, lambda words: tell(Going(words))
        )
        if row is None:
            break
        rows[count] = tuple(row[name] for name in rows.dtype.fields or ())
        notes += [note] if note else []
        count += 1
    rows, notes = rows[:count], notes[:MOST_NOTES]
    record = chunk_record(condition, chunk.first, rows, key, notes)
    failed = int(np.sum(study.has_failed(rows.__getitem__)))
    return ChunkResult(chunk._replace(left=None), count, record, len(record) - rows.nbytes, failed,
                       tuple(notes))  # fmt: skip
