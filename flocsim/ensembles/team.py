"""The ranks of a job behind one interface; alone unless a launcher says otherwise."""

import os
import sys

LAUNCHER_SIZES = ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE", "PMIX_SIZE", "MPI_LOCALNRANKS")
"""Environment variables in which launchers tell a process how many ranks there are."""

LAUNCHER_RANKS = ("PMI_RANK", "OMPI_COMM_WORLD_RANK", "PMIX_RANK")
"""Environment variables that only a process started by a launcher has."""


class Alone:
    """One process: what a job without mpirun runs on."""

    rank = 0
    size = 1

    def gather(self, value):
        """The values of all ranks, on rank 0."""
        return [value]

    def share(self, value):
        """Rank 0's value, on all ranks."""
        return value

    def collect(self, value):
        """The values of all ranks, on all ranks."""
        return [value]

    def wait(self):
        """Until all ranks are here."""

    def abort(self, code):
        """End the whole job."""
        sys.stdout.flush()
        sys.stderr.flush()
        sys.exit(code)


def launched_size():
    """Number of ranks that the launcher started: None where it does not say, 0 without one."""
    for name in LAUNCHER_SIZES:
        if os.environ.get(name, "").isdigit():
            return int(os.environ[name])
    return None if any(name in os.environ for name in LAUNCHER_RANKS) else 0


def launched_rank():
    """This process's rank according to its launcher, 0 without one; needs no MPI library."""
    said = [os.environ.get(name, "") for name in LAUNCHER_RANKS]
    return next((int(rank) for rank in said if rank.isdigit()), 0)


def find_team():
    """The ranks of this job: MPI only where a launcher started more than one."""
    size = launched_size()
    if size in (0, 1):
        return Alone()
    from flocsim.ensembles.mpi import MpiTeam

    return MpiTeam(size)
