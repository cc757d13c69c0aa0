"""Tasks in one process or several: whatever becomes of one, the others are done.

A task that raises, runs out of memory or has its process killed gives a `Lost` in its place.
"""

import contextlib
import functools
import multiprocessing
import signal
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from itertools import islice
from typing import Any

import attrs

from flocsim.errors import FlocsimError
from flocsim.process import end_with_parent

AHEAD = 3
"""Tasks for each process that are handed out before there are results: none has to wait."""

Map = Callable[[Callable[[Any], Any], Iterable[Any]], Iterator[Any]]


@attrs.frozen
class Lost:
    """What stands for the result of a task that failed, and why it did."""

    reason: str


@contextlib.contextmanager
def workers(jobs: int, prepare: Callable[[], object]) -> Iterator[Map]:
    """Give a map over tasks, in order, as results come in; by ``jobs`` processes if more than one.

    ``prepare`` is called first if there are to be several: what it compiles, all of them have.
    """
    if jobs == 1:
        yield lambda function, tasks: map(functools.partial(attempt, function), tasks)
        return
    prepare()
    begun: list[Any] = []

    def start(function: Callable[[Any], Any], tasks: Iterable[Any]) -> Iterator[Any]:
        begun.append(in_processes(jobs, function, tasks))
        return begun[-1]

    try:
        yield start
    finally:
        for each in begun:
            each.close()


def attempt(function, task):
    """Return the function's result, or a Lost; a FlocsimError is for the user to read."""
    try:
        return function(task)
    except FlocsimError:
        raise
    except MemoryError:
        return Lost("not enough memory: use fewer --jobs, or a smaller picture")
    except Exception as error:
        return Lost(f"internal error, please report it: {type(error).__name__}: {error}")


def in_processes(jobs: int, function: Callable, tasks: Iterable[Any]) -> Iterator[Any]:
    """Yield the results of tasks in order, from a pool that is made anew when a process dies.

    Nothing tells which task a dead process was at: all that were handed out and have no result are
    tried again, each in a process of its own. One whose process dies then is lost.
    """
    remaining = iter(tasks)
    while True:
        running: deque[list[Any]] = deque()  # [task, future], in order
        try:
            with new_pool(jobs) as pool:
                while True:
                    for task in islice(remaining, AHEAD * jobs - len(running)):
                        running.append([task, None])  # not lost where the pool breaks just now
                        running[-1][1] = pool.submit(attempt, function, task)
                    if not running:
                        return
                    result = running[0][1].result()
                    running.popleft()
                    yield result
        except BrokenProcessPool:
            for task, future in running:
                is_done = future is not None and future.done() and not future.exception()
                yield future.result() if is_done else alone(function, task)


def alone(function, task):
    """Return the result of a task in a process of its own."""
    with new_pool(1) as pool:
        try:
            return pool.submit(attempt, function, task).result()
        except BrokenProcessPool:
            return Lost("its process was killed, perhaps for lack of memory")


@contextlib.contextmanager
def new_pool(jobs):
    """Give a pool of processes, which end at once, whatever they are at, after an error."""
    # Linux processes inherit what is compiled and loaded; elsewhere forking is not safe.
    context = multiprocessing.get_context("fork" if sys.platform == "linux" else "spawn")
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(jobs, context, initializer=begin_process)
    try:
        yield pool
    except BaseException:
        for process in set(multiprocessing.active_children()) - others:
            process.kill()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def begin_process():
    """Ctrl-C is the parent's to handle; without a parent there is nobody to work for."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
