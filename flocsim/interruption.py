"""Signals that ask a long run to stop: noted at once, answered by ending cleanly in time.

SIGTERM, SIGINT and SIGUSR1 (Slurm's warnings, Ctrl-C) only set a flag, which the run reads between
replicates. Python calls its own handlers between two bytecodes of the main thread only, so a
thread that waits on a pipe, to which the C handler writes, ends the process where the main thread
stays in compiled code: all that was computed before is in the journal already.
"""

import contextlib
import os
import signal
import sys
import threading
import time

STOPPED = 75
"""Exit code of a run that was stopped early and can be resumed."""

INTERRUPTED = 130
"""Exit code where somebody insists: a second signal ends the process at once."""

PATIENCE = 1.2
"""Seconds after a signal in which the run may end by itself."""

SHORTEST_PATIENCE = 0.3
"""Seconds that it has at least, from when it has joined the other ranks."""

FORWARDING = 0.25
"""Seconds that a launcher has to forward the last words of a rank: it drops what comes with an
abort. Ranks that say nothing wait twice as long before they abort."""

LAUNCHER_RANKS = ("PMI_RANK", "OMPI_COMM_WORLD_RANK", "PMIX_RANK")
"""Environment variables that only a process started by an MPI launcher has."""

INSISTENCE = 0.25
"""Seconds within which a second signal is taken for the same one: a launcher forwards what the
whole process group has got as well."""

PARENT_SECONDS = 1.0
"""Seconds between two looks at whether the launcher still lives."""

SIGNALS = tuple(
    getattr(signal, name) for name in ("SIGTERM", "SIGINT", "SIGUSR1") if hasattr(signal, name)
)


class Interruption:
    """What this process has been asked to do; one for each process.

    ``held``: the process has yet to join the other ranks of its job, who would wait for it for
    ever if it went now; ``leave(code)`` ends it, and under MPI them; ``speaks``: it may say so.
    """

    def __init__(self):
        """Nothing has been asked."""
        self.signal = 0
        self.since = 0.0
        self.installed = False
        self.speaks = True
        self.held = False
        self.leave = os._exit

    @property
    def requested(self):
        """Whether a signal has asked to stop."""
        return self.signal != 0

    @property
    def name(self):
        """Name of the signal, "SIGTERM"."""
        return signal.Signals(self.signal).name if self.signal else "no signal"

    def note(self, number):
        """A signal has come: remember it, or end at once where it is the second."""
        now = time.monotonic()
        if self.signal and now - self.since > INSISTENCE:
            os._exit(INTERRUPTED)
        if not self.signal:
            self.signal, self.since = number, now


INTERRUPTION = Interruption()


def stop_requested():
    """Whether this process has been asked to stop."""
    return INTERRUPTION.requested


def install():
    """Take over the signals; only in the main thread of a program, and only once."""
    if INTERRUPTION.installed or threading.current_thread() is not threading.main_thread():
        return
    INTERRUPTION.installed = True
    INTERRUPTION.held = any(name in os.environ for name in LAUNCHER_RANKS)
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
    for number in SIGNALS:
        signal.signal(number, lambda *_: None)
    threading.Thread(target=watch, args=(reading,), daemon=True).start()


def watch(reading):
    """Note the signals that come through the pipe; the first one starts the clock."""
    while True:
        for number in os.read(reading, 64):
            if number in SIGNALS:
                first = not INTERRUPTION.requested
                INTERRUPTION.note(number)
                if first:
                    threading.Thread(target=end_in_time, daemon=True).start()


def end_in_time():
    """End the process where the run has not done so by itself."""
    while INTERRUPTION.held:
        time.sleep(0.05)
    time.sleep(max(INTERRUPTION.since + PATIENCE - time.monotonic(), SHORTEST_PATIENCE))
    # Whatever the main thread may be writing is made to be cut off; what is in a buffer is not.
    with contextlib.suppress(Exception):
        sys.stdout.flush()
        if INTERRUPTION.speaks:
            print(f"flocsim: stopped by {INTERRUPTION.name}", file=sys.stderr, flush=True)
    if INTERRUPTION.leave is not os._exit:
        time.sleep(FORWARDING if INTERRUPTION.speaks else 2.0 * FORWARDING)
    INTERRUPTION.leave(STOPPED)


def end_with_parent():
    """End this process when the one that started it is gone: a rank without its launcher."""
    parent = os.getppid()

    def look():
        while os.getppid() == parent:
            time.sleep(PARENT_SECONDS)
        os._exit(STOPPED)

    threading.Thread(target=look, daemon=True).start()
