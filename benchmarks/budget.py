"""A budget of CPU time for each case of a benchmark, whatever the engine does in it.

A case that minds its budget by itself says how far it came. One that does not is cut off by the
operating system, in a process of its own, and gives what it has told by then.
"""

import multiprocessing
import resource
import time

COMPILE_TIME = 300
"""CPU seconds that a case of a new kind may take longer: code may have to be compiled."""

LOAD_TIME = 30
"""CPU seconds that the first case of a process may take longer: code has to be loaded."""

FORBEARANCE = 2
"""A case is cut off where it has taken so many times its budget."""


class Stopwatch:
    """CPU seconds of this process since it was made, and whether a budget of them is spent."""

    def __init__(self, budget=float("inf")):
        self.began, self.budget = time.process_time(), budget

    @property
    def seconds(self):
        return time.process_time() - self.began

    @property
    def spent(self):
        return self.seconds > self.budget


def serve(function, link):
    """The life of a process: run the cases that it is sent."""
    while (message := link.recv()) is not None:
        case, seconds, allowed = message
        most = int(time.process_time() + allowed) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (most, resource.RLIM_INFINITY))
        link.send((True, function(case, seconds, lambda told: link.send((False, told)))))


class Server:
    """A process that runs cases, until one of them takes too long."""

    def __init__(self, function):
        context = multiprocessing.get_context("spawn")
        self.link, other = context.Pipe()
        self.process = context.Process(target=serve, args=(function, other), daemon=True)
        self.process.start()
        other.close()

    def run(self, case, seconds, allowed):
        """(whether it came to its end, what the function gives, or has told last); a function that
        was cut off before it told anything gives None."""
        self.link.send((case, seconds, allowed))
        ended, found = False, None
        try:
            while not ended:
                ended, found = self.link.recv()
        except EOFError:
            pass
        return ended, found

    def stop(self):
        self.process.kill()
        self.process.join()


def run_each(function, cases, seconds, kind=lambda case: None):
    """Yield (case, function(case, seconds, tell)) of each, or what was last given to ``tell``, or
    None, of one that was cut off. ``function``: of a module; ``seconds``: CPU time of a case. The
    first case of each ``kind(case)`` is run once before, so that no budget goes into compiling."""
    server, known, fresh = Server(function), set(), False

    def run(case, extra):
        nonlocal server, fresh
        ended, found = server.run(case, seconds, FORBEARANCE * seconds + extra)
        fresh = not ended
        if fresh:
            server.stop()
            server = Server(function)
        return found

    try:
        for case in cases:
            if kind(case) not in known:
                known.add(kind(case))
                run(case, COMPILE_TIME)
            yield case, run(case, LOAD_TIME if fresh else 0)
    finally:
        server.stop()
