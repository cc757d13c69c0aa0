"""Rank 0's desk, where finished chunks are taken in and new ones handed out, and how others ask."""

import threading
import time

import attrs

from flocsim.ensembles.parallel.dealer import Dealer
from flocsim.ensembles.parallel.team import SLEEP, Team
from flocsim.ensembles.storage.row_store import RowStore
from flocsim.errors import FlocsimError
from flocsim.interruption import INTERRUPTION, stop_requested

MOST_NOTES = 1000
"""Notes on failed replicates that are kept."""


@attrs.frozen
class Done:
    """What came of a chunk: its first ``count`` replicates, as a record of the journal.

    ``start``: bytes of the record before the rows. ``notes``: what is known of failed ones.
    """

    chunk: object
    count: int
    record: bytes
    start: int
    failed: int = 0
    notes: tuple = ()


FAREWELL = 5.0
"""Seconds in which the other ranks leave by themselves, once the study is given up."""


class TooManyFailures(FlocsimError):
    """More replicates have failed than the config allows."""


@attrs.define(eq=False)
class Desk:
    """The state of a study while it runs. Every rank, this one too, calls `exchange`."""

    team: Team
    dealer: Dealer
    store: RowStore
    is_enough: object
    allowed: float
    report: object
    failed: int = 0
    computed: int = 0
    notes: list = attrs.Factory(list)
    halted: bool = False
    stopped: bool = False
    over: bool = False
    given_up: bool = False
    told: bool = False
    error: object = None
    working: set = attrs.Factory(set)
    waiting: list = attrs.Factory(list)
    dismissed: int = 0
    lock: object = attrs.Factory(threading.RLock)
    thread: object = None

    def open(self):
        """Begin to serve the other ranks, beside this one's own work where MPI has threads."""
        self.look_at_stages()
        if self.team.size > 1 and self.team.threads:
            self.thread = threading.Thread(target=self.serve_on, daemon=True)
            self.thread.start()

    def close(self):
        """Serve until all other ranks have been told to go."""
        while self.dismissed < self.team.size - 1:
            self.breathe()
        self.over = True
        if self.thread is not None:
            self.thread.join()

    def give_up(self):
        """Send all other ranks home, taking nothing in any more; whether they went in time."""
        self.given_up = self.halted = self.over = True
        if self.thread is not None:
            self.thread.join()
        until = time.monotonic() + FAREWELL
        while self.dismissed < self.team.size - 1 and time.monotonic() < until:
            if not self.serve():
                time.sleep(SLEEP)
        return self.dismissed == self.team.size - 1

    def exchange(self, done):
        """Hand in what this rank has done, None at first; its next Chunk, None at the end."""
        self.hand_in(0, done, stop_requested())
        while (chunk := self.next_chunk(0)) is None and not self.is_over:
            self.breathe()
        return chunk

    @property
    def is_over(self):
        """Whether nothing will be handed out any more."""
        return self.halted or self.dealer.left == 0

    def breathe(self):
        """Look at what others want, or let the thread do so."""
        if self.error is not None:
            raise self.error
        if self.thread is not None or not self.serve():
            time.sleep(SLEEP)

    def hand_in(self, rank, done, stop):
        """Take in what a rank has done."""
        with self.lock:
            if stop:
                self.halted = self.stopped = True
            self.working.discard(rank)
            if done is not None and not self.given_up:
                self.take_in(done)

    def next_chunk(self, rank):
        """A Chunk for a rank; None where there is none now."""
        with self.lock:
            chunk = None if self.halted else self.dealer.take()
            if chunk is not None:
                self.working.add(rank)
            return chunk

    def take_in(self, done):
        """Write a chunk down, and see whether that is enough."""
        if done.count:
            chunk = done.chunk
            offset = self.store.journal.append(done.record)
            self.store.add(
                chunk.condition, chunk.first, chunk.first + done.count, offset + done.start
            )
        self.computed += done.count
        self.dealer.give_back(done.chunk, done.count)
        self.count_failures(done)
        self.look_at_stages()
        self.report(self.dealer.left)

    def count_failures(self, done):
        """Keep the notes; TooManyFailures beyond the allowed number."""
        self.failed += done.failed
        self.notes += done.notes[: MOST_NOTES - len(self.notes)]
        if self.failed > self.allowed:
            raise TooManyFailures(
                f"{self.failed} replicates have failed, more than stop.failed allows; the first: "
                f"{describe_note(self.notes[0]) if self.notes else 'see the journal'}"
            )

    def look_at_stages(self):
        """End the study where a finished stage is enough."""
        for stop in self.dealer.finished_stages():
            if not self.dealer.stages or self.is_enough(stop):
                self.halted = True
                self.dealer.end_at(stop)

    def serve(self):
        """Answer the other ranks; whether anything has come."""
        before = len(self.waiting)
        for rank, (done, stop) in self.team.messages():
            self.waiting.append(rank)
            self.hand_in(rank, done, stop)
        busy = len(self.waiting) > before
        self.waiting = [rank for rank in self.waiting if not self.answer(rank)]
        if self.halted and not self.told:
            self.told = True
            for rank in self.working - {0}:
                self.team.send(rank, "halt")
        return busy

    def answer(self, rank):
        """Send a rank its next chunk, or home at the end; False where there is neither yet."""
        chunk = self.next_chunk(rank)
        if chunk is None and not self.is_over:
            return False
        self.team.send(rank, chunk)
        self.dismissed += chunk is None
        return True

    def serve_on(self):
        """Serve until all is done: the thread of rank 0."""
        try:
            while not self.over:
                if not self.serve():
                    time.sleep(SLEEP)
        except BaseException as error:
            self.error = error

    def is_halted(self):
        """Whether the replicate at hand is to be given up; serves where no thread does."""
        if self.error is not None:
            raise self.error
        if self.team.size > 1 and self.thread is None:
            self.serve()
        return self.halted or stop_requested()


class FarDesk:
    """The desk as the other ranks see it."""

    def __init__(self, team):
        """The desk of this team's rank 0."""
        self.team = team
        self.told = False

    def exchange(self, done):
        """Hand in what is done; the next Chunk, or None where there is none."""
        self.team.send(0, (done, stop_requested()))
        while (answer := self.team.receive(0, heed_signals=False)) == "halt":
            self.told = True
        self.told = self.told and answer is None
        return answer

    def is_halted(self):
        """Whether the replicate at hand is to be given up."""
        self.team.pump()
        inbox = self.team.inbox[0]
        while inbox and inbox[0] == "halt":
            inbox.popleft()
            self.told = True
        return self.told or stop_requested()


def describe_note(note):
    """A failed replicate for messages, with the words that run it again."""
    return (
        f"{note['why']} (flocsim trajectory CONFIG --scene "
        f"{note['type']},{note['vertices']},{note['delta']!r} --replicate {note['replicate']})"
    )


def signal_name():
    """The signal that stops this process, for messages."""
    return INTERRUPTION.name if stop_requested() else "a signal to another rank"
