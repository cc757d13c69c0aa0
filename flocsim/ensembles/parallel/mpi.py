"""Ranks under MPI. The only importer of mpi4py."""

import sys
import time
from collections.abc import Iterator
from typing import Any

from flocsim.ensembles.parallel.communicator import Communicator
from flocsim.errors import UsageError
from flocsim.interruption import INTERRUPTION, end_with_parent

LAST_WORDS = 0.5
"""Seconds for the launcher to forward what was printed: it drops what comes with an abort."""


def load_mpi() -> Any:
    """mpi4py's MPI module; UsageError where it or its library is missing."""
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
        if launched is not None and launched != self.size:
            raise UsageError(
                f"the launcher started {launched} ranks but MPI counts {self.size}: mpirun and the "
                "MPI library that mpi4py uses are of different kinds; use the mpirun beside this "
                "Python"
            )
        INTERRUPTION.speaks = self.rank == 0
        if self.mpi.Query_thread() == self.mpi.THREAD_MULTIPLE:
            # Where one rank just goes, the launcher kills the others, and says so by its code.
            INTERRUPTION.leave = self.abort
        end_with_parent()

    def send(self, to: int, message: Any) -> None:
        self.world.send(message, to)

    def arrived(self) -> Iterator[tuple[int, Any]]:
        status = self.mpi.Status()
        while self.world.Iprobe(status=status):
            source = status.Get_source()
            yield source, self.world.recv(source=source)

    def abort(self, code: int) -> None:
        sys.stdout.flush()
        sys.stderr.flush()
        time.sleep(LAST_WORDS)
        self.world.Abort(code)
