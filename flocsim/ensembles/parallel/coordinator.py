"""What every rank does: take a chunk, run its replicates, hand them in; and how rank 0 answers the
others while it computes itself.

All get chunks from an object with `exchange` and `is_halted`: rank 0 from its Coordinator, the
others from a RemoteCoordinator, which sends messages to rank 0's.
"""

import threading
import time
from collections.abc import Callable
from typing import Any

import attrs
import numpy as np

from flocsim.ensembles.kind import Chunk, Overseer, StudyKind
from flocsim.ensembles.parallel.communicator import (
    SILENCE_LIMIT,
    SLEEP,
    ChunkResult,
    Communicator,
    Going,
    Halt,
    Kept,
    Request,
    Silence,
)
from flocsim.ensembles.parallel.schedule import Phase, StudyState, chunk_seconds
from flocsim.errors import FlocsimError
from flocsim.process import stop_requested

GOING_SECONDS = 1.0
"""Seconds between two messages of a rank that say how far it is."""

SIGNS = 6
"""Signs of life that a rank gives within the time after which it is given up."""

FAREWELL = 5.0
"""Seconds in which the other ranks leave by themselves, once the study is given up."""


@attrs.define(eq=False)
class Coordinator:
    """Rank 0's: takes in results and hands out chunks, its own and those of all other ranks.

    A thread serves the others where MPI has threads; elsewhere rank 0 does between two of its own
    replicates. ``report(missing, going)`` tells the user. Of the other ranks ``computing`` have a
    chunk and no Halt, ``waiting`` want a chunk, and ``silence`` has those that owe a message. Who
    is in neither of the last two has been dismissed.
    """

    comm: Communicator
    state: StudyState
    report: Callable[..., object]
    silence: Silence = attrs.field(init=False)
    computing: set[int] = attrs.Factory(set)
    waiting: list[int] = attrs.Factory(list)
    lock: Any = attrs.Factory(threading.RLock)
    thread: threading.Thread | None = None
    error: BaseException | None = None

    def __attrs_post_init__(self):
        self.silence = Silence(range(1, self.comm.size))

    @property
    def present(self) -> int:
        """Return how many of the other ranks have not been dismissed yet."""
        return len(self.silence.seconds) + len(self.waiting)

    def start(self) -> None:
        """Begin to serve the other ranks."""
        self.state.look_at_stages()
        if self.comm.size > 1 and self.comm.threads:
            self.thread = threading.Thread(target=self.serve_on, daemon=True)
            self.thread.start()

    def finish(self) -> None:
        """Serve until all other ranks have been dismissed."""
        while self.present:
            self.wait_a_little()
        if self.thread is not None:
            self.thread.join()

    def give_up(self) -> bool:
        """Dismiss all other ranks, taking nothing in any more; return True if they went in time."""
        self.state.give_up()
        if self.thread is not None:
            self.thread.join(FAREWELL)
            if self.thread.is_alive():
                return False
        until = time.monotonic() + FAREWELL
        while self.present and time.monotonic() < until:
            if not self.serve():
                time.sleep(SLEEP)
        return self.present == 0

    def exchange(self, result: ChunkResult | None) -> Chunk | None:
        """Hand in what rank 0 has done, None at first; its next Chunk, None at the end."""
        self.raise_error()
        self.take_in(result, stop_requested())
        while True:
            with self.lock:
                chunk = self.state.next_chunk()
            if chunk is not None or not self.state.is_running:
                return chunk
            self.wait_a_little()

    def is_halted(self) -> bool:
        """Return True if rank 0 is to give up the replicate at hand; serves where no thread does.

        An error is raised by the next `exchange`: here it would count as one of the replicate.
        """
        with self.lock:
            self.state.store.journal.sync_when_due()
        if self.comm.size > 1 and self.thread is None:
            self.serve()
        self.look()
        return self.error is not None or not self.state.is_running or stop_requested()

    def look(self):
        """Note a silent rank as the error; in the main thread, as the other may wait for it."""
        with self.lock:
            try:
                self.silence.look()
            except FlocsimError as error:
                self.error = self.error or error

    def raise_error(self):
        if self.error is not None:
            raise self.error

    def wait_a_little(self):
        """Sleep for a moment, or serve where no thread does; raise what has gone wrong."""
        self.look()
        self.raise_error()
        if self.thread is not None or not self.serve():
            time.sleep(SLEEP)

    def take_in(self, result: ChunkResult | None, interrupted: bool) -> None:
        """Take in what a rank has done, and whether a signal has come to it."""
        with self.lock:
            if interrupted:
                self.state.interrupt()
            if result is not None:
                self.state.take_in(result)
                self.report(self.state.missing)

    def tell(self, message: Kept | Going) -> None:
        """Take in what a rank says of the replicate that it is at."""
        with self.lock:
            if isinstance(message, Kept):
                self.state.keep(message)
            self.report(self.state.missing, message.words if isinstance(message, Going) else "")

    def serve_on(self):
        """Serve the other ranks until all are dismissed: the thread's work."""
        try:
            while self.present and self.state.phase is not Phase.GIVEN_UP:
                with self.lock:
                    self.state.store.journal.sync_when_due()
                if not self.serve():
                    time.sleep(SLEEP)
        except BaseException as error:
            self.error = error

    def serve(self):
        """Take in what has come from the other ranks and answer them; True if anything has."""
        messages = list(self.comm.messages())
        with self.lock:
            for rank, message in messages:
                self.silence.seconds[rank] = 0.0
                if isinstance(message, Kept | Going):
                    self.tell(message)
                    continue
                del self.silence.seconds[rank]
                self.computing.discard(rank)
                self.waiting.append(rank)
                self.take_in(message.result, message.interrupted)
            # Ranks that have waited longest get their chunks first.
            while self.waiting:
                chunk = self.state.next_chunk()
                if chunk is None and self.state.is_running:
                    break  # there may be more later
                rank = self.waiting.pop(0)
                if chunk is not None:
                    self.computing.add(rank)
                    self.silence.seconds[rank] = 0.0
                self.comm.send(rank, chunk)  # None: home
            # Once no more is needed, those at work are called back.
            while self.computing and not self.state.is_running:
                self.comm.send(self.computing.pop(), Halt())
        return bool(messages)


@attrs.define(eq=False)
class RemoteCoordinator:
    """The Coordinator as the other ranks see it."""

    comm: Communicator
    halted: bool = False
    said: float = attrs.Factory(time.monotonic)

    def tell(self, message: Kept | Going) -> None:
        """Say something of the replicate at hand; how far it is, now and then."""
        if isinstance(message, Going):
            if time.monotonic() - self.said < GOING_SECONDS:
                return
            self.said = time.monotonic()
        self.comm.send(0, message)

    def exchange(self, result: ChunkResult | None) -> Chunk | None:
        """Hand in what is done; the next Chunk, or None where there is none."""
        self.comm.send(0, Request(result, stop_requested()))
        answer: Chunk | Halt | None = Halt()
        while isinstance(answer, Halt):  # it may have crossed the request
            answer = self.comm.receive(0, heed_signals=False)
        return answer

    def is_halted(self) -> bool:
        """Return True if the replicate at hand is to be given up; says now and then that this rank
        is at work."""
        if time.monotonic() - self.said > SILENCE_LIMIT / SIGNS:
            self.tell(Going(""))
        self.comm.take_in()
        if self.comm.inbox[0]:  # while a rank works, rank 0 says nothing but Halt
            self.halted = True
        return self.halted or stop_requested()


MOST_NOTES = 20
"""Notes on failed replicates that go with one chunk."""


def run_chunks(study: StudyKind, coordinator: Coordinator | RemoteCoordinator) -> None:
    """Run chunks until the coordinator has none left."""
    seconds = chunk_seconds(coordinator.comm.size)
    result = None
    while (chunk := coordinator.exchange(result)) is not None:
        result = run_chunk(study, chunk, coordinator.is_halted, seconds, coordinator.tell)


def run_chunk(
    study: StudyKind, chunk: Chunk, halted: Callable[[], bool], seconds: float,
    tell: Callable[[Kept | Going], object] = lambda message: None,
) -> ChunkResult:  # fmt: skip
    """Run a chunk until it is done, its time [s] is up or ``halted()``: a ChunkResult.

    ``tell`` takes what is kept of a replicate while it runs, and how far it is.
    """
    condition = study.conditions[chunk.condition]
    parts = [np.zeros(0, study.row)]
    notes: list[dict] = []
    first, until = chunk.first, time.monotonic() + seconds
    while first < chunk.stop and not halted():

        def keep(name: str, about: dict, data: bytes, replicate: int = first) -> None:
            tell(Kept(chunk.condition, replicate, name, about, data))

        overseer = Overseer(halted, keep, lambda words: tell(Going(words)))
        rows, more = study.run_some(condition, first, chunk.stop, overseer, chunk.left)
        parts.append(rows)
        notes += more
        first += len(rows)
        if not len(rows) or time.monotonic() > until:
            break
    rows = np.concatenate(parts)
    return ChunkResult(chunk._replace(left=None), rows, tuple(notes[:MOST_NOTES]))
