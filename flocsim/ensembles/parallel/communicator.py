"""The ranks of a job behind one interface: one process, MPI's, or processes of this machine.

All ranks talk to rank 0 only. Nobody waits inside a library: a rank that waits looks for a message,
then sleeps a little, so that it takes no processor from those who compute, and hears signals.
"""

import collections
import os
import sys
import time
from collections.abc import Iterable, Iterator
from typing import Any

from flocsim.ensembles.parallel.heartbeat import Heartbeat
from flocsim.errors import FlocsimError
from flocsim.interruption import INTERRUPTION, LAUNCHER_RANKS, stop_requested

LAUNCHER_SIZES = (
    "PMI_SIZE", "OMPI_COMM_WORLD_SIZE", "PMIX_SIZE", "MPI_LOCALNRANKS", "SLURM_STEP_NUM_TASKS",
)  # fmt: skip
"""Environment variables in which launchers tell a process how many ranks there are. Slurm's is the
last: where mpirun runs inside a step, it counts mpirun's own helpers."""

SLEEP = 5e-4
"""Seconds between two looks for a message."""


class StopRequested(FlocsimError):
    """A signal has come while this rank waited for the others."""

    exit_code = 75


class Communicator:
    """Messages between rank 0 and the others, and what can be made of them.

    A subclass has ``rank``, ``size``, ``send(to, message)``, ``abort(code)``, which ends the whole
    job, and ``arrived()``, which yields (source, message) of all that has come in; ``beat(sign)``
    and ``signs()`` do the same for signs of life (flocsim.ensembles.parallel.heartbeat), and never
    wait. ``threads`` says whether a thread of rank 0 may send and receive while the main one
    computes, ``concurrent`` whether two may at once; ``ends_all``, whether ``abort`` ends the other
    ranks as well where it is not rank 0 that calls it. ``called``: the rank that a call of the
    library is for, which may not return, and ``calls`` how many there were.
    """

    rank: int
    size: int
    threads = True
    concurrent = True
    ends_all = True
    calls = 0
    called: int | None = None

    def __init__(self) -> None:
        self.inbox: dict[int, collections.deque] = collections.defaultdict(collections.deque)
        self.heartbeat: Heartbeat | None = None

    def send(self, to: int, message: Any) -> None:
        raise NotImplementedError

    def arrived(self) -> Iterable[tuple[int, Any]]:
        raise NotImplementedError

    def abort(self, code: int) -> None:
        raise NotImplementedError

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
        would cut that short. Where rank 0 does not, flocsim.interruption does.
        """
        while not self.inbox[source]:
            self.take_in()
            if self.inbox[source]:
                break
            if heed_signals and self.rank == 0 and stop_requested():
                raise StopRequested(f"stopped by {INTERRUPTION.name}; continue with --resume")
            time.sleep(SLEEP)
        return self.inbox[source].popleft()

    def gather(self, value: Any) -> list | None:
        """The values of all ranks, on rank 0."""
        if self.rank > 0:
            self.send(0, value)
            return None
        return [value, *(self.receive(rank) for rank in range(1, self.size))]

    def broadcast(self, value: Any) -> Any:
        """Rank 0's value, on all ranks."""
        if self.rank > 0:
            return self.receive(0)
        for rank in range(1, self.size):
            self.send(rank, value)
        return value

    def all_gather(self, value: Any) -> list:
        """The values of all ranks, on all ranks."""
        return self.broadcast(self.gather(value))

    def barrier(self) -> None:
        self.all_gather(None)

    def close(self) -> None:
        """The work is done: let the others go."""
        self.unwatch()


class SerialCommunicator(Communicator):
    """One process: what a job without a launcher runs on."""

    rank = 0
    size = 1

    def send(self, to: int, message: Any) -> None:
        """There is nobody."""

    def arrived(self) -> tuple:
        return ()

    def abort(self, code: int) -> None:
        sys.stdout.flush()
        sys.stderr.flush()
        sys.exit(code)


def launched_size() -> int | None:
    """Number of ranks that the launcher started: None where it does not say, 0 without one."""
    for name in LAUNCHER_SIZES:
        if os.environ.get(name, "").isdigit():
            return int(os.environ[name])
    return None if any(name in os.environ for name in LAUNCHER_RANKS) else 0


def launched_rank() -> int:
    """This process's rank according to its launcher, 0 without one; needs no MPI library."""
    said = [os.environ.get(name, "") for name in (*LAUNCHER_RANKS, "SLURM_PROCID")]
    return next((int(rank) for rank in said if rank.isdigit()), 0)


def find_communicator() -> Communicator:
    """The ranks of this job: MPI only where a launcher started more than one."""
    try:
        size = launched_size()
        if size in (0, 1):
            return SerialCommunicator()
        from flocsim.ensembles.parallel.mpi import MpiCommunicator

        return MpiCommunicator(size)
    finally:
        INTERRUPTION.held = False
