"""What the system asks of a process: to stop in time, and to do with the memory that it may take.

Signals are noted at once, and answered by ending cleanly in time. SIGTERM, SIGINT and SIGUSR1
(Slurm's warnings, Ctrl-C), SIGHUP (a terminal that closes) and SIGXCPU (a limit of CPU time) only
set a flag, which the run reads between replicates. Python calls its
own handlers between two bytecodes of the main thread only, so a thread that waits on a pipe, to
which the C handler writes, ends the process where the main thread stays in compiled code: all that
was computed before is in the journal already.

Too little memory is told before it hangs or crashes a library. Imports nothing of flocsim and
nothing slow: it is asked before numpy is loaded.
"""

import contextlib
import os
import signal
import stat
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any


@contextlib.contextmanager
def deferred(*numbers: int) -> Iterator[None]:
    """Answer signals at the end of the block if they come inside, whichever thread receives them.

    Blocking it in this thread would not do: the system hands it to another one then, of a library
    of linear algebra for example, and Python calls its handler here all the same.
    """
    if threading.current_thread() is not threading.main_thread():  # handlers are not called here
        yield
        return
    received: list[int] = []
    before = {k: signal.signal(k, lambda number, _: received.append(number)) for k in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for number in dict.fromkeys(received):
            signal.raise_signal(number)


STOPPED = 75
"""Exit code of a run that was stopped early and can be resumed."""

WITHHELD = 65
"""Exit code of a study that is complete, but leaves rates open: too many points are undecided."""

INTERRUPTED = 130
"""Exit code where somebody insists: a second signal ends the process at once."""

PATIENCE = 1.2
"""Seconds after a signal in which the run may end by itself."""

SHORTEST_PATIENCE = 0.3
"""Seconds that it has at least, from when it has joined the other ranks."""

HEAD_START = 0.7
"""Seconds that a process has more where another speaks for it, whom its end might cut short."""

LAUNCHER_RANKS = ("PMI_RANK", "OMPI_COMM_WORLD_RANK", "PMIX_RANK")
"""Environment variables that only a process started by an MPI launcher has."""

INSISTENCE = 0.25
"""Seconds within which a second signal is taken for the same one: a launcher forwards what the
whole process group has got as well."""

PARENT_SECONDS = 0.5
"""Seconds between two looks at whether the launcher still lives."""

SIGNALS = tuple(
    getattr(signal, name)
    for name in ("SIGTERM", "SIGINT", "SIGUSR1", "SIGHUP", "SIGXCPU") if hasattr(signal, name)
)  # fmt: skip
"""Signals that end a run in good order, its state saved."""

OTHER_LAUNCHERS = ("PMI_PORT", "PMI_CONTROL_PORT", "PMIX_", "OMPI_", "PALS_", "ALPS_")
"""Starts of environment variables by which launchers connect their ranks, but for PMI_FD."""

LOADING = 700 * 10**6
"""Address space [bytes] for Python, numpy, numba and their libraries, with a study's data."""

COMPILING = 1500 * 10**6
"""The same while an engine is compiled."""

WAITING = "flocsim waits"
"""Name of our threads that only wait, for a signal or the end of another process: a process may be
forked beside them."""

BLAS_THREADS = "OPENBLAS_NUM_THREADS"

FAILED = 70


class Interruption:
    """What this process has been asked to do; one for each process.

    ``held``: the process has yet to join the other ranks of its job, who would wait for it for
    ever if it went now; ``leave(code)`` ends it, and under MPI them; ``speaks``: it may say so.
    ``kept()`` says what has been saved, ``command`` is the command line that continues the run.
    """

    def __init__(self) -> None:
        self.signal = 0
        self.since = 0.0
        self.installed = False
        self.speaks = True
        self.held = False
        self.kept: Callable[[], str] = str
        self.command = ""
        self.leave: Callable[[int], Any] = os._exit

    @property
    def requested(self) -> bool:
        return self.signal != 0

    @property
    def name(self) -> str:
        """Name of the signal, "SIGTERM"."""
        return signal.Signals(self.signal).name if self.signal else "no signal"

    def farewell(self) -> str:
        """Return why the run stops, what is saved and, as the last line, how it goes on."""
        who, kept = self.name if self.requested else "a signal to another rank", self.kept()
        line = f"flocsim: stopped by {who}" + (f": {kept}" if kept else "")
        return f"{line}\n{self.command}" if self.command else line

    def note(self, number: int) -> None:
        """A signal has come: remember it, or end at once where it is the second."""
        now = time.monotonic()
        # Beyond its limit of CPU time a process gets SIGXCPU every second: nobody insists.
        insists = number != getattr(signal, "SIGXCPU", 0)
        if self.signal and insists and now - self.since > INSISTENCE:
            os._exit(INTERRUPTED)
        if not self.signal:
            self.signal, self.since = number, now


INTERRUPTION = Interruption()


def stop_requested() -> bool:
    """Whether this process has been asked to stop."""
    return INTERRUPTION.requested


def forget_left_over_launch() -> None:
    """Remove PMI_RANK and PMI_SIZE from the environment where no launcher can have set them.

    MPICH's launchers, and those that speak its protocol, connect a rank by a socket, whose number
    is PMI_FD, or by a port. Without one, the variables are left over from another job, and MPI
    would count this process alone: so does flocsim, which says so.
    """
    names = [name for name in ("PMI_RANK", "PMI_SIZE") if name in os.environ]
    if not names or os.name == "nt" or any(name.startswith(OTHER_LAUNCHERS) for name in os.environ):
        return
    with contextlib.suppress(KeyError, ValueError, OSError):
        if stat.S_ISSOCK(os.fstat(int(os.environ["PMI_FD"])).st_mode):
            return
    found = " and ".join(f"{name}={os.environ.pop(name)}" for name in names)
    os.environ.pop("MPI_LOCALNRANKS", None)
    print(
        f"flocsim: {found} in the environment are left over from another job, since no launcher "
        f"is connected (PMI_FD): one rank runs; to silence this: unset {' '.join(names)}",
        file=sys.stderr,
    )  # fmt: skip


def handle(action: Any) -> None:
    """Handle all SIGNALS by an action; a SIGHUP that nohup ignores stays ignored."""
    for number in SIGNALS:
        if signal.Signals(number).name != "SIGHUP" or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, action)


def install() -> None:
    """Take over the signals; only in the main thread of a program, and only once."""
    if INTERRUPTION.installed or threading.current_thread() is not threading.main_thread():
        return
    forget_left_over_launch()
    INTERRUPTION.installed = True
    INTERRUPTION.held = any(name in os.environ for name in LAUNCHER_RANKS)
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    handle(lambda *_: None)
    threading.Thread(target=watch, args=(reading,), daemon=True, name=WAITING).start()


def watch(reading: int) -> None:
    """Note the signals that come through the pipe; the first one starts the clock."""
    while True:
        for number in os.read(reading, 64):
            if number in SIGNALS:
                first = not INTERRUPTION.requested
                INTERRUPTION.note(number)
                if first:
                    threading.Thread(target=end_in_time, daemon=True, name=WAITING).start()


def end_in_time() -> None:
    """End the process where the run has not done so by itself."""
    while INTERRUPTION.held:
        time.sleep(0.05)
    time.sleep(max(INTERRUPTION.since + PATIENCE - time.monotonic(), SHORTEST_PATIENCE))
    time.sleep(0.0 if INTERRUPTION.speaks else HEAD_START)
    # Whatever the main thread may be writing is made to be cut off; what is in a buffer is not.
    with contextlib.suppress(Exception):
        sys.stdout.flush()
        if INTERRUPTION.speaks:
            print(INTERRUPTION.farewell(), file=sys.stderr, flush=True)
    INTERRUPTION.leave(STOPPED)


def end_with_parent(parent: int | None = None) -> None:
    """End this process when the one that started it is gone: a rank without its launcher.

    ``parent``: its number, where it may be gone already; what multiprocessing started knows it.
    """
    import multiprocessing

    if parent is None:
        starter = multiprocessing.parent_process()
        parent = os.getppid() if starter is None or starter.pid is None else starter.pid

    def look() -> None:
        while os.getppid() == parent:
            time.sleep(PARENT_SECONDS)
        os._exit(STOPPED)

    threading.Thread(target=look, daemon=True, name=WAITING).start()


def address_space() -> float:
    """Bytes of address space that this process may take (`ulimit -v`); infinite without a limit."""
    try:
        import resource
    except ImportError:
        return float("inf")  # Windows
    least, _ = resource.getrlimit(resource.RLIMIT_AS)
    return float("inf") if least == resource.RLIM_INFINITY else least


def is_limited() -> bool:
    return address_space() < float("inf")


def lacking(needed: float, work: str) -> str:
    """One line where the address space will not do for some work; "" where it does."""
    found = address_space()
    if found >= needed:
        return ""
    return (
        f"the address space is limited to {found / 1e6:.0f} MB, and {work} takes "
        f"{needed / 1e6:.0f} MB: raise the limit (ulimit -v, or the batch system's)"
    )


def check_memory() -> None:
    """End the process in one line where its libraries could not be loaded.

    OpenBLAS spins without end where it gets no memory for its threads, each of which asks for some
    hundred MB of addresses; under a limit it gets one thread, unless the user has chosen.
    """
    if not is_limited():
        return
    os.environ.setdefault(BLAS_THREADS, "1")
    if text := lacking(LOADING, "loading flocsim"):
        print(f"flocsim: {text}", file=sys.stderr)
        sys.exit(FAILED)
