"""What every rank does: take a chunk, run its replicates, hand them in."""

import time
from collections.abc import Callable

import numpy as np

from flocsim.ensembles.chunks import COLUMNS, ROW, Chunk, chunk_record
from flocsim.ensembles.collision.failures import FAILED, run_safely
from flocsim.ensembles.parallel.coordinator import Coordinator, RemoteCoordinator
from flocsim.ensembles.parallel.messages import ChunkResult
from flocsim.ensembles.parallel.schedule import chunk_seconds
from flocsim.ensembles.study import Study
from flocsim.io.results.schema import ROW_SIZE

MOST_NOTES = 20
"""Notes on failed replicates that go with one chunk."""


def run_chunks(study: Study, coordinator: Coordinator | RemoteCoordinator, key: str) -> None:
    """Run chunks until the coordinator has none left; ``key`` marks the records as the study's."""
    seconds = chunk_seconds(coordinator.comm.size)
    result = None
    while (chunk := coordinator.exchange(result)) is not None:
        result = run_chunk(study, chunk, coordinator.is_halted, seconds, key)


def run_chunk(
    study: Study, chunk: Chunk, halted: Callable[[], bool], seconds: float, key: str
) -> ChunkResult:
    """Run a chunk until it is done, its time [s] is up or ``halted()``: a ChunkResult."""
    rows = np.zeros(chunk.stop - chunk.first, ROW)
    place = study.places[chunk.condition]
    notes: list[dict] = []
    count = 0
    until = time.monotonic() + seconds
    for replicate in range(chunk.first, chunk.stop):
        if halted() or (count and time.monotonic() > until):
            break
        row, note = run_safely(study, place, replicate, halted)
        if row is None:
            break
        rows[count] = tuple(row[name] for name in COLUMNS)
        notes += [note] if note else []
        count += 1
    rows, notes = rows[:count], notes[:MOST_NOTES]
    record = chunk_record(study.conditions[chunk.condition], chunk.first, rows, key, notes)
    failed = int(np.sum(rows["outcome"] == FAILED))
    return ChunkResult(chunk, count, record, len(record) - count * ROW_SIZE, failed, tuple(notes))
