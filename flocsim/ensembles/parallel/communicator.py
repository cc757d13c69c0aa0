"""The ranks of a job behind one interface: one process, MPI's, or processes of this machine; and
what they say to each other while a study runs. The only importer of mpi4py.

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
"""

import collections
import contextlib
import faulthandler
import os
import sys
import threading
import time
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import attrs

from flocsim.ensembles.parallel.heartbeat import Heartbeat
from flocsim.errors import FlocsimError, UsageError
from flocsim.interruption import (
    INTERRUPTION,
    LAUNCHER_RANKS,
    STOPPED,
    end_with_parent,
    stop_requested,
)

if TYPE_CHECKING:
    from flocsim.ensembles.chunks import Chunk

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


@attrs.frozen
class ChunkResult:
    """What came of a chunk: its first ``count`` replicates, as a record of the journal.

    ``data_start``: bytes of the record before the rows; ``failed``: how many replicates have
    failed; ``notes``: what is known of them.
    """

    chunk: "Chunk"
    count: int
    record: bytes
    data_start: int
    failed: int = 0
    notes: tuple[dict, ...] = ()


@attrs.frozen
class Kept:
    """What is kept of an unfinished replicate of the condition at a place, as a record of the
    journal; whether progress counts it."""

    condition: int
    replicate: int
    record: bytes
    counts: bool


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
    and ``signs()`` do the same for signs of life (flocsim.ensembles.parallel.heartbeat), and never
    wait. ``threads`` says whether a thread of rank 0 may send and receive while the main one
    computes, ``concurrent`` whether two may at once; ``ends_all``, whether ``abort`` ends the other
    ranks as well where it is not rank 0 that calls it. ``called``: the rank that a call of the
    library is for, which may not return, and ``calls`` how many there were.
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
        return Communicator() if size in (0, 1) else MpiCommunicator(size)
    finally:
        INTERRUPTION.held = False


WORDS, LIFE = 0, 1
"""Tags of messages, and of signs of life."""

JOINING = 900.0
"""Seconds in which all ranks have to come to MPI's start, where a rank waits without being able to
do anything else: on a large machine loading Python alone takes minutes."""

LEAVING = 60.0
"""Seconds in which all ranks have to come to MPI's end."""

LAST_WORDS = 0.5
"""Seconds for the launcher to forward what was printed: it drops what comes with an abort."""


def load_mpi() -> Any:
    """mpi4py's MPI module; UsageError where it or its library is missing."""
    # MPI's start waits for all ranks and holds the interpreter's lock: no thread of Python's could
    # end that.
    with open(os.devnull, "w") as nowhere:
        faulthandler.dump_traceback_later(JOINING, exit=True, file=nowhere)
        try:
            from mpi4py import MPI
        except (ImportError, RuntimeError) as error:
            raise UsageError(
                f"started by an MPI launcher, but mpi4py cannot be loaded ({error}): install "
                "flocsim[mpi] (wheels) or flocsim[mpi-system] (your cluster's MPI), or run without "
                "the launcher"
            ) from None
        finally:
            faulthandler.cancel_dump_traceback_later()
    return MPI


class MpiCommunicator(Communicator):
    """The ranks of MPI's world."""

    def __init__(self, launched: int | None) -> None:
        """Join the world; UsageError where its size is not what the launcher started."""
        super().__init__()
        self.mpi = load_mpi()
        self.world = self.mpi.COMM_WORLD
        self.rank = self.world.rank
        self.size = self.world.size
        self.threads = self.mpi.Query_thread() >= self.mpi.THREAD_SERIALIZED
        self.concurrent = self.mpi.Query_thread() == self.mpi.THREAD_MULTIPLE
        self.given: dict[int, Any] = {}
        if launched is not None and launched != self.size:
            if launched_rank() > 0:
                raise SystemExit(UsageError.exit_code)  # the first says it for all
            raise UsageError(
                f"the launcher started {launched} ranks but MPI counts {self.size}: mpirun and the "
                "MPI library used by mpi4py do not match; use the mpirun of this Python "
                "environment, or srun --mpi=pmi2 (MPICH, Intel MPI) or --mpi=pmix (Open MPI)"
            )
        INTERRUPTION.speaks = self.rank == 0
        if self.concurrent:
            # Where one rank just goes, the launcher kills the others, and says so by its code.
            INTERRUPTION.leave = self.abort
        end_with_parent()

    def send(self, to: int, message: Any) -> None:
        with self.calling(to):
            self.world.send(message, to, tag=WORDS)

    def arrived(self) -> Iterator[tuple[int, Any]]:
        status = self.mpi.Status()
        while self.world.Iprobe(tag=WORDS, status=status):
            source = status.Get_source()
            with self.calling(source):
                message = self.world.recv(source=source, tag=WORDS)
            yield source, message

    @contextlib.contextmanager
    def calling(self, rank: int) -> Iterator[None]:
        """A call of MPI that returns when a rank does its part, which a lost one never does."""
        self.called, self.calls = rank, self.calls + 1
        try:
            yield
        finally:
            self.called = None

    def beat(self, sign: bytes) -> None:
        for rank in range(1, self.size) if self.rank == 0 else (0,):
            # To who does not take the last sign there is no use in sending another.
            if rank not in self.given or self.given[rank].Test():
                self.given[rank] = self.world.isend(sign, rank, tag=LIFE)

    def signs(self) -> Iterator[tuple[int, bytes]]:
        status = self.mpi.Status()
        while self.world.Iprobe(tag=LIFE, status=status):
            source = status.Get_source()
            yield source, self.world.recv(source=source, tag=LIFE)

    def close(self) -> None:
        """Go together, and leave no sign of life behind that MPI would wait for."""
        if self.heartbeat is None:
            return
        self.barrier(heed_signals=False)
        self.unwatch()
        # From here on nobody looks after the others, but MPI's end waits for all of them.
        end = threading.Timer(max(LEAVING, self.heartbeat.seconds), os._exit, (STOPPED,))
        end.daemon = True
        end.start()
        self.barrier(heed_signals=False)
        for _ in self.signs():
            pass

    def abort(self, code: int) -> None:
        sys.stdout.flush()
        sys.stderr.flush()
        time.sleep(LAST_WORDS)
        self.world.Abort(code)
