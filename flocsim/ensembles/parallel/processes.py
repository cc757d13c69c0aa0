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
            raise StopRequested("stopped by a signal; continue with --resume")
        raise LostRank(
            f"the process of rank {rank} has died (exit code {process.exitcode}); what was "
            "computed is kept: continue with --resume"
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


def in_copies(works: Sequence[Callable[[], object]]) -> None:
    """Do some works in copies of this process, for what they leave on the disk: side by side where
    there are processors enough, and what they take of memory is given back. Nothing is done where
    processes cannot be copied, and nothing is told: who needs what a work leaves does it again.
    """
    if sys.platform != "linux":
        return
    context = multiprocessing.get_context("fork")
    copies = [
        context.Process(target=as_copy, args=(work, place > 0), daemon=True)
        for place, work in enumerate(works)
    ]
    together = len(os.sched_getaffinity(0)) >= len(copies)
    try:
        for copy in copies:
            copy.start()
            if not together:
                copy.join()
        for copy in copies:
            copy.join()
    finally:
        for copy in copies:
            if copy.pid is not None:
                copy.kill()


def as_copy(work, silent):
    """Work in a copied process, which dies with the first one and by any signal; unless it is
    ``silent`` it says what the first one would."""
    for each in (signal.SIGINT, signal.SIGTERM):
        signal.signal(each, signal.SIG_DFL)
    end_with_parent()
    with contextlib.ExitStack() as stack:
        stack.enter_context(contextlib.suppress(Exception))
        if silent:
            nowhere = stack.enter_context(open(os.devnull, "w"))
            stack.enter_context(contextlib.redirect_stdout(nowhere))
            stack.enter_context(contextlib.redirect_stderr(nowhere))
        work()


def join_job(target, rank, jobs, pipe, life, arguments):
    """Where a process that rank 0 has started begins."""
    install()
    end_with_parent()
    INTERRUPTION.speaks = False
    sys.exit(target(ProcessCommunicator(rank, jobs, {0: pipe}, life={0: life}), arguments))
