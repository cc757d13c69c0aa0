"""Ranks under MPI. The only importer of mpi4py."""

import contextlib
import faulthandler
import os
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any

from flocsim.ensembles.parallel.communicator import Communicator, launched_rank
from flocsim.errors import UsageError
from flocsim.interruption import INTERRUPTION, STOPPED, end_with_parent

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
            return imported_mpi()
        finally:
            faulthandler.cancel_dump_traceback_later()


def imported_mpi():
    try:
        from mpi4py import MPI
    except (ImportError, RuntimeError) as error:
        raise UsageError(
            f"started by an MPI launcher, but mpi4py cannot be loaded ({error}): install "
            "flocsim[mpi] (wheels) or flocsim[mpi-system] (your cluster's MPI), or run without "
            "the launcher"
        ) from None
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
                "MPI library that mpi4py uses are of different kinds; use the mpirun beside this "
                "Python, or srun --mpi=pmi2 (MPICH, Intel MPI) or --mpi=pmix (Open MPI)"
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
        self.meet()
        self.unwatch()
        # From here on nobody looks after the others, but MPI's end waits for all of them.
        end = threading.Timer(max(LEAVING, self.heartbeat.seconds), os._exit, (STOPPED,))
        end.daemon = True
        end.start()
        self.meet()
        for _ in self.signs():
            pass

    def meet(self) -> None:
        """Wait for all ranks, whatever signals may come."""
        others = range(1, self.size) if self.rank == 0 else (0,)
        if self.rank > 0:
            self.send(0, None)
        for rank in others:
            self.receive(rank, heed_signals=False)
        if self.rank == 0:
            for rank in others:
                self.send(rank, None)

    def abort(self, code: int) -> None:
        sys.stdout.flush()
        sys.stderr.flush()
        time.sleep(LAST_WORDS)
        self.world.Abort(code)
