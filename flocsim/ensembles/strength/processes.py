"""Doublets dealt to processes of this machine, one at a time, and taken in as they are done."""

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any

from flocsim.errors import FlocsimError
from flocsim.interruption import end_with_parent

LAST_SECONDS = 5.0
"""Seconds in which a process that was killed is waited for."""


class LostProcess(FlocsimError):
    """A process that tested doublets has died."""


def dealt(
    begin: Callable[..., Callable[[Any], Any]], given: tuple, tasks: Sequence, jobs: int
) -> Iterator[tuple[Any, Any]]:
    """(task, answer) of every task, in the order in which the processes have done them.

    Each of ``jobs`` processes calls ``begin(*given)`` once, and what that gives for each of its
    tasks. A FlocsimError there is raised here; LostProcess where a process dies. None of them
    outlives the iteration, whatever ends it, nor this process, if it is killed.
    """
    context = multiprocessing.get_context("spawn")
    waiting, busy = list(reversed(tasks)), {}
    processes: dict[Connection, BaseProcess] = {}
    try:
        for _ in range(min(jobs, len(tasks))):
            pipe, far_end = context.Pipe()
            process = context.Process(target=serve, args=(far_end, begin, given), daemon=True)
            processes[pipe] = process
            with deaf_to_interrupts():
                process.start()
            far_end.close()
            busy[pipe] = waiting.pop()
            send(pipe, busy[pipe], process)
        while busy:
            ready: Any = wait(list(busy))
            for pipe in ready:
                answer = received(pipe, processes[pipe])
                task = busy.pop(pipe)
                if waiting:
                    busy[pipe] = waiting.pop()
                    send(pipe, busy[pipe], processes[pipe])
                yield task, answer
    finally:
        end(processes.values())


def send(pipe: Connection, task: Any, process: BaseProcess) -> None:
    """Hand over a task; LostProcess where there is nobody to take it."""
    try:
        pipe.send(task)
    except OSError:
        raise lost(process) from None


def received(pipe: Connection, process: BaseProcess) -> Any:
    """An answer; LostProcess where there will be none, or the FlocsimError in its place."""
    try:
        answer = pipe.recv()
    except (EOFError, OSError):
        raise lost(process) from None
    if isinstance(answer, FlocsimError):
        raise answer
    return answer


def lost(process):
    """The LostProcess of a process that has gone."""
    process.join(LAST_SECONDS)
    return LostProcess(
        f"a process that tested doublets has died (exit code {process.exitcode}): see that there "
        "is memory for all of --jobs, and go on with --resume"
    )


def end(processes):
    """End them at once: what they were at is begun anew by whoever goes on."""
    begun = [each for each in processes if each.pid is not None]
    for process in begun:
        process.kill()
    for process in begun:
        process.join(LAST_SECONDS)


@contextlib.contextmanager
def deaf_to_interrupts() -> Iterator[None]:
    """Start a process that Ctrl-C, which goes to all of a terminal, does not reach: it is ended by
    the one that has started it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def serve(pipe: Connection, begin: Callable[..., Callable[[Any], Any]], given: tuple) -> None:
    """Where a process begins: answer tasks until nobody asks any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
    answer_to: Callable[[Any], Any] | None = None
    while True:
        try:
            task = pipe.recv()
        except (EOFError, OSError):
            os._exit(0)
        try:
            answer_to = answer_to or begin(*given)
            answer = answer_to(task)
        except FlocsimError as error:
            answer = error
        with contextlib.suppress(OSError):
            pipe.send(answer)
