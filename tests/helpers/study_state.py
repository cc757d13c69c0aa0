"""The state of a made-up study of one condition, and results of its chunks."""

import contextlib
import itertools
import shutil
import tempfile
import weakref
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from flocsim.ensembles import study
from flocsim.ensembles.kind import ROW, Condition
from flocsim.ensembles.parallel import coordinator
from flocsim.ensembles.parallel.communicator import ChunkResult
from flocsim.ensembles.parallel.schedule import Schedule, StudyState
from flocsim.ensembles.storage.row_store import RowStore
from flocsim.io.journal import Journal


@contextlib.contextmanager
def after_chunks(number, happen=StudyState.interrupt):
    """Let ``happen(state)`` once a run has taken in so many chunks, each of one replicate: a signal
    comes."""
    counts = itertools.count(1)

    def take_in(state, result, original=StudyState.take_in):
        original(state, result)
        if next(counts) == number:
            happen(state)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(coordinator, "chunk_seconds", lambda size: 1e-9)
        patch.setattr(study, "MOST_AT_A_TIME", 1)
        patch.setattr(StudyState, "take_in", take_in)
        yield


CONDITION = Condition("I", 1, 0.0)
NOTE = {"why": "stalled", "type": "I", "vertices": 1, "delta": 0.0, "replicate": 0}


def scratch_journal():
    """An empty journal in a folder that goes when the journal does."""
    folder = tempfile.mkdtemp()
    journal = Journal(Path(folder, "r.h5.journal"))
    weakref.finalize(journal, shutil.rmtree, folder, ignore_errors=True)
    weakref.finalize(journal, journal.lock.close)
    return journal


def make_state(borders=(4,), is_enough=lambda stop: False, allowed=10):
    """The state of a study of one condition on one rank, none of it done."""
    schedule = Schedule.of([[]], list(borders), 1)
    study = SimpleNamespace(
        allowed=allowed, pieces=1, left_of=lambda parts: None, counts_part=lambda name: False,
        has_failed=lambda column: column("outcome") == 6,
    )  # fmt: skip
    return StudyState(schedule, RowStore(scratch_journal(), (CONDITION,)), study, is_enough)


def result_of(chunk, count=None, failed=0):
    """The ChunkResult of a chunk, or of its first replicates; steps are the replicates' numbers."""
    count = chunk.stop - chunk.first if count is None else count
    rows = np.zeros(count, ROW)
    rows["steps"] = chunk.first + np.arange(count)
    rows["outcome"][:failed] = 6
    return ChunkResult(chunk, rows, (NOTE,) * failed)
