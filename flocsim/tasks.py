"""Tasks in one process or several: whatever becomes of one, the others are done.

A task that raises, runs out of memory or has its process killed gives a `Lost` in its place.
"""

import contextlib
import functools
import multiprocessing
import signal
import sys
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import Any

import attrs

from flocsim.errors import FlocsimError
from flocsim.process import deferred, end_with_parent

Map = Callable[[Callable[[Any], Any], Sequence[Any]], Iterator[Any]]


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
    with contextlib.ExitStack() as begun:
        yield lambda function, tasks: begun.enter_context(
            contextlib.closing(in_processes(jobs, function, tasks))
        )


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


def in_processes(jobs: int, function: Callable, tasks: Sequence[Any]) -> Generator[Any, None, None]:
    """Yield the results of tasks in order, from a pool that is made anew when a process dies.

    Nothing tells which task a dead process was at: the first one without a result is tried again in
    a process of its own, and is lost if that dies as well; the rest goes to a new pool.
    """
    done = 0
    while done < len(tasks):
        with contextlib.closing(until_a_death(jobs, function, tasks[done:])) as results:
            for result in results:
                done += 1
                yield result
        if done < len(tasks):
            lost = Lost("its process was killed, perhaps for lack of memory")
            yield from [*until_a_death(1, function, tasks[done : done + 1])] or [lost]
            done += 1


def until_a_death(
    jobs: int, function: Callable, tasks: Sequence[Any]
) -> Generator[Any, None, None]:
    """Yield the results of tasks in order, from one pool, until one of its processes dies."""
    with contextlib.suppress(BrokenProcessPool), new_pool(jobs) as pool:
        # Ctrl-C waits: a process that is just being started would not be known, nor ended.
        with deferred(signal.SIGINT):
            futures = [pool.submit(attempt, function, task) for task in tasks]
        for future in futures:
            yield future.result()


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
