"""Every error that a user can meet, each with the exit code that the command line gives it.

A message is one line: what was found, where, and what to do about it.
"""

import difflib
import re
from collections.abc import Iterable

UNSEEN = re.compile("[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
"""Letters that steer a terminal, turn the direction of what follows, or are no letters."""


def visible(text: str, keep: str = "\n\t") -> str:
    """A text with the letters that no terminal should get written out, as in Python: \\x1b.

    Names of files, of flocs and of types come from others. ``keep``: those that stay.
    """

    return UNSEEN.sub(lambda found: found[0] if found[0] in keep else ascii(found[0])[1:-1], text)


class FlocsimError(Exception):
    """The root of all flocsim's errors; the command line prints its message and no traceback."""

    exit_code = 70
    keep = ""
    """Letters beyond the printable ones that its message may have."""

    def __str__(self) -> str:
        return visible(super().__str__(), self.keep)


class UsageError(FlocsimError):
    """A wrong argument, of a command or of a library call."""

    exit_code = 2


class ConfigError(UsageError):
    """Wrong entries of a config file; each line names the key, the finding, the remedy."""

    keep = "\n"


class RangeError(UsageError, ValueError):
    """A value outside what a field takes."""


class ShapeError(UsageError, ValueError):
    """Vertices or a radius that do not make a body."""


class PlausibilityWarning(UserWarning):
    """What is possible, and done, but implausible: a value far out of its usual range, say."""


class KernelWarning(UserWarning):
    """A run has ended where a force gives no number: it names the force, the file and the line."""


class KernelError(UsageError):
    """A force's kernel that cannot be used: it names the force, the file and the line."""


class ImageError(UsageError):
    """A file that holds no usable picture, or a picture without usable regions."""


class FileError(FlocsimError, OSError):
    """A file that could not be read or written."""

    exit_code = 74


class ZoneError(UsageError):
    """There is no attraction zone: the attraction and the repulsion never balance."""


LONGEST_SHOWN = 60
"""Characters of a word or value in a message."""


def plural(count: int, noun: str, many: str = "") -> str:
    """Return "1 floc", "2 flocs"; ``many``: a plural that has more than an s."""
    return f"{count} {noun if count == 1 else many or f'{noun}s'}"


def closest(word: str, words: Iterable[str]) -> str:
    """Return the one of the words that is nearest to a misspelt one; "" where none is close."""
    near = difflib.get_close_matches(word, words, n=1) if len(word) <= LONGEST_SHOWN else []
    return near[0] if near else ""


def suggestion(word: str, words: Iterable[str]) -> str:
    """Return " (did you mean …?)", or "" where nothing is close."""
    near = closest(word, words)
    return f" (did you mean {near!r}?)" if near else ""
