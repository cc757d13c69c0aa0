"""Worker processes that can be killed, so that a hang becomes a result."""

import multiprocessing
import time
from multiprocessing.connection import wait

from benchmarks.stability.families import family_of
from benchmarks.stability.verdict import Verdict, judge

COMPILE_TIME = 120.0
"""A worker's first case of a family may take so much longer [s]."""


def serve(link):
    """The life of a worker: judge the cases that it is sent."""
    while (index := link.recv()) is not None:
        link.send(judge(index, link.send))


class Worker:
    """A process with what it is at work on."""

    def __init__(self, context):
        """Start the process."""
        self.link, other = context.Pipe()
        self.process = context.Process(target=serve, args=(other,), daemon=True)
        self.process.start()
        self.known, self.index, self.stage, self.deadline = set(), None, "", 0.0

    def begin(self, index, limit):
        """Send a case."""
        family = family_of(index)
        slack = 0.0 if family in self.known else COMPILE_TIME
        self.known.add(family)
        self.index, self.stage = index, "drawing"
        self.deadline = time.monotonic() + limit + slack
        self.link.send(index)

    def result(self):
        """The Verdict that has come, or None after a mere report."""
        try:
            message = self.link.recv()
        except EOFError:
            return Verdict(self.index, family_of(self.index), "crash", "the process died")
        if isinstance(message, str):
            self.stage = message
            return None
        return message

    def late(self):
        """The Verdict of a case that was cut off."""
        verdict = Verdict(self.index, family_of(self.index), "hang", f"while {self.stage}")
        if self.stage == "judging":
            verdict.kind, verdict.detail = "right", "finished, but the judge took too long"
        return verdict

    def stop(self):
        """End the process."""
        self.process.kill()
        self.process.join()


def judge_all(indices, workers, limit, tell):
    """Verdicts of the cases, by ``workers`` processes, at most ``limit`` seconds each."""
    context = multiprocessing.get_context("spawn")
    waiting, found = list(indices)[::-1], []
    crew = [Worker(context) for _ in range(workers)]
    busy = [worker for worker in crew if start_next(worker, waiting, limit)]
    while busy:
        ready = wait([worker.link for worker in busy], timeout=1.0)
        for worker in list(busy):
            verdict = settle(worker, ready)
            if verdict is None:
                continue
            found.append(verdict)
            tell(found)
            busy.remove(worker)
            if verdict.kind in ("hang", "crash") or "too long" in verdict.detail:
                worker.stop()
                worker = Worker(context)
                crew.append(worker)
            if start_next(worker, waiting, limit):
                busy.append(worker)
    for worker in crew:
        worker.stop()
    return found


def start_next(worker, waiting, limit):
    """Give the worker a case; False where none is left."""
    if not waiting:
        return False
    worker.begin(waiting.pop(), limit)
    return True


def settle(worker, ready):
    """The Verdict of a worker's case, if it has come or is overdue."""
    if worker.link in ready:
        return worker.result()
    if time.monotonic() > worker.deadline:
        return worker.late()
    return None
