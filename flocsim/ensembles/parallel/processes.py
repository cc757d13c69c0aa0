"""The ranks of a job: those that an MPI launcher has started, or processes of this machine, without
MPI: `--jobs 4`. The only importer of mpi4py."""

import contextlib
import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any

from flocsim.ensembles.parallel.communicator import Communicator, StopRequested
from flocsim.errors import FlocsimError, UsageError
from flocsim.io.terminal import plain_warnings
from flocsim.process import (
    INTERRUPTION,
    LAUNCHER_RANKS,
    STOPPED,
    end_with_parent,
    handle,
    install,
    stop_requested,
)

LAUNCHER_SIZES = (
    "PMI_SIZE", "OMPI_COMM_WORLD_SIZE", "PMIX_SIZE", "MPI_LOCALNRANKS", "SLURM_STEP_NUM_TASKS",
)  # fmt: skip
"""Environment variables in which launchers tell a process how many ranks there are. Slurm's is the
last: where mpirun runs inside a step, it counts mpirun's own helpers."""

LAST_WORDS = 0.5
"""Seconds for the launcher to forward what was printed: it drops what comes with an abort."""

LAST_SECONDS = 5.0
"""Seconds in which the others end by themselves when the work is done."""


def launched_size() -> int | None:
    """Return how many ranks the launcher has started; None where it does not say, 0 without one."""
    for name in LAUNCHER_SIZES:
        if os.environ.get(name, "").isdigit():
            return int(os.environ[name])
    return None if any(name in os.environ for name in LAUNCHER_RANKS) else 0


def launched_rank() -> int:
    """Return this process's rank by its launcher's variables, 0 without one; needs no MPI."""
    said = [os.environ.get(name, "") for name in (*LAUNCHER_RANKS, "SLURM_PROCID")]
    return next((int(rank) for rank in said if rank.isdigit()), 0)


def find_communicator() -> Communicator:
    """Return the ranks of this job: MPI's only where a launcher has started more than one."""
    try:
        size = launched_size()
        return Communicator() if size in (0, 1) else MpiCommunicator(size)
    finally:
        INTERRUPTION.held = False


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

    is_launched = True

    def __init__(self, launched: int | None) -> None:
        """Join the world; UsageError where its size is not what the launcher started."""
        super().__init__()
        self.mpi = load_mpi()
        self.world = self.mpi.COMM_WORLD
        self.rank = self.world.rank
        self.size = self.world.size
        self.threads = self.mpi.Query_thread() >= self.mpi.THREAD_SERIALIZED
        if launched is not None and launched != self.size:
            if launched_rank() > 0:
                raise SystemExit(UsageError.exit_code)  # the first says it for all
            raise UsageError(
                f"the launcher started {launched} ranks but MPI counts {self.size}: mpirun and the "
                "MPI library used by mpi4py do not match; use the mpirun of this Python "
                "environment, or srun --mpi=pmi2 (MPICH, Intel MPI) or --mpi=pmix (Open MPI)"
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


class LostRank(FlocsimError):
    """A process of the job has died."""


class ProcessCommunicator(Communicator):
    """One process of several, with a pipe to rank 0 or, on rank 0, to each of the others."""

    def __init__(
        self, rank: int, size: int, pipes: Mapping[int, Connection],
        others: Sequence[BaseProcess] = (),
    ) -> None:  # fmt: skip
        """``pipes``: {rank: connection}; ``others``: the processes that rank 0 has started."""
        super().__init__()
        self.rank, self.size, self.pipes, self.others = rank, size, pipes, others

    def send(self, to: int, message: Any) -> None:
        try:
            self.pipes[to].send(message)
        except OSError:
            self.lose(to)

    def arrived(self) -> Iterator[tuple[int, Any]]:
        """Yield (source, message) of all that has come; LostRank where a process has gone."""
        ranks = {pipe: rank for rank, pipe in self.pipes.items()}
        ready: Any = wait(list(ranks), timeout=0)
        for pipe in ready:
            try:
                yield ranks[pipe], pipe.recv()
            except (EOFError, OSError):
                self.lose(ranks[pipe])

    def lose(self, rank):
        """End where rank 0 has gone; on rank 0 raise the error for a process that has gone."""
        if self.rank > 0:
            os._exit(FlocsimError.exit_code)
        process = self.others[rank - 1]
        process.join(LAST_SECONDS)
        if process.exitcode == STOPPED or stop_requested():
            raise StopRequested("stopped by a signal")
        raise LostRank(
            f"the process of rank {rank} has died (exit code {process.exitcode}); what was "
            "computed is kept: continue with --resume"
        )

    def close(self) -> None:
        """Wait for the other processes, which have nothing more to do."""
        super().close()
        for process in self.others:
            process.join(LAST_SECONDS)
        self.end_others()

    def end_others(self):
        for process in self.others:
            with contextlib.suppress(Exception):
                process.kill()

    def abort(self, code: int) -> None:
        sys.stdout.flush()
        sys.stderr.flush()
        self.end_others()
        os._exit(code)


def start_processes(jobs: int, target: Callable[[Communicator], int]) -> ProcessCommunicator:
    """Start ``jobs`` − 1 processes that call ``target(communicator)``; rank 0's own."""
    context = multiprocessing.get_context("spawn")
    pipes: dict[int, Connection] = {}
    others: list[BaseProcess] = []
    for rank in range(1, jobs):
        pipes[rank], far_end = context.Pipe()
        process = context.Process(target=join_job, args=(target, rank, jobs, far_end), daemon=True)
        process.start()
        far_end.close()
        others.append(process)
    comm = ProcessCommunicator(0, jobs, pipes, others)
    INTERRUPTION.leave = comm.abort
    return comm


def in_copies(works: Sequence[Callable[[], object]]) -> None:
    """Do some works side by side in copies of this process, for what they leave on the disk: what
    they take of memory is given back. Nothing fails: who needs what a work leaves does it again.
    The first one alone says something. Where processes cannot be copied this one does the work.
    """
    # The processes of --jobs are daemons, which multiprocessing gives no children.
    if sys.platform != "linux" or multiprocessing.current_process().daemon:
        for work in works:
            work()
        return
    context = multiprocessing.get_context("fork")
    copies = [
        context.Process(target=as_copy, args=(work, place > 0), daemon=True)
        for place, work in enumerate(works)
    ]
    for copy in copies:
        copy.start()
    for copy in copies:
        copy.join()


def as_copy(work, silent):
    """Work in a copied process, which dies with the first one and by any signal."""
    handle(signal.SIG_DFL)
    end_with_parent()
    if silent:
        sys.stdout = sys.stderr = open(os.devnull, "w")  # noqa: SIM115 (it ends with the process)
    with contextlib.suppress(Exception):
        work()


def join_job(target, rank, jobs, pipe):
    """Begin as a process that rank 0 has started."""
    install()
    end_with_parent()
    INTERRUPTION.speaks = False
    plain_warnings(silent=True)
    sys.exit(target(ProcessCommunicator(rank, jobs, {0: pipe})))
