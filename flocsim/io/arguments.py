"""The parser of the command line: help from docstrings, types of values, and errors in one line."""

import argparse
import inspect
import re
import sys
from collections.abc import Callable
from typing import Any, NoReturn

from flocsim.errors import suggestion

CHOICE = re.compile(r"invalid choice: '(.*?)' \(choose from (.*)\)", re.DOTALL)


class Parser(argparse.ArgumentParser):
    """An ArgumentParser, also of subcommands, whose errors are one line, with what may be meant."""

    words: list[str] = []  # noqa: RUF012 (set anew by each parse)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse as argparse does, but refuse unknown words here, where the options are known."""
        self.words = list(sys.argv[1:] if args is None else args)
        found, unknown = super().parse_known_args(self.words, namespace)
        if unknown:
            self.error(f"unrecognized arguments: {' '.join(unknown)}")
        return found, unknown

    def error(self, message: str) -> NoReturn:
        """End with what is wrong, and the word that is nearest to a misspelt one."""
        if choice := CHOICE.search(message):
            message += suggestion(choice[1], re.findall(r"[\w-]+", choice[2]))
        known = self._option_string_actions
        for name in (word.partition("=")[0] for word in self.words):
            if name.startswith("--") and not any(each.startswith(name) for each in known):
                message += suggestion(name, known)
        self.exit(2, f"{self.prog}: error: {message}; {self.prog} --help lists all\n")


def document(parser: argparse.ArgumentParser, *texts: str | None) -> None:
    """Take a parser's description and the help of its arguments from docstrings.

    In the first text, or in a later one, an argument has a paragraph of its own, whose further
    lines are indented: ``--option METAVAR: help``, or ``name METAVAR: help`` of a positional one.
    What the first has besides these is the description. An argument added with a help keeps it.
    """
    cleaned = [inspect.cleandoc(text or "") for text in texts]
    for action in parser._actions:
        name = max(action.option_strings, key=len, default=action.dest)
        entry = re.compile(rf"^{name}( [^:\n]+)?: (.*(?:\n    .*)*)\n?", re.MULTILINE)
        found = next(filter(None, map(entry.search, cleaned)), None)
        if found is not None and action.help is None:
            action.metavar = found[1].strip() if found[1] else action.metavar
            action.help = re.sub(r"%(?!\()", "%%", " ".join(found[2].split()))
            cleaned[0] = cleaned[0].replace(found[0], "")
    parser.description = parser.description or cleaned[0].strip()
    parser.formatter_class = argparse.RawDescriptionHelpFormatter


def number(meaning: str, least: float, most: float) -> Callable[[str], float]:
    """Return a type of argparse: a number from ``least`` to ``most``, in words ``meaning``."""

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f"takes {meaning}, found {text!r}")
        return value

    return read


positive = number("a number above 0", 5e-324, 1.7e308)


def whole(text: str) -> int:
    """Read a whole number from 1, as a type of argparse."""
    if not text.strip().isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"takes whole numbers from 1, found {text!r}")
    return int(text)


def several(read: Callable[[str], Any]) -> Callable[[str], list]:
    """Return a type of argparse: values of another type, separated by commas."""
    return lambda text: [read(each) for each in text.split(",")]
