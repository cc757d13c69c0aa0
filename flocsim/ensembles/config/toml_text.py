"""The text of a TOML file: read, parsed, and the lines of its keys; nested dicts as such a text."""

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

# tomllib's time grows with the square of a dotted key's parts, which stand on one line: "a.a.a…" of
# 10,000 characters takes 0.5 s of CPU, of 20,000 1.6 s, of 100,000 some 40 s.
LARGEST_FILE = 100_000
LONGEST_LINE = 10_000

DEEPEST_TABLE = 2
"""[forces.NAME] lies two keys deep; what is nested further is no table of the schema."""

TOML_PLACE = re.compile(r"(.*) \(at (?:line (\d+), column (\d+)|end of document)\)", re.DOTALL)

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
    """The TOML tables; ConfigError with file and line where the text is not TOML, or too long."""
    if len(text) > LARGEST_FILE:
        raise ConfigError(f"{path}: longer than {LARGEST_FILE} characters; name a TOML config file")
    for number, row in enumerate(text.split("\n"), 1):
        if len(row) > LONGEST_LINE:
            raise ConfigError(
                f"{path}:{number}: a line of more than {LONGEST_LINE} characters: break its list "
                "into several lines"
            )
    try:
        return tomllib.loads(text)
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


def is_toml(text: str) -> bool:
    """Return True if a text is valid TOML by itself."""
    try:
        tomllib.loads(text)
    except (ValueError, RecursionError):
        return False
    return True


def line_of_key(text: str, place: tuple[str, ...]) -> int:
    """The line of a key, or of a table's header, which stands in a TOML text once; else 0."""
    lines = text.split("\n")
    *tables, key = map(re.escape, place)

    def only(pattern, start, end):
        found = [n for n in range(start, end) if re.match(pattern, lines[n])]
        # What stands before a statement is TOML by itself: a line within a string or list is none.
        if len(found) == 1 and is_toml("\n".join(lines[: found[0]])):
            return found[0]
        return None

    def header(names):
        dotted = r"\s*\.\s*".join(names)
        return only(rf"\s*\[\s*{dotted}\s*\]", 0, len(lines))

    table = header(tables) if tables else -1
    found = None
    if table is not None:
        later = range(table + 1, len(lines))
        ends = (n for n in later if lines[n].lstrip().startswith("[") and is_toml(lines[n]))
        found = only(rf"\s*{key}\s*=", table + 1, next(ends, len(lines)))
    found = header([*tables, key]) if found is None else found
    return 0 if found is None else found + 1


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
        # One item a line, as a line must not get too long.
        return "[" + ",\n".join(value_text(each, place) for each in value) + "]"
    if isinstance(value, Mapping):
        inner = (f"{key_text(key)} = {value_text(each, place)}" for key, each in value.items())
        return f"{{ {', '.join(inner)} }}"
    raise ConfigError(
        f"{'.'.join(place)}: a config holds numbers, words, true and false, lists and tables, "
        f"found {type(value).__name__}"
    )
