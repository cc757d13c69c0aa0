"""The text of a TOML file: read, parsed, and the lines of its keys; nested dicts as such a text.

How long and how deeply nested a text may be is said before it is parsed: tomllib takes a time that
grows with the square of a dotted key's parts (90 s for 600 kB of "a.a.a…"), and of other things
that no config has.
"""

import contextlib
import itertools
import json
import os
import re
import sys
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from flocsim.errors import ConfigError

BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")

LARGEST_FILE = 100_000
LONGEST_LINE = 10_000
MOST_LINES = 5_000
MOST_PARTS = 6
DEEPEST = 6
LONGEST_KEY = 100
MOST_KEYS = 2_000

# Strings and comments first, so that what is in them is not taken for keys or brackets. A quote
# that has no end ends the search: tomllib gets no further either.
TOKEN = re.compile(
    r"""(?P<text>'{3}.*?'{3}|"{3}[^"\\]*(?:(?:\\.|"(?!""))[^"\\]*)*"{3}"""
    r"""|"(?!"")[^"\\\n]*(?:\\.[^"\\\n]*)*"|'(?!'')[^'\n]*')|(?P<open>["'])"""
    r"""|(?P<comment>\#[^\n]*)|(?P<mark>[][{}.=\n])""",
    re.DOTALL,
)


def text_problem(text: str) -> tuple[int, str] | None:
    """(line, what is wrong) of the first limit that a TOML text passes; None where it keeps all."""
    if len(text) > LARGEST_FILE:
        return 0, f"longer than {LARGEST_FILE} letters"
    lines = text.split("\n")
    if len(lines) > MOST_LINES:
        return MOST_LINES, f"more than {MOST_LINES} lines"
    for number, line in enumerate(lines, 1):
        if len(line) > LONGEST_LINE:
            return number, f"a line of more than {LONGEST_LINE} letters"
    return next(deep_places(text), None)


def deep_places(text: str) -> Iterator[tuple[int, str]]:
    """(line, what is wrong) of keys of too many parts, of nesting, and of too many keys."""
    line, depth, dots, keys = 1, 0, 0, 0
    for found in TOKEN.finditer(text):
        kind, token = found.lastgroup, found[0]
        if kind == "open":
            return
        if kind == "mark" and token == ".":
            dots += 1
        elif kind == "mark":
            dots = 0
            depth += (token in "[{") - (token in "]}")
            keys += token == "="
        if dots >= MOST_PARTS:
            yield line, f"a key of more than {MOST_PARTS} parts"
        if depth > DEEPEST:
            yield line, f"lists or tables nested more than {DEEPEST} deep"
        if keys > MOST_KEYS:
            yield line, f"more than {MOST_KEYS} keys"
        line += token.count("\n")


def key_problem(table: object) -> str:
    """What is wrong with the keys of a parsed text, in words; "" where nothing is."""
    row = [table]
    while row:
        inner: list = []
        for each in row:
            if isinstance(each, dict):
                long = next((key for key in each if len(key) > LONGEST_KEY), None)
                if long is not None:
                    return f"a key of more than {LONGEST_KEY} letters, {long[:20]!r}…"
                inner += each.values()
            elif isinstance(each, list):
                inner += each
        row = inner
    return ""


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
            raise ConfigError(f"{path}: no such file; `flocsim init {path}` writes one")
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

    So for a text beyond the limits of `flocsim.ensembles.config.toml_text`.
    """
    beyond = text_problem(text)
    if beyond is not None:
        place = f"{path}:{beyond[0]}" if beyond[0] else path
        raise ConfigError(
            f"{place}: {beyond[1]}: a config never needs that; name a TOML config file"
        )
    try:
        tables = tomllib.loads(text)
        if wrong := key_problem(tables):
            raise ConfigError(f"{path}: {wrong}: a config never needs that")
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
        # A list or a string of many lines may end here: spares a parse of what goes on.
        goes_on = line.split("#")[0].rstrip().endswith(",")
        may_end = not goes_on and any(closer in line for closer in CLOSERS)
        may_end, statement = not statement or may_end, statement + line + "\n"
        if not may_end:
            continue
        with contextlib.suppress(ValueError, RecursionError):
            yield start, tomllib.loads(statement), statement.lstrip().startswith("[")
            statement = ""
        attempts += 1
        if attempts > MOST_ATTEMPTS:
            return


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


def toml_text(table: Mapping[str, Any]) -> str:
    """The TOML text of nested dicts; ConfigError for what no config file can hold."""
    return "".join(lines_of(table, ()))


def lines_of(table: Mapping[str, Any], place: tuple[str, ...]) -> Iterator[str]:
    """The lines of one table: its values, then the tables in it, each with its header."""
    given = {key: value for key, value in table.items() if value is not None}
    for key, value in given.items():
        if not isinstance(value, Mapping):
            yield f"{key_text(key)} = {value_text(value, (*place, key))}\n"
    for key, value in given.items():
        if isinstance(value, Mapping):
            inner = (*place, key)
            yield f"\n[{'.'.join(map(key_text, inner))}]\n"
            yield from lines_of(value, inner)


def key_text(key: str) -> str:
    """A key, quoted where it has to be; ConfigError for what is no text."""
    if not isinstance(key, str):
        raise ConfigError(f"keys of a config are words, found {key!r}")
    return key if BARE_KEY.fullmatch(key) else json.dumps(key)


def value_text(value: Any, place: tuple[str, ...]) -> str:
    """One value as TOML writes it, floats exactly."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, str | os.PathLike):
        # JSON's escapes are TOML's; only DEL has to be written out besides.
        text = json.dumps(os.fspath(value), ensure_ascii=False)
        return text.replace("\x7f", "\\u007f")
    if isinstance(value, list | tuple):
        return f"[{', '.join(value_text(each, place) for each in value)}]"
    if isinstance(value, Mapping):
        inner = (f"{key_text(key)} = {value_text(each, place)}" for key, each in value.items())
        return f"{{ {', '.join(inner)} }}"
    raise ConfigError(
        f"{'.'.join(place)}: a config holds numbers, words, true and false, lists and tables, "
        f"found {type(value).__name__}"
    )
