"""What a person sees while a command works: its lines, its warnings, and how far it has come."""

import os
import sys
import time
import warnings
from typing import TextIO

LINE_SECONDS = 5.0
"""Seconds between two lines where the output is no terminal."""

BAR_SECONDS = 0.2
"""Seconds between two renewals on a terminal."""


def duration(seconds: float) -> str:
    """Seconds in words: 42 s, 3 min 10 s, 2 h 05 min."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    if seconds < 6000:
        return f"{int(seconds) // 60} min {int(seconds) % 60:02d} s"
    return f"{int(seconds) // 3600} h {int(seconds) % 3600 // 60:02d} min"


def plain_warnings(silent: bool = False) -> None:
    """From now on a warning is one line on stderr, without the place in the code; or none."""

    def show(message, category, filename, lineno, file=None, line=None):
        if not silent:
            print(f"flocsim: {message}", file=sys.stderr, flush=True)

    warnings.showwarning = show


def tell(text: str, stream: TextIO | None = None, end: str = "\n") -> None:
    """Print; a reader that has gone (`| head`), or a full disk, must not cost a study its results.

    What cannot be printed is lost, and so is what comes after it; the exit code says the rest.
    """
    stream = stream or sys.stdout
    try:
        print(text, end=end, file=stream, flush=True)
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


class Progress:
    """How far a long work is: whole lines, or on a terminal one line that renews itself."""

    def __init__(
        self, total: int, quiet: bool, stream: TextIO | None = None, noun: str = "replicates"
    ) -> None:
        """``total`` replicates, or what the noun says; nothing is printed where ``quiet``."""
        self.total = self.todo = total
        self.quiet = quiet
        self.noun = noun
        self.stream = stream or sys.stdout
        self.tty = self.stream.isatty()
        self.began = time.monotonic()
        self.printed = self.began

    def say(self, text: str) -> None:
        if not self.quiet:
            tell(text, self.stream)

    def warn(self, text: str) -> None:
        """Print a line on stderr, quiet or not."""
        tell(f"flocsim: {text}", sys.stderr)

    def start(self, todo: int) -> None:
        """The work begins now, and is so much of the total."""
        self.todo = todo
        self.began = self.printed = time.monotonic()

    def report(self, missing: int) -> None:
        share = (self.todo - missing) / self.todo if self.todo else 1.0
        now = time.monotonic()
        if self.quiet or now - self.printed < (BAR_SECONDS if self.tty else LINE_SECONDS):
            return
        self.printed = now
        left = (now - self.began) * (1.0 - share) / share if share > 0.0 else 0.0
        text = f"{share:4.0%}  {self.total - missing} of {self.total} {self.noun}, "
        text += f"{duration(left)} left"
        if self.tty:
            tell(f"\r{text:<70}", self.stream, end="")
        else:
            tell(text, self.stream)

    def finish(self) -> float:
        """End the line that renews itself; the seconds since the start."""
        if self.tty and not self.quiet:
            tell("\r" + " " * 70 + "\r", self.stream, end="")
        return time.monotonic() - self.began
