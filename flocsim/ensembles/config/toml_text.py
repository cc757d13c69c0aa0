"""The text of a TOML file: read, parsed, and the lines of its keys."""

import itertools
import os
import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

from flocsim.ensembles.config.text_limits import LARGEST_FILE, key_problem, text_problem
from flocsim.errors import ConfigError

DEEPEST_TABLE = 2
"""[forces.NAME] lies two keys deep; what is nested further is no table of the schema."""

TOML_PLACE = re.compile(r"(.*) \(at (?:line (\d+), column (\d+)|end of document)\)", re.DOTALL)
MOST_ATTEMPTS = 300
CLOSERS = ("]", "}", '"""', "'''")


STANDARD_INPUT = "-"
"""Stands for a config that comes through a pipe."""


def read_text_file(path: str | os.PathLike) -> str:
    """The text of the file, its line ends as "\\n"; ConfigError of one line where there is none.

    "-" is the standard input.
    """
    try:
        if str(path) == STANDARD_INPUT:
            found = sys.stdin.buffer.read(LARGEST_FILE + 1)
            return found.decode("utf-8-sig").replace("\r\n", "\n")
        if not Path(path).exists():
            raise ConfigError(f"{path}: there is no such file; `flocsim init {path}` writes one")
        if not Path(path).is_file():
            raise ConfigError(f"{path}: not an ordinary file; name a TOML config file")
        if Path(path).stat().st_size > LARGEST_FILE:
            raise ConfigError(
                f"{path}: larger than {LARGEST_FILE // 1000} kB; name a TOML config file"
            )
        # A byte order mark is what some editors for Windows put in front.
        return Path(path).read_bytes().decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        raise ConfigError(
            f"{path}: byte {error.start} is not UTF-8 text; name a TOML config file"
        ) from error
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ConfigError(f"{path}: could not be read: {reason}") from error


def parse(path: str | os.PathLike, text: str) -> dict:
    """The TOML tables; ConfigError with file and line where the text is not TOML.

    So for a text beyond the limits of `flocsim.ensembles.config.text_limits`.
    """
    beyond = text_problem(text)
    if beyond is not None:
        place = f"{path}:{beyond[0]}" if beyond[0] else path
        raise ConfigError(f"{place}: {beyond[1]}: no config needs that; name a TOML config file")
    try:
        tables = tomllib.loads(text)
        if wrong := key_problem(tables):
            raise ConfigError(f"{path}: {wrong}: no config needs that")
        return tables
    except RecursionError as error:
        raise ConfigError(f"{path}: not valid TOML: nested too deeply") from error
    except ValueError as error:
        # tomllib says "WHAT (at line 3, column 5)".
        match = TOML_PLACE.fullmatch(str(error))
        if not match:
            what = str(error).split(";")[0]
            raise ConfigError(f"{path}: not valid TOML: {what}") from error
        line = match[2] or len(text.rstrip("\n").split("\n"))
        column = f" (column {match[3]})" if match[3] else ""
        raise ConfigError(f"{path}:{line}: not valid TOML: {match[1]}{column}") from error


def key_lines(text: str) -> dict[tuple[str, ...], int]:
    """Place of every key and table of a valid TOML text → number of its line.

    Each header and each ``key = value`` is valid TOML by itself, so tomllib finds where it ends.
    """
    lines: dict[tuple[str, ...], int] = {}
    header: tuple[str, ...] = ()
    for start, table, is_header in statements(text):
        places = places_in(table)
        header = places[-1] if is_header and places else header
        for place in places:
            lines.setdefault(place if is_header else header + place, start)
    return lines


def statements(text: str) -> Iterator[tuple[int, dict, bool]]:
    """(number of its first line, tables, whether it is a header) of each statement in turn.

    Stops early in a statement of very many lines, each of which might be the last.
    """
    statement, start, attempts = "", 1, 0
    for number, line in enumerate(text.split("\n"), 1):
        start, attempts = (start, attempts) if statement else (number, 0)
        may_end = not statement or may_close(line)
        statement += line + "\n"
        if not may_end:
            continue
        table = parse_or_none(statement)
        if table is not None:
            yield start, table, statement.lstrip().startswith("[")
            statement = ""
        attempts += 1
        if attempts > MOST_ATTEMPTS:
            return


def may_close(line):
    """Whether a list or a string of many lines can end here; spares a parse of what goes on."""
    code = line.split("#")[0].rstrip()
    return not code.endswith(",") and any(closer in line for closer in CLOSERS)


def parse_or_none(statement):
    try:
        return tomllib.loads(statement)
    except (ValueError, RecursionError):
        return None


def places_in(table, around=()):
    """The places of all keys in a nested table as deep as the schema goes, outer ones first."""
    if isinstance(table, list):
        return list(itertools.chain.from_iterable(places_in(item, around) for item in table))
    if not isinstance(table, dict) or len(around) > DEEPEST_TABLE:
        return []
    places = []
    for key, value in table.items():
        places += [(*around, key), *places_in(value, (*around, key))]
    return places
