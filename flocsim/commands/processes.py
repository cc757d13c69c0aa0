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
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any

import attrs

from flocsim.errors import FlocsimError
from flocsim.process import end_with_parent

AHEAD = 2
"""Tasks for each process that are handed out before there are results: none has to wait."""

Map = Callable[[Callable[[Any], Any], Iterable[Any]], Iterator[Any]]


@attrs.frozen
class Lost:
    """What stands for the result of a task that failed, and why it did."""

    reason: str


@contextlib.contextmanager
def workers(jobs: int, prepare: Callable[[], object]) -> Iterator[Map]:
    """A map over tasks, in order, as results come in; by ``jobs`` processes if more than one.

    ``prepare`` is called first if there are to be several: what it compiles, all of them have.
    """
    if jobs == 1:
        yield lambda function, tasks: map(functools.partial(attempt, function), tasks)
        return
    prepare()
    pool = Processes(jobs)
    try:
        yield pool.map
    except BaseException:
        pool.kill()
        raise
    finally:
        pool.end()


def attempt(function, task):
    """The function's result, or a Lost; a FlocsimError is for the user to read, and is raised."""
    try:
        return function(task)
    except FlocsimError:
        raise
    except MemoryError:
        return Lost("not enough memory: use fewer --jobs, or a smaller picture")
    except Exception as error:
        return Lost(f"internal error, please report it: {type(error).__name__}: {error}")


class Processes:
    """A pool of processes that is made anew when one of them dies.

    Nothing tells which task a dead process was at, so all that were handed out are then tried
    again one by one. One whose process dies while it is alone is lost.
    """

    def __init__(self, jobs: int) -> None:
        self.jobs = jobs
        self.others = set(multiprocessing.active_children())
        self.pool: ProcessPoolExecutor | None = None

    def map(self, function: Callable[[Any], Any], tasks: Iterable[Any]) -> Iterator[Any]:
        """The results in the order of the tasks, as soon as they are there."""
        waiting = deque(enumerate(tasks))
        suspects: deque = deque()
        results: dict[int, Any] = {}
        running: dict[Any, tuple[int, Any]] = {}
        shown = 0
        while waiting or suspects or running:
            alone = bool(suspects)
            source, most = (suspects, 1) if alone else (waiting, AHEAD * self.jobs)
            while source and len(running) < most:
                number, task = source.popleft()
                try:
                    running[self.started().submit(attempt, function, task)] = number, task
                except BrokenProcessPool:  # a process has just died; the task was not handed out
                    source.appendleft((number, task))
                    break
            finished = wait(running, return_when=FIRST_COMPLETED).done
            broken = not running
            for future in finished:
                try:
                    results[running[future][0]] = result_of(future)
                except BrokenProcessPool:
                    broken = True
                    continue
                del running[future]
            if broken:
                self.end()
                for future, (number, task) in sorted(running.items(), key=lambda each: each[1][0]):
                    if future.done() and not future.cancelled() and not future.exception():
                        results[number] = future.result()
                    elif alone:
                        results[number] = Lost("its process was killed, perhaps for lack of memory")
                    else:
                        suspects.append((number, task))
                running.clear()
            while shown in results:
                yield results.pop(shown)
                shown += 1

    def started(self):
        if self.pool is None:
            # Linux processes inherit what is compiled and loaded; elsewhere forking is not safe.
            method = "fork" if sys.platform == "linux" else "spawn"
            context = multiprocessing.get_context(method)
            self.pool = ProcessPoolExecutor(self.jobs, context, initializer=begin_process)
        return self.pool

    def kill(self) -> None:
        """End the processes at once, whatever they are at."""
        for process in set(multiprocessing.active_children()) - self.others:
            process.kill()

    def end(self) -> None:
        """Wait for what the processes are at, and end them."""
        if self.pool is not None:
            self.pool.shutdown(cancel_futures=True)
            self.pool = None


def result_of(future):
    """A future's result, or a Lost where it could not even be handed over."""
    try:
        return future.result()
    except (FlocsimError, BrokenProcessPool):
        raise
    except Exception as error:
        return Lost(f"its result could not be passed on: {type(error).__name__}: {error}")


def begin_process():
    """Ctrl-C is the parent's to handle; without a parent there is nobody to work for."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
