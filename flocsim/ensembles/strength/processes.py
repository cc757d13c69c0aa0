"""Doublets dealt to processes of this machine, one at a time, and taken in as they are done."""

import contextlib
import multiprocessing
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
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
    others = set(multiprocessing.active_children())
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(min(jobs, len(tasks)), context, begin_process, (begin, given))
    mine: set = set()
    try:
        with deaf_to_interrupts():  # they begin with the tasks
            asked = {pool.submit(answer, task): task for task in tasks}
        mine = set(multiprocessing.active_children()) - others
        for done in as_completed(asked):
            yield asked[done], done.result()
    except BrokenProcessPool:
        for process in mine:
            process.join(LAST_SECONDS)
        codes = {process.exitcode for process in mine} - {None, 0, -signal.SIGTERM}
        raise LostProcess(
            f"a process that tested doublets has died (exit code {min(codes, default=0)}): see "
            "that there is memory for all of --jobs, and go on with --resume"
        ) from None
    finally:
        # At once: what they were at is begun anew by whoever goes on.
        mine |= set(multiprocessing.active_children()) - others
        pool.shutdown(wait=False, cancel_futures=True)
        for process in mine:
            process.kill()
        for process in mine:
            process.join(LAST_SECONDS)


@contextlib.contextmanager
def deaf_to_interrupts() -> Iterator[None]:
    """Start processes that Ctrl-C, which goes to all of a terminal, does not reach: they are ended
    by the one that has started them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


TO_DO: dict[str, Any] = {}
"""Of this process: how it begins, and, once it has, what answers its tasks."""


def begin_process(begin: Callable[..., Callable[[Any], Any]], given: tuple) -> None:
    """Where a process begins: it goes with the one that started it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
    TO_DO["begin"] = lambda: begin(*given)


def answer(task: Any) -> Any:
    """What this process says to a task."""
    if "answer" not in TO_DO:
        TO_DO["answer"] = TO_DO["begin"]()
    return TO_DO["answer"](task)
