"""The ranks of a job behind one interface (`processes` has those that there are), and what they say
to each other while a study runs.

All ranks talk to rank 0 only. Nobody waits inside a library: a rank that waits looks for a message,
then sleeps a little, so that it takes no processor from those who compute, and hears signals.

rank 0 → another rank         the flocs and the identity of its study (or Failed)
every other rank → rank 0     Request, again and again: a chunk's result, and a wish for another
rank 0 → another rank         how many replicates are to be run (or Failed)
                              a Chunk in answer to a Request, None where there is no more
                              Halt, while it works, when its chunk is of no use any more
                              the exit code, after the last answer, when all is written (or Failed)
every other rank → rank 0     Kept and Going, while it works, where replicates take long

Rank 0 counts for how long each rank that owes it a message has been silent (`Silence`), and ends
the job after SILENCE_LIMIT instead of waiting for a process that is stopped or a machine that is
gone. A rank at work sends Going now and then. A rank without rank 0 is ended by its launcher.
"""

import collections
import contextlib
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any

import attrs

from flocsim.errors import FlocsimError
from flocsim.process import INTERRUPTION, STOPPED, stop_requested

if TYPE_CHECKING:
    from flocsim.ensembles.kind import Chunk

SLEEP = 5e-4
"""Seconds between two looks for a message."""

SILENCE_LIMIT = float(os.environ.get("FLOCSIM_SILENCE_LIMIT", "600"))
"""Seconds of silence after which a rank is given up: longer than compiling takes on a busy machine,
during which a rank says nothing."""

LONGEST_LOOK = 10.0
"""Seconds that count at most between two looks: rank 0 may have been suspended itself."""


class StopRequested(FlocsimError):
    """A signal has come while this rank waited for the others."""

    exit_code = 75


class SilentRank(FlocsimError):
    """A rank has sent nothing for too long."""

    exit_code = STOPPED


class Silence:
    """Counts for how many seconds each of some ranks has been silent.

    Time in which this process itself was suspended does not count: a job that is suspended as a
    whole, or a laptop that sleeps, goes on where it was.
    """

    def __init__(self, ranks: Iterable[int]) -> None:
        self.seconds = dict.fromkeys(ranks, 0.0)
        self.looked = time.monotonic()

    def look(self) -> None:
        """Count the time since the last look; SilentRank where a rank has been silent too long."""
        now = time.monotonic()
        passed, self.looked = min(now - self.looked, LONGEST_LOOK), now
        for rank in self.seconds:
            self.seconds[rank] += passed
            if self.seconds[rank] > SILENCE_LIMIT:
                raise SilentRank(
                    f"rank {rank} has been silent for {SILENCE_LIMIT:g} s (its process is stopped, "
                    "or its machine is gone); what was computed is kept: continue with --resume"
                )


@attrs.frozen
class ChunkResult:
    """What came of a chunk: the ``rows`` of its first replicates, and ``notes`` on those that have
    failed."""

    chunk: "Chunk"
    rows: Any
    notes: tuple[dict, ...] = ()


@attrs.frozen
class Kept:
    """A part of an unfinished replicate of the condition at a place, which is to be saved."""

    condition: int
    replicate: int
    name: str
    about: dict
    data: bytes


@attrs.frozen
class Going:
    """How far a rank's replicate is, in words."""

    words: str


@attrs.frozen
class Request:
    """A rank has finished its chunk (``result`` None: has had none yet) and asks for another.

    ``interrupted``: a signal has asked it to stop.
    """

    result: ChunkResult | None
    interrupted: bool


@attrs.frozen
class Halt:
    """Give up the replicate at hand, and hand in what is finished."""


class Failed(FlocsimError):
    """What the other ranks get of an error of rank 0, which says why: its exit code."""

    def __init__(self, exit_code: int) -> None:
        super().__init__(exit_code)
        self.exit_code = exit_code


class SharedError(Exception):
    """An error that has ended the study on all ranks; the argument is the error on rank 0, and a
    `Failed` with its exit code on the others."""


class Communicator:
    """Messages between rank 0 and the others, and what can be made of them; by itself one process
    alone, what a job without a launcher runs on.

    A subclass has ``rank``, ``size``, ``send(to, message)``, ``abort(code)``, which ends the whole
    job, and ``arrived()``, which yields (source, message) of all that has come in. ``threads`` says
    whether a thread of rank 0 may send and receive while the main one computes, ``is_launched``
    whether an MPI launcher has started the ranks.
    """

    rank = 0
    size = 1
    threads = True
    is_launched = False

    def __init__(self) -> None:
        self.inbox: dict[int, collections.deque] = collections.defaultdict(collections.deque)

    def send(self, to: int, message: Any) -> None:
        """Send nothing: there is no other rank."""

    def arrived(self) -> Iterable[tuple[int, Any]]:
        return ()

    def abort(self, code: int) -> None:
        sys.exit(code)

    def take_in(self) -> None:
        """Put what has come into the inbox."""
        for source, message in self.arrived():
            self.inbox[source].append(message)

    def messages(self) -> Iterator[tuple[int, Any]]:
        """Yield (source, message) of all that has arrived."""
        self.take_in()
        for source in [source for source, queue in self.inbox.items() if queue]:
            while self.inbox[source]:
                yield source, self.inbox[source].popleft()

    def receive(self, source: int, heed_signals: bool = True) -> Any:
        """Return the next message of a rank; SharedError where an error has ended rank 0 instead.

        On rank 0, StopRequested where a signal comes first, and SilentRank where nothing comes for
        too long.

        The other ranks wait for rank 0 to end the job, which says why: one that ended it first
        would cut that short. Where rank 0 does not, flocsim.process does.
        """
        silence = Silence([source] if self.rank == 0 else [])
        while not self.inbox[source]:
            self.take_in()
            if self.inbox[source]:
                break
            if heed_signals and self.rank == 0 and stop_requested():
                raise StopRequested(f"stopped by {INTERRUPTION.name}")
            silence.look()
            time.sleep(SLEEP)
        message = self.inbox[source].popleft()
        if isinstance(message, Failed):
            raise SharedError(message)
        return message

    def gather(self, value: Any, heed_signals: bool = True) -> list | None:
        """Return the values of all ranks on rank 0, None on the others."""
        if self.rank > 0:
            self.send(0, value)
            return None
        return [value, *(self.receive(rank, heed_signals) for rank in range(1, self.size))]

    def broadcast(self, value: Any) -> Any:
        """Return rank 0's value on all ranks."""
        if self.rank > 0:
            return self.receive(0)
        for rank in range(1, self.size):
            self.send(rank, value)
        return value

    def barrier(self, heed_signals: bool = True) -> None:
        self.broadcast(self.gather(None, heed_signals))

    @contextlib.contextmanager
    def sharing_errors(self, call_back: Callable[[], bool] = lambda: True) -> Iterator[None]:
        """Let an error of rank 0 end the other ranks in good order, so that all have one exit code.

        ``call_back`` calls them back from their work first; False where one of them does not come.
        """
        try:
            yield
        except FlocsimError as error:
            if not call_back():
                raise
            self.broadcast(Failed(error.exit_code))
            raise SharedError(error) from error

    def agree(self, problem: FlocsimError | None) -> None:
        """Go on once no rank has a problem; SharedError on all ranks where one has."""
        with self.sharing_errors():
            for each in self.gather(problem) or []:
                if each is not None:
                    raise each
        self.broadcast(None)

    def close(self) -> None:
        """Wait until all ranks have finished their work, and let them end."""
        self.barrier(heed_signals=False)
