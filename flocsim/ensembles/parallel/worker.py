"""What every rank does: take a chunk, run its replicates, hand them in."""

import math
import time

import numpy as np

from flocsim.ensembles.chunks import ROW, chunk_record
from flocsim.ensembles.collision.failures import EXCEPTION, FAILURES, NOT_FINITE, failed_row
from flocsim.ensembles.collision.sampling import draws, orientations
from flocsim.ensembles.parallel.dealer import chunk_seconds
from flocsim.ensembles.parallel.desk import Done
from flocsim.io.results.schema import OUTCOMES, ROW_SIZE

FAILED = OUTCOMES.index("failed")
LONGEST_NOTE = 300
MOST_NOTES = 20
"""Notes that go with one chunk."""

ALWAYS_FINITE = ("angle_i", "angle_j", "d_c_last", "t_end")
"""Columns that are numbers in every row of a replicate that has not failed."""


def work(study, desk, identity):
    """Run chunks until the desk has none left."""
    places = study.places
    seconds = chunk_seconds(desk.team.size)
    done = None
    while (chunk := desk.exchange(done)) is not None:
        done = run_chunk(study, chunk, places, desk.is_halted, seconds, identity)


def run_chunk(study, chunk, places, halted, seconds, identity):
    """Run a chunk until it is done, its time is up or the desk is halted: a Done."""
    rows = np.zeros(chunk.stop - chunk.first, ROW)
    notes, count = [], 0
    until = time.monotonic() + seconds
    for replicate in range(chunk.first, chunk.stop):
        if halted() or (count and time.monotonic() > until):
            break
        row, note = run_safely(study, places[chunk.condition], replicate, halted)
        if row is None:
            break
        rows[count] = tuple(row[name] for name in ROW.names)
        notes += [note] if note else []
        count += 1
    failed = int(np.sum(rows["outcome"][:count] == FAILED))
    return packed(study, chunk, rows[:count], failed, notes[:MOST_NOTES], identity)


def packed(study, chunk, rows, failed, notes, identity):
    """The Done of finished rows."""
    condition = study.conditions[chunk.condition]
    record = chunk_record(condition, chunk.first, rows, identity, notes)
    return Done(chunk, len(rows), record, len(record) - len(rows) * ROW_SIZE, failed, tuple(notes))


def run_safely(study, place, replicate, halted=None):
    """(row, None) of one replicate, or (row, note) where it failed; row None where halted.

    An exception costs this one replicate, not the study: the note has what is needed to run it
    again. Running out of memory is nobody's fault but the machine's, and goes on.
    """
    condition, vertices, share = place
    try:
        row = study.run(condition, vertices, share, replicate, halted=halted)
    except MemoryError:
        raise
    except Exception as error:
        angles = orientations(draws(study.config.seed, replicate))
        why = f"{type(error).__name__}: {' '.join(str(error).split())}"[:LONGEST_NOTE]
        return failed_row(EXCEPTION, angles), make_note(study, place, replicate, why)
    if row is None:
        return None, None
    if row["outcome"] != FAILED and not is_finite(row):
        flocs = {name: row[name] for name in ("floc_i", "floc_j")}
        row = failed_row(NOT_FINITE, (row["angle_i"], row["angle_j"])) | flocs
    if row["outcome"] == FAILED:
        return row, make_note(study, place, replicate, FAILURES[row["failure"]])
    return row, None


def is_finite(row):
    """Whether a row holds numbers where there must be some."""
    return all(math.isfinite(row[name]) for name in ALWAYS_FINITE)


def make_note(study, place, replicate, why):
    """What is needed to run a replicate again, and why one would."""
    condition, vertices, share = place
    name = study.config.scene.conditions[condition][0]
    return {
        "type": name, "vertices": vertices, "delta": share, "replicate": replicate, "why": why,
    }  # fmt: skip
