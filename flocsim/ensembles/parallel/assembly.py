"""From the journal to the results file: every rank writes its share of the rows, and counts.

Rank 0 begins the file and cuts it into shares; a rank gets, with its share, where the rows of it
lie, reads them from the journal, checks them and writes them to their places. What it sends back
is small: digests of what it has written, and counts. Rank 0 adds up, writes the tables and seals
the file. Whatever a rank could not do, having no such file, rank 0 does itself.
"""

import os
import platform
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from flocsim.ensembles.chunks import COLUMNS, ROW, Condition
from flocsim.ensembles.estimates.statistics import checked_codes, count
from flocsim.ensembles.estimates.summary import Reader, Sums, added, sums_of
from flocsim.ensembles.parallel.communicator import Communicator, StopRequested
from flocsim.ensembles.parallel.messages import ExitCode
from flocsim.ensembles.storage.row_store import RowStore, longest, near
from flocsim.ensembles.storage.shared_rows import OldColumns, ReadOnlyJournal, old_columns
from flocsim.errors import FlocsimError
from flocsim.interruption import INTERRUPTION, stop_requested
from flocsim.io.results.row_file import ROWS, Plan, RowFile, shared_row_file

COUNTED_ROWS = 524_288
"""Rows for whose sums a rank is asked, at least: an answer has as many numbers as many ranks'."""


@attrs.frozen
class Task:
    """What one rank is to do: blocks [first, stop) of the file, sums of replicates [first, stop).

    An empty range means nothing.
    """

    blocks: tuple[int, int]
    counted: tuple[int, int]


@attrs.frozen(eq=False)
class Share:
    """A Task for another rank, with all that it needs to know.

    ``shape``: types, vertices, delta, replicates; ``known``: place of a condition → where its rows
    lie, of those in the task; ``journal``: its path; ``old``: the older results file, if any;
    ``host``: rank 0's machine.
    """

    task: Task
    file: str
    token: bytes
    plan: Plan
    shape: tuple[int, ...]
    known: dict[int, np.ndarray]
    journal: str
    old: OldColumns | None
    host: str

    def carry_out(self, study: Any, comm: Communicator) -> "Done":
        """Do the task on another rank than 0; its `Done`, with the reason where it fails."""
        host = platform.node()
        try:
            with (
                ReadOnlyJournal(self.journal) as journal,
                shared_row_file(self.file, self.token, self.plan) as file,
            ):
                store = RowStore(journal, study.conditions)
                for place, entries in self.known.items():
                    store.entries[place], store.counts[place] = entries, len(entries)
                if self.old is not None:
                    store.old = self.old.opened(journal.resources)
                done = carry_out(self.task, Reader(store, self.shape), file, is_called(comm))
                if host != self.host:
                    file.sync()
        except (FlocsimError, OSError, ValueError, AssertionError) as error:
            return Done(failed=f"rank {comm.rank} on {host}: {error}", host=host)
        return attrs.evolve(done, host=host)


@attrs.frozen(eq=False)
class Check:
    """A request to read blocks that another rank has written: the wrong ones are answered."""

    file: str
    token: bytes
    plan: Plan
    digests: dict[int, list[bytes]]

    def carry_out(self, study: Any, comm: Communicator) -> list[int]:
        try:
            with shared_row_file(self.file, self.token, self.plan) as file:
                return [
                    block for block, found in self.digests.items()
                    if not file.check_block(block, found)
                ]  # fmt: skip
        except (FlocsimError, OSError):
            return list(self.digests)


@attrs.frozen(eq=False)
class Done:
    """What came of a Task: digests of each block, counts of each condition in it, and Sums.

    ``failed`` says why nothing did.
    """

    digests: dict[int, list[bytes]] = attrs.Factory(dict)
    counts: dict[int, Sums] = attrs.Factory(dict)
    sums: Sums = attrs.Factory(dict)
    failed: str = ""
    host: str = ""


def is_called(comm: Communicator) -> Callable[[], bool]:
    """Whether rank 0 wants this rank to drop its task: it sends nothing else meanwhile."""

    def called():
        comm.take_in()
        return bool(comm.inbox[0])

    return called


def assist(study: Any, comm: Communicator) -> ExitCode:
    """What every rank but 0 does while the results file is made; how the study has ended."""
    while not isinstance(order := comm.receive(0, heed_signals=False), ExitCode):
        comm.send(0, order.carry_out(study, comm))
    return order


def carry_out(task: Task, reader: Reader, file: RowFile, halted: Callable[[], bool]) -> Done:
    """Do a Task, a block at a time; StopRequested where ``halted()``."""
    done = Done()
    for block in range(*task.blocks):
        if halted():
            raise StopRequested(f"stopped by {INTERRUPTION.name}; go on with --resume")
        rows = block_rows(reader, block, done.counts)
        done.digests[block] = file.write_block(block, rows)
    if task.counted[0] < task.counted[1]:
        done = attrs.evolve(done, sums=sums_of(reader, *task.counted))
    return done


def block_rows(reader: Reader, block: int, counts: dict[int, Sums]) -> dict[str, np.ndarray]:
    """{column: values} of a block of the file; what is in it is added to ``counts``."""
    replicates = reader.shape[-1]
    start = block * ROWS
    stop = min(start + ROWS, replicates * len(reader.known))
    rows = {name: np.empty(stop - start, ROW[name]) for name in COLUMNS}
    for place, first, end in runs(start, stop, replicates):
        known = reader.known[place]
        for low, values in reader.store.rows(place, first, end, known):
            at = place * replicates + low - start
            for name in COLUMNS:
                rows[name][at : at + len(values[name])] = values[name]
        part = slice(place * replicates + first - start, place * replicates + end - start)
        codes = checked_codes(rows["outcome"][part], rows["inside"][part])
        counts[place] = added(counts.get(place, {}), count(*codes))
    return rows


def runs(start: int, stop: int, replicates: int) -> Iterator[tuple[int, int, int]]:
    """(place of a condition, first, stop of its replicates) of rows [start, stop) of the file."""
    while start < stop:
        place, first = divmod(start, replicates)
        end = min(replicates, first + stop - start)
        yield place, first, end
        start += end - first


def cut(rows: int, replicates: int, blocks: int, ranks: int) -> list[Task]:
    """A Task for every rank; in a long job most have no sums, and in a small one no blocks."""
    writing, counting = min(ranks, blocks), min(ranks, replicates, max(rows // COUNTED_ROWS, 1))
    tasks = []
    for rank in range(ranks):
        back = ranks - 1 - rank
        tasks.append(Task(share_of(blocks, rank, writing), share_of(replicates, back, counting)))
    return tasks


def share_of(count, number, of):
    """The ``number``-th of so many equal parts of 0, 1, …, ``count`` − 1; nothing beyond them."""
    return (count * number // of, count * (number + 1) // of) if number < of else (0, 0)


def known_in(task: Task, reader: Reader, lengths: Sequence[int]) -> dict[int, np.ndarray]:
    """Where the rows lie that a Task needs, by condition; ``lengths``: of the longest chunks."""
    replicates = reader.shape[-1]
    total = replicates * len(reader.known)
    first, stop = (min(block * ROWS, total) for block in task.blocks)
    wanted = {place: (low, high) for place, low, high in runs(first, stop, replicates)}
    if task.counted[0] < task.counted[1]:
        for place in range(len(reader.known)):
            low, high = wanted.get(place, task.counted)
            wanted[place] = min(low, task.counted[0]), max(high, task.counted[1])
    return {
        place: near(reader.known[place], *each, lengths[place]) for place, each in wanted.items()
    }


def assemble(
    reader: Reader, file: RowFile, comm: Communicator, conditions: Sequence[Condition],
    warn: Callable[[str], object] = lambda line: None,
) -> tuple[Sums, dict[int, list[bytes]]]:  # fmt: skip
    """Write all rows into a file, with the other ranks: (Sums of the study, digests by block).

    ``warn`` is told, once, where rank 0 had to do another's work. FileError as rank 0 meets it.
    """
    store, replicates = reader.store, reader.shape[-1]
    old = old_columns(store.old) if store.old is not None else None
    alone = comm.size == 1 or (store.old is not None and old is None)
    tasks = cut(file.plan.rows, replicates, file.plan.blocks, 1 if alone else comm.size)
    asked, lengths = [], [longest(known) for known in reader.known]
    for rank, task in enumerate(tasks):
        if rank and task != Task((0, 0), (0, 0)):
            asked.append(rank)
            known = known_in(task, reader, lengths)
            comm.send(rank, Share(
                task, file.path, file.token, file.plan, reader.shape, known,
                os.fspath(Path(store.journal.path).resolve()), old, platform.node(),
            ))  # fmt: skip
    answers = {0: carry_out(tasks[0], reader, file, stop_requested)}
    for rank in asked:
        answers[rank] = comm.receive(rank)
    failed = [rank for rank in asked if answers[rank].failed]
    if failed:
        warn(
            f"{len(failed)} of {comm.size} ranks could not write their share of the results, rank "
            f"0 does it for them; {answers[failed[0]].failed}"
        )
    elif len({platform.node(), *(answers[rank].host for rank in asked)}) > 1:
        failed = not_as_written(answers, asked, file, comm)
    for rank in failed:
        answers[rank] = carry_out(tasks[rank], reader, file, stop_requested)
    return merged(list(answers.values()), conditions, reader.shape)


def not_as_written(answers, asked, file, comm):
    """The ranks of whose blocks others see something else than was written.

    Machines that share a file system do not always share what they keep of it; nothing is to be
    believed that was not seen from elsewhere, as the journal goes once the file is whole.
    """
    writers = [rank for rank in asked if answers[rank].digests]
    readers = writers[len(writers) // 2 :] + writers[: len(writers) // 2]
    for reader, writer in zip(readers, writers, strict=True):
        digests = answers[writer].digests
        comm.send(reader, Check(file.path, file.token, file.plan, digests))
    wrong = [comm.receive(reader) for reader in readers]
    return [writer for writer, blocks in zip(writers, wrong, strict=True) if blocks]


def merged(answers, conditions, shape):
    """(Sums, digests by block) of all tasks; FlocsimError where written and counted differ."""
    sums: Sums = {}
    digests: dict[int, list[bytes]] = {}
    counts: dict[int, Sums] = {}
    for done in answers:
        digests |= done.digests
        if done.sums:
            sums = added(sums, done.sums)
        for place, each in done.counts.items():
            counts[place] = added(counts.get(place, {}), each)
    for place, condition in enumerate(conditions):
        at = np.unravel_index(place, shape[:3])
        for name, value in counts[place].items():
            if not np.array_equal(sums[name][at], value):
                raise FlocsimError(
                    f"{name} of {condition} was found to be {sums[name][at]} and {value}: the "
                    "journal is not read alike everywhere; go on with --resume"
                )
    return sums, digests
