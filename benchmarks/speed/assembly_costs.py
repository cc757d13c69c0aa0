"""What it costs many ranks to make the results file together: measured, and what is assumed.

Measured here, by the functions that do it: a rank's share (read from the journal, checked, written,
counted; files in the page cache), and all that rank 0 does alone for a given number of ranks, rows
and chunks: cutting, pickling a share for each rank, unpickling and adding up what comes back,
tables and seal. Assumed: `BANDWIDTHS` at which all ranks together read and write one file, on top
of what they need in the page cache; `OPENS` files that are opened in a second; a message's time.
Every byte is read once, written once, and read again by another rank.
"""

import os
import pickle
import time

import attrs
import numpy as np

from benchmarks.faults.assembly import write_study
from flocsim.ensembles.chunks import Condition
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.estimates.summary import Reader, sums_of
from flocsim.ensembles.parallel.assembly import (
    Done,
    Share,
    Task,
    carry_out,
    cut,
    known_in,
    merged,
)
from flocsim.ensembles.runner import results_of
from flocsim.ensembles.storage.identity import identity_of
from flocsim.ensembles.storage.resume import RESUME, begin
from flocsim.ensembles.storage.row_store import RowStore, longest
from flocsim.ensembles.study import Study
from flocsim.io.journal.journal import MemoryJournal
from flocsim.io.results.layout import frame_of
from flocsim.io.results.row_file import RowFile, new_row_file, plan_of
from flocsim.io.results.schema import ROW_SIZE

BANDWIDTHS = (5.0, 20.0, 100.0)
"""GB/s at which a file system serves all ranks that read or write parts of one file."""

OPENS = 20_000.0
"""Files that a file system opens in a second, for all ranks together."""

MESSAGE = 1e-5
"""Seconds that rank 0 is kept by sending or receiving a message, its pickling left out."""

ROWS = 400_000
"""Rows on which a rank's speed is measured."""


@attrs.frozen
class Parts:
    """Seconds of making a file: what rank 0 does alone, what a rank does, what all wait for;
    ``moved``: gigabytes read and written."""

    rank_zero: float
    others: float
    opens: float
    moved: float

    def total(self, bandwidth):
        """Seconds at a bandwidth [GB/s]."""
        return self.rank_zero + self.others + self.opens + self.moved / bandwidth


@attrs.define
class AssemblyCosts:
    """``writing``, ``counting``: rows per second of a rank; ``folder``: to try things in."""

    writing: float
    counting: float
    folder: object

    def parts(self, ranks, conditions, per_condition, chunks):
        """The Parts of a study's results file."""
        rows = conditions * per_condition
        names = tuple(Condition("I", number, 0.0) for number in range(conditions))
        store = RowStore(MemoryJournal(), names)
        length = max(rows // max(chunks, 1), 1)
        for place in range(conditions):
            starts = np.arange(0, per_condition, length)
            found = np.zeros(len(starts), store.entries[place].dtype)
            found["first"], found["stop"] = starts, np.minimum(starts + length, per_condition)
            store.entries[place], store.counts[place] = found, len(found)
        shape = (1, conditions, 1, per_condition)
        began = time.process_time()
        reader = Reader(store, shape)
        draft = made_up_results(shape)
        plan = plan_of(frame_of(draft), rows)
        tasks = cut(rows, per_condition, plan.blocks, ranks)
        asked = [task for task in tasks if task != Task((0, 0), (0, 0))]
        lengths = [longest(known) for known in reader.known]
        for task in asked:
            known = known_in(task, reader, lengths)
            pickle.dumps(Share(task, "file", b"", plan, shape, known, "journal", None, "host"))
        spent = time.process_time() - began
        sums = sums_of(Reader(RowStore(MemoryJournal(), names), (1, conditions, 1, 0)), 0, 0)
        answers = [pickle.dumps(answer_to(task, plan, sums, per_condition)) for task in asked]
        checks = sum(task.blocks[0] < task.blocks[1] for task in asked)
        began = time.process_time()
        merge = [pickle.loads(answer) for answer in answers]
        found, digests = merged(merge, (), shape)
        del merge
        path = self.folder / "sparse"
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_TRUNC)
        RowFile(str(path), b"", plan, descriptor).complete(draft, digests)
        os.fsync(descriptor)
        spent += time.process_time() - began
        os.close(descriptor)
        path.unlink()
        messages = 2 * len(asked) + 2 * checks
        # With its share a rank reads the rest of the chunks at its ends.
        written = max(np.diff(task.blocks)[0] for task in tasks) * rows / plan.blocks
        counted = max(np.diff(task.counted)[0] for task in tasks) * conditions
        often = 1.0 + min(length * min(ranks, plan.blocks) / rows, 1.0)
        moved = (often + 2.0) * rows * ROW_SIZE / 1e9
        others = often * written / self.writing + counted / self.counting
        opens = (2 * len(asked) + checks) / OPENS if ranks > 1 else 0.0
        return Parts(spent + MESSAGE * messages, others, opens, moved)


def answer_to(task, plan, sums, per_condition):
    """What a rank would send back."""
    digests = {block: [bytes(32)] * len(plan.pieces_of(block)) for block in range(*task.blocks)}
    counted = sums if task.counted[0] < task.counted[1] else {}
    return Done(digests=digests, counts={}, sums=counted)


def made_up_results(shape):
    """Results of spheres' shape (1, N, 1, replicates), without values."""
    from flocsim.ensembles.estimates.summary import tables_of
    from flocsim.io.results.schema import Results

    *outer, count = shape
    names = tuple(Condition("I", number, 0.0) for number in range(outer[1]))
    reader = Reader(RowStore(MemoryJournal(), names), (*outer, 0))
    probabilities, pooled, differences = tables_of(sums_of(reader, 0, 0))
    return Results(
        ("I",), np.arange(1, outer[1] + 1), np.zeros(1), None, probabilities,
        pooled=pooled, differences=differences, count=count,
    )  # fmt: skip


def measure_assembly(folder):
    """The AssemblyCosts of a rank on this machine."""
    place = write_study(folder / "assembly", ROWS // 10)
    study = Study(load_config(place / "study.toml"))
    start = begin(study, identity_of(study), place / "study.h5", RESUME)
    with start.resources:
        reader = Reader(start.store, study.shape)
        count = study.config.replicates
        draft = results_of(study, count, sums_of(reader, 0, 0), {})
        with new_row_file(place / "made.h5", draft) as file:
            seconds = []
            blocks, nothing = (0, file.plan.blocks), (0, 0)
            for task in (Task(blocks, nothing), Task(nothing, (0, count))) * 2:
                began = time.perf_counter()
                done = carry_out(task, reader, file, lambda: False)
                seconds.append(time.perf_counter() - began)
                if done.digests:
                    digests = done.digests
            file.complete(draft, digests)
    return AssemblyCosts(ROWS / min(seconds[0::2]), ROWS / min(seconds[1::2]), folder)
