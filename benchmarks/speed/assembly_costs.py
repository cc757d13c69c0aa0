"""What it costs many ranks to make the results file together: measured, and what is assumed.

Measured here, by the functions that do it: a rank's share (read from the journal, checked, written,
counted; files in the page cache), and all that rank 0 does alone for a given number of ranks, rows
and chunks (its processor's time): cutting, a pickled order for each rank, twice, unpickling and
adding up what comes back, tables and seal.

Assumed: `BANDWIDTHS` at which all ranks together read and write one file, on top of what they need
in the page cache; `OPENS` files that are opened in a second; a message's time. Every byte is read
once, written once, and read again by another rank, outcomes once more.
"""

import os
import pickle
import time

import attrs
import numpy as np

from benchmarks.faults.assembly import resumed, write_study
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.estimates.summary import Reader, results_of, sums_of, tables_of
from flocsim.ensembles.kind import ROW, Condition
from flocsim.ensembles.parallel.assembly import COUNTED_ROWS, Answer, Assembly, Share
from flocsim.ensembles.parallel.communicator import Communicator
from flocsim.ensembles.storage.identity import identity_of
from flocsim.ensembles.storage.row_store import RowStore
from flocsim.ensembles.study import Study
from flocsim.io.journal import MemoryJournal
from flocsim.io.results.layout import ROWS, RowFile, frame_of, new_row_file, plan_of

BANDWIDTHS = (5.0, 20.0, 100.0)
"""GB/s at which a file system serves all ranks that read or write parts of one file."""

OPENS = 20_000.0
"""Files that a file system opens in a second, for all ranks together."""

MESSAGE = 1e-5
"""Seconds that rank 0 is kept by sending or receiving a message, its pickling left out."""

ROWS_MEASURED = 400_000
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


class Pickled:
    """Another rank that answers at once; what is sent and received is pickled, as by MPI."""

    def __init__(self, size):
        self.rank, self.size, self.messages, self.waiting = 0, size, 0, {}

    def send(self, to, message):
        self.messages += 2
        pickle.dumps(message)
        if isinstance(message, Share):
            plan = message.place.plan
            blocks = range(*message.blocks)
            digests = {block: [bytes(32)] * len(plan.pieces_of(block)) for block in blocks}
            answer = Answer(digests, host=f"node{to // 64}")
        else:
            answer = Answer(sums=self.sums if message.counted != (0, 0) else {}, host="node")
        self.waiting[to] = pickle.dumps(answer)

    def receive(self, rank):
        return pickle.loads(self.waiting.pop(rank))


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
        path = self.folder / "sparse"
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_TRUNC)
        comm = Pickled(ranks)
        began = time.process_time()
        reader = Reader(store, (1, conditions, 1, per_condition))
        draft, comm.sums = made_up_results(reader)
        plan = plan_of(frame_of(draft), rows)
        file = RowFile(str(path), b"", plan, descriptor)
        rank_zero = RankZero(reader, file, comm)
        sums = rank_zero.count(rank_zero.write())
        file.complete(draft, rank_zero.digests)
        spent = time.process_time() - began
        os.close(descriptor)
        path.unlink()
        assert sums is not None
        # With its share a rank reads the rest of the chunks at its ends; what is written is read
        # again by another, and outcomes once more, by blocks, to be counted.
        writers = min(ranks, plan.blocks)
        counters = max(min(ranks, per_condition, rows // COUNTED_ROWS), 1)
        often = 1.0 + min(length * writers / rows, 1.0)
        blocks = conditions * (per_condition / counters / ROWS + 1.0)
        reread = 2 * counters * min(blocks, plan.blocks) * ROWS
        moved = ((often + (2.0 if ranks > 1 else 1.0)) * rows * ROW.itemsize + reread) / 1e9
        blocks = -(-plan.blocks // writers)
        others = often * min(blocks * ROWS, rows) / self.writing + rows / counters / self.counting
        opens = comm.messages / OPENS if ranks > 1 else 0.0
        return Parts(spent + MESSAGE * comm.messages, others, opens, moved)


class RankZero(Assembly):
    """Rank 0, whose own share of the work is counted elsewhere."""

    def write_here(self, blocks):
        for block in range(*blocks):
            self.digests[block] = [bytes(32)] * len(self.file.plan.pieces_of(block))

    def count_here(self, counted):
        self.codes_of(counted)
        return self.comm.sums

    def blocks_to_read(self):
        # Rank 0's own are read by one of the others' share in this.
        found = super().blocks_to_read()
        found[0] = ()
        return found


def made_up_results(reader):
    """(Results without values, the Sums that they are made from) of spheres."""
    from flocsim.io.results.schema import Results

    _, conditions, _, count = reader.shape
    sums = sums_of(Reader(reader.store, (1, conditions, 1, 0)).codes, conditions, 0, 0)
    results = Results(
        ("I",), np.arange(1, conditions + 1), np.zeros(1), None, count=count, **tables_of(sums)
    )
    return results, sums


def measure_assembly(folder):
    """The AssemblyCosts of a rank on this machine."""
    place = write_study(folder / "assembly", ROWS_MEASURED // 10)
    study = Study(load_config(place / "study.toml"))
    start = resumed(study, identity_of(study), place)
    writing, counting = [], []
    with start.resources:
        reader = Reader(start.store, study.shape)
        draft = results_of(study, study.config.replicates, sums_of(reader.codes, 10, 0, 0), {})
        with new_row_file(place / "made.h5", draft) as file:
            rank_zero = Assembly(reader, file, Communicator())
            for _ in range(3):
                began = time.perf_counter()
                rank_zero.write()
                between = time.perf_counter()
                rank_zero.count(together=True)
                writing.append(between - began)
                counting.append(time.perf_counter() - between)
            file.complete(draft, rank_zero.digests)
    return AssemblyCosts(ROWS_MEASURED / min(writing), ROWS_MEASURED / min(counting), folder)
