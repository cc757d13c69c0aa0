"""Ranks as processes of this machine, without MPI: `--jobs 4`."""

import contextlib
import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any

from flocsim.ensembles.parallel.communicator import Communicator, StopRequested
from flocsim.errors import FlocsimError
from flocsim.interruption import INTERRUPTION, STOPPED, end_with_parent, install, stop_requested

LAST_SECONDS = 5.0
"""Seconds in which the others end by themselves when the work is done."""


class LostRank(FlocsimError):
    """A process of the job has died."""


class ProcessCommunicator(Communicator):
    """One process of several, with a pipe to rank 0 or, on rank 0, to each of the others."""

    ends_all = False

    def __init__(
        self, rank: int, size: int, pipes: Mapping[int, Connection],
        others: Sequence[BaseProcess] = (), life: Mapping[int, Connection] | None = None,
    ) -> None:  # fmt: skip
        """``pipes``: {rank: connection}; ``others``: the processes that rank 0 has started;
        ``life``: {rank: connection} for signs of life, which get by themselves."""
        super().__init__()
        self.rank, self.size = rank, size
        self.pipes, self.life = pipes, dict(life or {})
        self.others = others

    def send(self, to: int, message: Any) -> None:
        try:
            self.pipes[to].send(message)
        except OSError:
            self.lose(to)

    def arrived(self) -> Iterator[tuple[int, Any]]:
        """(source, message) of all that has come; LostRank where a process has gone."""
        ranks = {pipe: rank for rank, pipe in self.pipes.items()}
        ready: Any = wait(list(ranks), timeout=0)
        for pipe in ready:
            try:
                yield ranks[pipe], pipe.recv()
            except (EOFError, OSError):
                self.lose(ranks[pipe])

    def beat(self, sign: bytes) -> None:
        for pipe in self.life.values():
            with contextlib.suppress(OSError):  # who has gone is found out by `arrived`
                pipe.send_bytes(sign)

    def signs(self) -> Iterator[tuple[int, bytes]]:
        for rank, pipe in list(self.life.items()):
            try:
                while pipe.poll():
                    yield rank, pipe.recv_bytes()
            except (EOFError, OSError):
                del self.life[rank]

    def lose(self, rank):
        """A process has gone: without rank 0 there is nobody to tell."""
        if self.rank > 0:
            os._exit(FlocsimError.exit_code)
        process = self.others[rank - 1]
        process.join(LAST_SECONDS)
        if process.exitcode == STOPPED or stop_requested():
            raise StopRequested("stopped by a signal; go on with --resume")
        raise LostRank(
            f"the process of rank {rank} has died (exit code {process.exitcode}); what was "
            "computed is kept: go on with --resume"
        )

    def close(self) -> None:
        """Wait for the other processes, which have nothing more to do."""
        self.unwatch()
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


def start_processes(
    jobs: int, target: Callable[[Communicator, Any], int], arguments: Any
) -> ProcessCommunicator:
    """Start ``jobs`` − 1 processes that call ``target(communicator, arguments)``; rank 0's own."""
    context = multiprocessing.get_context("spawn")
    pipes: dict[int, Connection] = {}
    life: dict[int, Connection] = {}
    others: list[BaseProcess] = []
    for rank in range(1, jobs):
        pipes[rank], far_end = context.Pipe()
        life[rank], far_life = context.Pipe()
        process = context.Process(
            target=join_job, args=(target, rank, jobs, far_end, far_life, arguments), daemon=True
        )
        process.start()
        far_end.close()
        far_life.close()
        others.append(process)
    comm = ProcessCommunicator(0, jobs, pipes, others, life)
    INTERRUPTION.leave = comm.abort
    return comm


@contextlib.contextmanager
def beside(work: Callable[[], object]) -> Iterator[None]:
    """Do some work in a copy of this process while it goes on, for what is left on the disk; not
    where processes cannot be copied, or there is one processor.

    Nothing is told of it: who needs what it leaves does it again where it is not there.
    """
    several = hasattr(os, "sched_getaffinity") and len(os.sched_getaffinity(0)) > 1
    if not (several and sys.platform == "linux"):
        yield
        return
    process = multiprocessing.get_context("fork").Process(
        target=in_silence, args=(work,), daemon=True
    )
    process.start()
    try:
        yield
        process.join()
    finally:
        process.kill()


def in_silence(work):
    """Work in a copied process, which dies with the first one and by any signal."""
    for each in (signal.SIGINT, signal.SIGTERM):
        signal.signal(each, signal.SIG_DFL)
    end_with_parent()
    with (
        contextlib.suppress(Exception), open(os.devnull, "w") as nowhere,
        contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere),
    ):  # fmt: skip
        work()


def join_job(target, rank, jobs, pipe, life, arguments):
    """Where a process that rank 0 has started begins."""
    install()
    end_with_parent()
    INTERRUPTION.speaks = False
    sys.exit(target(ProcessCommunicator(rank, jobs, {0: pipe}, life={0: life}), arguments))
