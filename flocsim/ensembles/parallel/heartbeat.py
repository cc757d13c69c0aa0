"""Signs of life: a rank that is not heard of for long ends the job, instead of being waited for.

Every rank gives rank 0 a sign now and then, and rank 0 gives one to each of them; what is missing
is a rank that is stopped, or whose machine is gone. A thread does both, so that a rank that is
busy, with a long replicate or with compiling, is heard of. Where MPI allows no thread beside the
main one, the main one does it whenever it looks for messages, and silence may last longer.
"""

import os
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from flocsim.interruption import STOPPED
from flocsim.io.terminal import tell

if TYPE_CHECKING:
    from flocsim.ensembles.parallel.communicator import Communicator

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
        self, comm: "Communicator", seconds: float, clock: Callable[[], float] = time.monotonic
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
