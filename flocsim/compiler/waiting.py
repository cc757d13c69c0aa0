"""What is said to whoever waits for a compiler: one line, and nothing where nothing is compiled."""

import contextlib
import sys
from collections.abc import Callable, Iterator
from typing import Any

SECONDS_OF_A_FUNCTION = 0.035
"""Seconds that one function of an engine takes (benchmarks/speed/compile_times.py): of some 400."""

WORTH_SAYING = 2.0
"""Seconds below which nothing is said: the laws of a scene and the parts of a fit take less."""


@contextlib.contextmanager
def one_line(text: str) -> Iterator[None]:
    """A line on stderr: how a library waits. A command puts another in its place."""
    print(f"flocsim: {text}", file=sys.stderr, flush=True)
    yield


@contextlib.contextmanager
def silent(text: str) -> Iterator[None]:
    """Nothing: for processes of which another one speaks."""
    yield


shown: Callable[[str], Any] = one_line
"""How the line is shown: a context that lasts as long as the compiler works."""


def show_by(way: Callable[[str], Any]) -> None:
    """From now on show the line in this way."""
    global shown
    shown = way


def compiling(what: str, functions: int) -> Any:
    """A context in which so many functions are compiled; ``what`` they are, together."""
    seconds = SECONDS_OF_A_FUNCTION * functions
    if seconds < WORTH_SAYING:
        return contextlib.nullcontext()
    about = max(5, 5 * round(seconds / 5))
    return shown(f"first run: compiling {what}, about {about} s, once")
