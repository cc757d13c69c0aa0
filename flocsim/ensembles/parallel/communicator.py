"""The ranks of a job behind one interface (`processes` has those that there are), what they say to
each other while a study runs, and their signs of life.

All ranks talk to rank 0 only. Nobody waits inside a library: a rank that waits looks for a message,
then sleeps a little, so that it takes no processor from those who compute, and hears signals.

rank 0 → another rank         the flocs and the Facts of its study (or ExitCode, wherever it fails)
every other rank → rank 0     Request, again and again: a chunk's result, and a wish for another
rank 0 → another rank         how many replicates are to be run, and the key of the study's identity
                              for their records, once (or ExitCode, where the study cannot begin)
                              a Chunk in answer to a Request, None where there is no more
                              Halt, while it works, when its chunk is of no use any more
                              ExitCode, after the last answer, when all is written
every other rank → rank 0     Kept and Going, while it works, where replicates take long

A rank that is not heard of for long ends the job, instead of being waited for. Every rank gives
rank 0 a sign now and then, and rank 0 gives one to each of them; what is missing is a rank that is
stopped, or whose machine is gone. A thread does both, so that a rank that is busy, with a long
replicate or with compiling, is heard of. Where MPI allows no thread beside the main one, the main
one does it whenever it looks for messages, and silence may last longer.
"""

import collections
import os
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any

import attrs

from flocsim.errors import FlocsimError
from flocsim.io.terminal import tell
from flocsim.process import INTERRUPTION, STOPPED, stop_requested

if TYPE_CHECKING:
    from flocsim.ensembles.kind import Chunk

SLEEP = 5e-4
"""Seconds between two looks for a message."""

SECONDS = 300.0
"""Seconds of silence after which a rank is taken for lost, unless the user gives another time."""

SIGNS = 6
"""Signs that a rank gives in that time."""

LONGEST_INTERVAL = 10.0
"""Seconds between two signs at most."""

WITHOUT_THREADS = 4.0
"""How many times as long silence may last where the main thread gives the signs: it compiles."""

FIRST_SIGN = 60.0
"""Seconds more that a rank has before its first sign: Python and its libraries have to load."""

TURN = 2.0
"""Seconds in which one rank after the other speaks up, where rank 0 is lost and cannot."""


class StopRequested(FlocsimError):
    """A signal has come while this rank waited for the others."""

    exit_code = 75


@attrs.frozen
class ChunkResult:
    """What came of a chunk: the ``rows`` of its first replicates; how many have ``failed``, and
    ``notes`` on them."""

    chunk: "Chunk"
    rows: Any
    failed: int = 0
    notes: tuple[dict, ...] = ()


@attrs.frozen
class Kept:
    """A part of an unfinished replicate of the condition at a place, which is to be saved."""

    condition: int
    replicate: int
    name: str
    about: dict
    data: bytes


@attrs.frozen
class Going:
    """How far a rank's replicate is, in words."""

    words: str


@attrs.frozen
class Request:
    """A rank has finished its chunk (``result`` None: has had none yet) and asks for another.

    ``interrupted``: a signal has asked it to stop.
    """

    result: ChunkResult | None
    interrupted: bool


@attrs.frozen
class Halt:
    """Give up the replicate at hand, and hand in what is finished."""


@attrs.frozen
class ExitCode:
    code: int


class Communicator:
    """Messages between rank 0 and the others, and what can be made of them; by itself one process
    alone, what a job without a launcher runs on.

    A subclass has ``rank``, ``size``, ``send(to, message)``, ``abort(code)``, which ends the whole
    job, and ``arrived()``, which yields (source, message) of all that has come in; ``beat(sign)``
    and ``signs()`` do the same for signs of life (Heartbeat), and never wait. ``threads`` says
    whether a thread of rank 0 may send and receive while the main one computes, ``concurrent``
    whether two may at once; ``ends_all``, whether ``abort`` ends the other ranks as well where it
    is not rank 0 that calls it. ``called``: the rank that a call of the library is for, which may
    not return, and ``calls`` how many there were.
    """

    rank = 0
    size = 1
    threads = True
    concurrent = True
    ends_all = True
    calls = 0
    called: int | None = None

    def __init__(self) -> None:
        self.inbox: dict[int, collections.deque] = collections.defaultdict(collections.deque)
        self.heartbeat: Heartbeat | None = None

    def send(self, to: int, message: Any) -> None:
        """There is nobody."""

    def arrived(self) -> Iterable[tuple[int, Any]]:
        return ()

    def abort(self, code: int) -> None:
        sys.exit(code)

    def beat(self, sign: bytes) -> None:
        """Give a sign of life to rank 0, or from there to all others."""

    def signs(self) -> Iterable[tuple[int, bytes]]:
        """(source, sign) of all that have come."""
        return ()

    def watch(self, seconds: float) -> None:
        """From now on end the job where a rank gives no sign of life for so long; 0: never."""
        if self.size > 1 and seconds > 0.0:
            self.heartbeat = Heartbeat(self, seconds)
            self.heartbeat.start()

    def unwatch(self) -> None:
        """Leave off: this rank is about to go."""
        if self.heartbeat is not None:
            self.heartbeat.stop()

    def take_in(self) -> None:
        """Put what has come into the inbox."""
        if self.heartbeat is not None and not self.concurrent:
            self.heartbeat.turn()
        for source, message in self.arrived():
            self.inbox[source].append(message)

    def messages(self) -> Iterator[tuple[int, Any]]:
        """(source, message) of all that is here."""
        self.take_in()
        for source in [source for source, queue in self.inbox.items() if queue]:
            while self.inbox[source]:
                yield source, self.inbox[source].popleft()

    def receive(self, source: int, heed_signals: bool = True) -> Any:
        """The next message of a rank; on rank 0, StopRequested where a signal comes first.

        The other ranks wait for rank 0 to end the job, which says why: one that ended it first
        would cut that short. Where rank 0 does not, flocsim.process does.
        """
        while not self.inbox[source]:
            self.take_in()
            if self.inbox[source]:
                break
            if heed_signals and self.rank == 0 and stop_requested():
                raise StopRequested(f"stopped by {INTERRUPTION.name}")
            time.sleep(SLEEP)
        return self.inbox[source].popleft()

    def gather(self, value: Any, heed_signals: bool = True) -> list | None:
        """The values of all ranks, on rank 0."""
        if self.rank > 0:
            self.send(0, value)
            return None
        return [value, *(self.receive(rank, heed_signals) for rank in range(1, self.size))]

    def broadcast(self, value: Any) -> Any:
        """Rank 0's value, on all ranks."""
        if self.rank > 0:
            return self.receive(0)
        for rank in range(1, self.size):
            self.send(rank, value)
        return value

    def barrier(self, heed_signals: bool = True) -> None:
        self.broadcast(self.gather(None, heed_signals))

    def close(self) -> None:
        """The work is done: let the others go."""
        self.unwatch()


class Awake:
    """A clock that stands still while this process does: it goes on where it was."""

    def __init__(self, clock: Callable[[], float], interval: float) -> None:
        """``interval``: seconds after which somebody looks again, unless the process is stopped."""
        self.clock, self.most = clock, 2.0 * interval
        self.looked = clock()

    def seconds(self) -> float:
        """Seconds since the last look."""
        now = self.clock()
        seconds = min(now - self.looked, self.most)
        self.looked = now
        return seconds


class Heartbeat:
    """One rank's: gives signs, and counts how long each of the others has given none.

    Only time in which this rank itself was awake counts: a job that is suspended as a whole, or a
    laptop that sleeps, goes on where it was.
    """

    def __init__(
        self, comm: Communicator, seconds: float, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """``seconds``: how long a rank may be silent."""
        self.comm = comm
        self.seconds = seconds if comm.concurrent else WITHOUT_THREADS * seconds
        self.interval = min(seconds / SIGNS, LONGEST_INTERVAL)
        self.clock = clock
        peers = range(1, comm.size) if comm.rank == 0 else (0,)
        self.silence = dict.fromkeys(peers, -FIRST_SIGN)
        self.where: dict[int, str] = {}
        self.sign = f"{socket.gethostname()}, process {os.getpid()}".encode()
        self.given = clock() - self.interval
        self.awake = Awake(clock, self.interval)
        self.ended = False
        self.stopped = threading.Event()
        self.thread = threading.Thread(target=self.go_on, daemon=True)

    def start(self) -> None:
        self.thread.start()

    def stop(self) -> None:
        self.stopped.set()
        self.thread.join()

    def go_on(self) -> None:
        """The thread: all turns, or where only the main thread may talk, an eye on that one."""
        before, waiting = None, Awake(self.clock, self.interval)
        while not self.stopped.wait(0.5 * self.interval):
            if self.comm.concurrent:
                self.turn()
                continue
            call, seconds = (self.comm.calls, self.comm.called), waiting.seconds()
            if call == before and call[1] is not None:
                self.add([call[1]], seconds)
            before = call

    def turn(self) -> None:
        """Give a sign where one is due, take in those of the others, and count; never waits."""
        if self.clock() - self.given < self.interval:
            return
        self.given = self.clock()
        self.comm.beat(self.sign)
        seconds = self.awake.seconds()
        for rank, sign in self.comm.signs():
            self.silence[rank], self.where[rank] = -seconds, sign.decode(errors="replace")
        self.add(self.silence, seconds)

    def add(self, ranks: Iterable[int], seconds: float) -> None:
        """Add to the silence of ranks; end the job where that has become too long."""
        for rank in ranks:
            self.silence[rank] = self.silence.get(rank, 0.0) + seconds
        if lost := [rank for rank in ranks if self.silence[rank] > self.seconds]:
            self.end(lost)

    def end(self, lost: list[int]) -> None:
        """Say who is lost, and end the job: what has come to rank 0 is in the journal."""
        if self.ended:
            return  # MPI's abort may come back, until the launcher has ended this process as well
        self.ended = True
        # Where rank 0 is lost, the first of the others to speak up ends all the rest.
        self.stopped.wait(min(TURN * max(0, self.comm.rank - 1), 20.0))
        if self.comm.rank < 2 or self.comm.ends_all:
            tell(f"flocsim: {self.words(lost)}", sys.stderr)
        self.comm.abort(STOPPED)

    def words(self, lost: list[int]) -> str:
        first = lost[0]
        who = f"rank {first} ({self.where.get(first, 'of which there was no sign at all')})"
        more = f" and {len(lost) - 1} more" if len(lost) > 1 else ""
        return (
            f"{who}{more} has been silent for {self.seconds:g} s, so the job ends; what was "
            "computed is kept: continue with --resume"
        )
