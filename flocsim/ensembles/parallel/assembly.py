"""From the journal to the results file: every rank writes its share of the rows, and counts.

Rank 0 begins the file and cuts it into shares. First a rank gets, with its share, where the rows of
it lie, reads them from the journal, checks them and writes them to their places; it answers with
the digests of what it has written. Then some ranks read outcomes again, from the new file, hold
them against these digests and count them. Rank 0 adds up, writes the tables and seals the file.
Whatever a rank could not do, having no such file, rank 0 does itself.
"""

import os
import platform
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from flocsim.ensembles.estimates.statistics import COUNTED
from flocsim.ensembles.estimates.summary import Reader, Sums, added, sums_of
from flocsim.ensembles.kind import COLUMNS, ROW, Interval
from flocsim.ensembles.parallel.communicator import Communicator, ExitCode, StopRequested
from flocsim.ensembles.storage import row_store
from flocsim.errors import FileError, FlocsimError
from flocsim.io.results.layout import ROWS, Plan, RowFile, shared_row_file
from flocsim.process import INTERRUPTION, stop_requested

COUNTED_ROWS = 524_288
"""Rows that a rank counts, at least: an answer has as many numbers as many ranks'."""

Digests = dict[int, list[bytes]]
"""Of blocks by their numbers, those of all pieces in the order of Plan.pieces_of."""


@attrs.frozen(eq=False)
class Place:
    """Where the unfinished file lies, ``host``: as rank 0's machine sees it; ``shape``: types,
    vertices, delta, replicates, which are points of so many ``scrambles``."""

    file: str
    token: bytes
    plan: Plan
    shape: tuple[int, ...]
    host: str
    scrambles: int = 0

    def opened(self):
        return shared_row_file(self.file, self.token, self.plan)


@attrs.frozen(eq=False)
class Answer:
    """What came of an order: digests of written blocks, or Sums; the ``wrong`` blocks that were
    read. ``failed`` says why nothing did."""

    digests: Digests = attrs.Factory(dict)
    sums: Sums = attrs.Factory(dict)
    wrong: tuple[int, ...] = ()
    failed: str = ""
    host: str = ""


@attrs.frozen(eq=False)
class Share:
    """The order to write blocks [first, stop).

    ``known``: place of a condition → where its rows lie, of those in the blocks; ``journal``: its
    path; ``old``: the older results file, if any.
    """

    place: Place
    blocks: Interval
    known: dict[int, np.ndarray]
    journal: str
    old: row_store.OldColumns | None

    def work(self, study: Any, comm: Communicator) -> Answer:
        with row_store.ReadOnlyJournal(self.journal) as journal, self.place.opened() as file:
            store = row_store.RowStore(journal, study.conditions)
            for place, entries in self.known.items():
                store.entries[place], store.counts[place] = entries, len(entries)
            if self.old is not None:
                store.old = self.old.opened(journal.resources)
            reader = Reader(store, self.place.shape)
            digests = write_blocks(self.blocks, reader, file, is_called(comm))
            if platform.node() != self.place.host:
                file.sync()
        return Answer(digests)


@attrs.frozen(eq=False)
class Review:
    """The order to read what others have written: whole blocks, of which ``digests`` are given, and
    outcomes of replicates [first, stop) of all conditions, to be counted.

    ``codes``: block → digests of its COUNTED.
    """

    place: Place
    digests: Digests
    counted: Interval
    codes: Digests

    def work(self, study: Any, comm: Communicator) -> Answer:
        with self.place.opened() as file:
            wrong = wrong_blocks(file, self.digests)
            sums: Sums = {}
            if self.counted[0] < self.counted[1]:
                sums = counted_in(
                    file, self.place.shape, self.counted, self.codes, self.place.scrambles
                )
        return Answer(sums=sums, wrong=tuple(wrong))


def wrong_blocks(file: RowFile, digests: Digests) -> list[int]:
    """The blocks that do not stand in a file as they were written."""
    return [block for block, found in digests.items() if not file.is_whole(block, found)]


def is_called(comm: Communicator) -> Callable[[], bool]:
    """Whether rank 0 wants this rank to drop its share: it sends nothing else meanwhile."""

    def called():
        comm.take_in()
        return bool(comm.inbox[0])

    return called


def assist(study: Any, comm: Communicator) -> ExitCode:
    """What every rank but 0 does while the results file is made; how the study has ended."""
    host = platform.node()
    while not isinstance(order := comm.receive(0, heed_signals=False), ExitCode):
        try:
            answer = attrs.evolve(order.work(study, comm), host=host)
        except (FlocsimError, OSError, ValueError, AssertionError) as error:
            answer = Answer(failed=f"rank {comm.rank} on {host}: {error}", host=host)
        comm.send(0, answer)
    return order


def write_blocks(
    blocks: Interval, reader: Reader, file: RowFile, halted: Callable[[], bool]
) -> Digests:
    """Write blocks of the file; StopRequested where ``halted()``."""
    digests = {}
    for block in range(*blocks):
        if halted():
            raise StopRequested(f"stopped by {INTERRUPTION.name}")
        digests[block] = file.write_block(block, block_rows(reader, block))
    return digests


def block_rows(reader: Reader, block: int) -> dict[str, np.ndarray]:
    """{column: values} of a block of the file."""
    replicates = reader.shape[-1]
    start = block * ROWS
    stop = min(start + ROWS, replicates * len(reader.known))
    rows = {name: np.empty(stop - start, ROW[name]) for name in COLUMNS}
    for place, first, end in runs(start, stop, replicates):
        for low, values in reader.store.rows(place, first, end, reader.known[place]):
            at = place * replicates + low - start
            for name in COLUMNS:
                rows[name][at : at + len(values[name])] = values[name]
    return rows


def runs(start: int, stop: int, replicates: int) -> Iterator[tuple[int, int, int]]:
    """(place of a condition, first, stop of its replicates) of rows [start, stop) of the file."""
    while start < stop:
        place, first = divmod(start, replicates)
        end = min(replicates, first + stop - start)
        yield place, first, end
        start += end - first


def counted_in(
    file: RowFile, shape: Sequence[int], counted: Interval, codes: Digests, scrambles: int
) -> Sums:
    """Sums of replicates, as they stand in the file; FileError where a digest is not right."""
    replicates, conditions = shape[-1], int(np.prod(shape[:3]))
    whole: set[int] = set()

    def read(first: int, stop: int) -> tuple[np.ndarray, ...]:
        for block in blocks_of((first, stop), replicates, conditions):
            if block not in whole and not file.is_whole(block, codes[block], COUNTED):
                raise FileError(f"{file.path} does not contain what was written to it")
            whole.add(block)
        starts = range(first, first + conditions * replicates, replicates)
        columns = (
            np.stack([file.values(name, start, stop - first) for start in starts])
            for name in COUNTED
        )
        return tuple(column.reshape(*shape[:3], stop - first) for column in columns)

    return sums_of(read, conditions, *counted, scrambles)


def blocks_of(counted: Interval, replicates: int, conditions: int) -> list[int]:
    """The blocks in which replicates [first, stop) of all conditions lie."""
    first, stop = counted
    found = set()
    for start in range(0, conditions * replicates, replicates):
        found |= set(range((start + first) // ROWS, (start + stop - 1) // ROWS + 1))
    return sorted(found)


def parts_of(count: int, parts: int) -> list[Interval]:
    """So many equal parts of 0, 1, …, ``count`` − 1, none of them empty."""
    ends = [count * number // parts for number in range(parts + 1)]
    return list(pairwise(ends))


def known_in(blocks: Interval, reader: Reader, lengths: Sequence[int]) -> dict[int, np.ndarray]:
    """Where the rows of blocks lie, by condition; ``lengths``: of the longest chunks."""
    replicates = reader.shape[-1]
    total = replicates * len(reader.known)
    start, stop = (min(block * ROWS, total) for block in blocks)
    return {
        place: row_store.near(reader.known[place], first, end, lengths[place])
        for place, first, end in runs(start, stop, replicates)
    }


@attrs.define(eq=False)
class Assembly:
    """Rank 0's side. ``alone``: the others cannot read an older file that is not laid out plainly.

    ``warn`` is told, once, where rank 0 had to do others' work.
    """

    reader: Reader
    file: RowFile
    comm: Communicator
    warn: Callable[[str], object] = lambda line: None
    place: Place = attrs.field(init=False)
    digests: Digests = attrs.Factory(dict)
    hosts: set[str] = attrs.Factory(lambda: {platform.node()})

    def __attrs_post_init__(self):
        file, host = self.file, platform.node()
        self.place = Place(
            file.path, file.token, file.plan, self.reader.shape, host, self.reader.scrambles
        )

    def ask(self, orders: dict[int, Share | Review], own: Callable[[], Any]) -> dict[int, Answer]:
        """Send orders to ranks, do one's ``own`` part, and wait for the answers."""
        for rank, order in orders.items():
            self.comm.send(rank, order)
        own()
        answers = {rank: self.comm.receive(rank) for rank in orders}
        self.hosts |= {answer.host for answer in answers.values()}
        return answers

    def write(self) -> bool:
        """Have all rows written; False where some ranks were of no use."""
        store = self.reader.store
        old = row_store.old_columns(store.old) if store.old is not None else None
        alone = store.old is not None and old is None
        blocks = self.file.plan.blocks
        parts = parts_of(blocks, max(min(1 if alone else self.comm.size, blocks), 1))
        lengths = [row_store.longest(known) for known in self.reader.known]
        journal = os.fspath(Path(store.journal.path).resolve())
        orders: dict[int, Share | Review] = {
            rank: Share(self.place, part, known_in(part, self.reader, lengths), journal, old)
            for rank, part in enumerate(parts)
            if rank
        }
        answers = self.ask(orders, lambda: self.write_here(parts[0]))
        failed = [rank for rank, answer in answers.items() if answer.failed]
        for answer in answers.values():
            self.digests |= answer.digests
        if failed:
            self.warn(
                f"{len(failed)} of {self.comm.size} ranks could not write their share of the "
                f"results, so rank 0 writes it; {answers[failed[0]].failed}"
            )
        for rank in failed:
            self.write_here(parts[rank])
        return not (failed or alone)

    def write_here(self, blocks: Interval) -> None:
        self.digests |= write_blocks(blocks, self.reader, self.file, stop_requested)

    def count(self, together: bool) -> Sums:
        """Have all replicates counted, from what was written, ``together`` with the others.

        Machines that share a file system do not always share what they keep of it: where ranks
        are on several, each block is read again by another rank, as the journal goes once the file
        is whole, and what is not as it was written is written again.
        """
        replicates = self.reader.shape[-1]
        rows, ranks = self.file.plan.rows, self.comm.size if together else 1
        parts = parts_of(replicates, min(ranks, replicates, max(rows // COUNTED_ROWS, 1)))
        orders: dict[int, Share | Review] = {}
        reread = self.blocks_to_read() if len(self.hosts) > 1 and together else {}
        for rank in range(1, ranks):
            part = parts[rank] if rank < len(parts) else (0, 0)
            digests = self.written(reread.get(rank, ()))
            if digests or part != (0, 0):
                codes = self.codes_of(part) if part != (0, 0) else {}
                orders[rank] = Review(self.place, digests, part, codes)
        sums: list[Sums] = []
        wrong: set[int] = set()

        def own() -> None:
            if reread:
                with self.place.opened() as seen:
                    wrong.update(wrong_blocks(seen, self.written(reread[0])))
            sums.append(self.count_here(parts[0]))

        answers = self.ask(orders, own)
        for rank, answer in answers.items():
            wrong.update(reread.get(rank, ()) if answer.failed else answer.wrong)
        for block in sorted(wrong):
            self.write_here((block, block + 1))
        for rank, answer in answers.items():
            if answer.sums:
                sums.append(answer.sums)
            elif rank < len(parts):
                sums.append(self.count_here(parts[rank]))
        total: Sums = {}
        for each in sums:
            total = added(total, each)
        return total

    def written(self, blocks: Iterable[int]) -> Digests:
        """The digests of some blocks."""
        return {block: self.digests[block] for block in blocks}

    def blocks_to_read(self):
        """{rank: blocks to read}, none of which it has written itself; from elsewhere, if it can
        be. What rank 0 has written is on its way first."""
        self.file.sync()
        blocks = self.file.plan.blocks
        parts = parts_of(blocks, min(self.comm.size, blocks))
        count = len(parts)
        return {rank: range(*parts[(rank + max(count // 2, 1)) % count]) for rank in range(count)}

    def codes_of(self, counted: Interval) -> Digests:
        columns = list(self.file.plan.columns)
        wanted = [columns.index(name) for name in COUNTED]
        *outer, replicates = self.reader.shape
        blocks = blocks_of(counted, replicates, int(np.prod(outer)))
        return {block: [self.digests[block][column] for column in wanted] for block in blocks}

    def count_here(self, counted: Interval) -> Sums:
        def count() -> Sums:
            codes, reader = self.codes_of(counted), self.reader
            return counted_in(self.file, reader.shape, counted, codes, reader.scrambles)

        try:
            return count()
        except FileError:
            # Seen from here, others have not written what they say: all is written here.
            self.write_here((0, self.file.plan.blocks))
            return count()


def assemble(
    reader: Reader, file: RowFile, comm: Communicator, warn: Callable[[str], object]
) -> tuple[Sums, Digests]:
    """Write all rows into a file, with the other ranks: (Sums of the study, digests by block).

    FileError as rank 0 meets it; StopRequested where a signal comes.
    """
    assembly = Assembly(reader, file, comm, warn)
    sums = assembly.count(assembly.write())
    return sums, assembly.digests
