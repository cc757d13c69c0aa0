"""What a person sees while a command works: its lines, its warnings, and how far it has come.

All that a command prints goes through a PlainStream: letters that steer a terminal are written
out, since names of files and what files hold come from others, and a stream that is closed or full
costs what would be printed and nothing else.
"""

import contextlib
import errno
import os
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import product
from typing import Any, TextIO

from flocsim.compiler import units
from flocsim.errors import visible

LINE_SECONDS = 5.0
"""Seconds between two lines where the output is no terminal."""

BAR_SECONDS = 0.2
"""Seconds between two renewals on a terminal."""

WIDTH = 78
"""Letters of a line that renews itself: one that goes on in the next line would stay there."""


def duration(seconds: float) -> str:
    """Return seconds in words: 42 s, 3 min 10 s, 2 h 05 min."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    if seconds < 6000:
        return f"{int(seconds) // 60} min {int(seconds) % 60:02d} s"
    return f"{int(seconds) // 3600} h {int(seconds) % 3600 // 60:02d} min"


def aligned(rows: Sequence[Sequence[str]], left: int = 0, gap: str = "  ") -> list[str]:
    """Return lines of a table, each column as wide as its widest word and set to the right, but for
    the first ``left`` columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    sides = "<" * left + ">" * (len(widths) - left)
    forms = [f"{side}{width}" for side, width in zip(sides, widths, strict=True)]
    return [gap.join(map(format, row, forms)).rstrip() for row in rows]


def in_words(value: object) -> str:
    """Return a coordinate as text that steers no terminal."""
    return f"{value:g}" if isinstance(value, float) else visible(str(value), "")


def rows_along(
    axes: Mapping[str, Any], heads: Sequence[str],
    row: Callable[[tuple[int, ...]], Sequence[str]],
    places: Iterable[tuple[int, ...]] | None = None,
) -> list[list[str]]:  # fmt: skip
    """Return heads, and a row for every place along some axes, or for these ``places``.

    ``axes`` {name: values}: the coordinates, with which each row begins; ``row``: the cells that
    follow at a place, which has an index along each of the axes.
    """
    rows = [[*axes, *heads]]
    every = product(*(range(len(each)) for each in axes.values()))
    for place in every if places is None else places:
        keys = [in_words(values[k]) for values, k in zip(axes.values(), place, strict=True)]
        rows.append([*keys, *row(place)])
    return rows


def markdown_table(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table as text without a newline at its end; cells are shown by ``str``.

    A bar inside a cell does not end it.
    """
    lines: list[Sequence[object]] = [heads, ["---"] * len(heads), *rows]
    cells = ([str(cell).replace("|", "\\|") for cell in line] for line in lines)
    return "\n".join("| " + " | ".join(line) + " |" for line in cells)


def plain_warnings(silent: bool = False) -> None:
    """Show warnings, and what is compiled, as one line on stderr from now on, or not at all."""
    units.quiet = silent

    def show(message, category, filename, lineno, file=None, line=None):
        if not silent:
            print(f"flocsim: {message}", file=sys.stderr, flush=True)

    warnings.showwarning = show


class PlainStream:
    """Standard output or error: what is written to it is made visible, and may be lost.

    ``problem``: the OSError by which something was lost, if it was.
    """

    def __init__(self, stream: Any) -> None:
        self.problem = None if stream else OSError(errno.EBADF, "it is closed")
        self.stream = stream or open(os.devnull, "w")  # noqa: SIM115 (as long as the process)
        if hasattr(stream, "reconfigure"):
            # A letter that a terminal does not know must not end a command, and a line that goes
            # into a pipe or a file is to be seen when it is printed.
            stream.reconfigure(errors="replace", line_buffering=True)

    def write(self, text: str) -> int:
        """Write a text; a carriage return begins the line anew, as `Progress` does."""
        self.attempt(self.stream.write, visible(text, "\n\t\r"))
        return len(text)

    def flush(self) -> None:
        """Hand over what is in the buffer."""
        self.attempt(self.stream.flush)

    def attempt(self, work: Any, *words: str) -> None:
        """Do it, unless something was lost already."""
        if self.problem is not None:
            return
        try:
            work(*words)
        except (OSError, ValueError) as error:
            self.problem = error if isinstance(error, OSError) else OSError(str(error))
            # What is in the buffer goes nowhere, without another word at the end of the process.
            with contextlib.suppress(OSError, ValueError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), self.stream.fileno())

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


@contextlib.contextmanager
def plain_streams() -> Iterator[None]:
    """Make standard output and error PlainStreams, also where they were closed; as before after."""
    before = sys.stdout, sys.stderr
    if not isinstance(sys.stdout, PlainStream):
        sys.stdout, sys.stderr = PlainStream(sys.stdout), PlainStream(sys.stderr)
    try:
        yield
    finally:
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(OSError, ValueError):
                stream.flush()
        # Closed ones stay what they became: the interpreter flushes them once more.
        if None not in before:
            sys.stdout, sys.stderr = before


def output_problem() -> str:
    """Return why standard output was lost; "" where it was not, or its reader has just gone."""
    sys.stdout.flush()
    problem = getattr(sys.stdout, "problem", None)
    if problem is None or isinstance(problem, BrokenPipeError):
        return ""
    return f"standard output could not be written: {problem.strerror or problem}"


class Progress:
    """How far a long work is: whole lines, or on a terminal one line that renews itself."""

    def __init__(
        self, total: int, quiet: bool, stream: TextIO | None = None, noun: str = "replicates"
    ) -> None:
        """``total`` replicates, or what the noun says; nothing is printed where ``quiet``."""
        self.total, self.quiet, self.noun = total, quiet, noun
        self.stream = sys.stdout if stream is None else stream
        self.tty = self.stream.isatty()
        self.start(total)

    def say(self, text: str) -> None:
        """Print a line, unless quiet."""
        if not self.quiet:
            print(text, file=self.stream, flush=True)

    def warn(self, text: str) -> None:
        """Print a line on stderr, quiet or not."""
        print(f"flocsim: {visible(text, keep='')}", file=sys.stderr, flush=True)

    def start(self, todo: int) -> None:
        """Begin with so much of the total to do."""
        self.todo = todo
        self.began = self.printed = time.monotonic()

    def report(self, missing: int, going: str = "") -> None:
        """Print how much is missing; ``going``: how far what runs now is."""
        now = time.monotonic()
        if self.quiet or now - self.printed < (BAR_SECONDS if self.tty else LINE_SECONDS):
            return
        self.printed = now
        share = (self.todo - missing) / self.todo if self.todo else 1.0
        text = f"{share:4.0%}  {self.total - missing} of {self.total} {self.noun}"
        if share > 0.0:
            text += f", {duration((now - self.began) * (1.0 - share) / share)} left"
        text += f"; {going}" if going else ""
        if self.tty:
            self.renew(text)
        else:
            print(text, file=self.stream, flush=True)

    def renew(self, text: str, end: str = "") -> None:
        """Write a line over the last one of a terminal."""
        print(f"\r{text[:WIDTH]:<{WIDTH}}", end=end, file=self.stream, flush=True)

    def finish(self) -> float:
        """End the line that renews itself; return the seconds since the start."""
        if self.tty and not self.quiet:
            self.renew("", end="\r")
        return time.monotonic() - self.began
