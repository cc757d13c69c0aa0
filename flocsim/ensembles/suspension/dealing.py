"""Replicates of a swarm study dealt to the ranks of a job, one at a time.

Rank 0 has the journal. It runs replicates like the others, and between its windows, and now and
then within long ones, takes in what they have kept and hands out what is left.
"""

import functools
import time
from collections.abc import Callable

import attrs

from flocsim.ensembles.parallel.communicator import SLEEP, Communicator
from flocsim.ensembles.suspension.records import MOMENT, Part
from flocsim.ensembles.suspension.replicate import Left, run_replicate
from flocsim.ensembles.suspension.study import SwarmStudy
from flocsim.interruption import stop_requested


@attrs.frozen
class Ask:
    """A rank wants a replicate."""


@attrs.frozen
class Kept:
    """A record of a replicate, for the journal; whether it is a snapshot."""

    record: bytes
    is_moment: bool


@attrs.frozen
class Task:
    """A replicate to run, from where it was left; None: there is none."""

    replicate: int | None
    left: Left | None = None


@attrs.frozen
class Alive:
    """How far a replicate is: the time [s] of its window, and the steps tried in that so far."""

    replicate: int
    time: float
    tried: int

    def __str__(self) -> str:
        return f"swarm {self.replicate} at {self.time:.4g} s, {self.tried} steps on"


@attrs.frozen
class Halt:
    """Leave off, keeping the state."""


def kept_of(part: Part) -> Kept:
    return Kept(part.encoded(), part.of == MOMENT)


ALIVE_SECONDS = 1.0
"""Seconds between two messages of a rank that say how far it is."""


class Dealer:
    """Rank 0's: hands out replicates, and keeps what comes in.

    ``append`` takes records; ``told(message)`` is called for each, as Kept, and where a replicate
    goes on, as Alive. ``todo``: replicates that are missing, each with where it was left.
    """

    def __init__(
        self, comm: Communicator, todo: dict[int, Left | None], append: Callable[[bytes], object],
        told: Callable[[Kept | Alive], None],
    ) -> None:  # fmt: skip
        self.comm, self.todo, self.append, self.told = (
            comm,
            dict(sorted(todo.items())),
            append,
            told,
        )
        self.waiting = set(range(1, comm.size))
        self.halted = False

    def next(self) -> Task:
        """The next replicate, the one that was begun longest ago first."""
        if self.halted or not self.todo:
            return Task(None)
        replicate = next(iter(self.todo))
        return Task(replicate, self.todo.pop(replicate))

    def keep(self, kept: Kept) -> None:
        self.append(kept.record)
        self.told(kept)

    def going(self, replicate: int, at: float, tried: int) -> None:
        self.told(Alive(replicate, at, tried))

    def serve(self) -> bool:
        """Take in what has come; whether a signal has asked to stop."""
        if stop_requested() and not self.halted:
            self.halted = True
            for rank in self.waiting:
                self.comm.send(rank, Halt())
        for source, message in self.comm.messages():
            if isinstance(message, Kept):
                self.keep(message)
            elif isinstance(message, Alive):
                self.told(message)
            elif isinstance(message, Ask):
                task = self.next()
                if task.replicate is None:
                    self.waiting.discard(source)
                self.comm.send(source, task)
        return self.halted

    def run(self, study: SwarmStudy) -> None:
        """Run replicates here, and see that all others are done."""
        while (task := self.next()).replicate is not None:
            replicate = task.replicate
            run_replicate(
                study, replicate, lambda part: self.keep(kept_of(part)), task.left, self.serve,
                functools.partial(self.going, replicate),
            )  # fmt: skip
            self.serve()
        while self.waiting:
            self.serve()
            time.sleep(SLEEP)


def follow_dealer(study: SwarmStudy, comm: Communicator) -> None:
    """What every other rank does: run replicates until there are none."""
    halted, said = False, time.monotonic()

    def going(replicate: int, at: float, tried: int) -> None:
        nonlocal said
        if time.monotonic() - said > ALIVE_SECONDS:
            said = time.monotonic()
            comm.send(0, Alive(replicate, at, tried))

    def is_halted() -> bool:
        nonlocal halted
        halted = halted or any(isinstance(each, Halt) for _, each in comm.messages())
        return halted

    while True:
        comm.send(0, Ask())
        while isinstance(task := comm.receive(0), Halt):
            halted = True
        if task.replicate is None:
            return
        run_replicate(
            study, task.replicate, lambda part: comm.send(0, kept_of(part)), task.left, is_halted,
            functools.partial(going, task.replicate),
        )  # fmt: skip
