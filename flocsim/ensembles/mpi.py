"""Ranks under MPI. The only importer of mpi4py."""

import sys
import time

from flocsim.errors import UsageError

LAST_WORDS = 0.5
"""Seconds for the launcher to forward what was printed: it drops what comes with an abort."""


def load_mpi():
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


class MpiTeam:
    """The ranks of MPI's world."""

    def __init__(self, launched):
        """Join the world; UsageError where its size is not what the launcher started."""
        self.world = load_mpi().COMM_WORLD
        self.rank = self.world.rank
        self.size = self.world.size
        if launched is not None and launched != self.size:
            raise UsageError(
                f"the launcher started {launched} ranks but MPI counts {self.size}: mpirun and the "
                "MPI library that mpi4py uses are of different kinds; use the mpirun beside this "
                "Python"
            )

    def gather(self, value):
        """The values of all ranks, on rank 0."""
        return self.world.gather(value, root=0)

    def share(self, value):
        """Rank 0's value, on all ranks."""
        return self.world.bcast(value, root=0)

    def collect(self, value):
        """The values of all ranks, on all ranks."""
        return self.world.allgather(value)

    def wait(self):
        """Until all ranks are here."""
        self.world.Barrier()

    def abort(self, code):
        """End the whole job: every rank, wherever it is."""
        sys.stdout.flush()
        sys.stderr.flush()
        time.sleep(LAST_WORDS)
        self.world.Abort(code)
