"""The text of a TOML file: read, parsed, and the lines of its keys; nested dicts as such a text."""

import contextlib
import json
import os
import re
import sys
import tomllib
from collections.abc import Iterator, Mapping
from typing import Any

from flocsim.errors import ConfigError

LARGEST_FILE = 100_000
"""Bytes of a config file."""

HEADER = re.compile(r"\s*\[([^\[\],]+)\]\s*(?:#.*)?")
KEY = re.compile(r"""\s*((?:[\w-]+|"[^"]*"|'[^']*'|[.\s])+?)\s*=""")
KEY_PART = re.compile(r"""[\w-]+|"[^"]*"|'[^']*'""")

STANDARD_INPUT = "-"
"""Stands for a config that comes through a pipe."""


def read_text_file(path: str | os.PathLike) -> str:
    """Return the text of a config file, its line ends as "\\n"; ConfigError where there is none.

    "-" is the standard input.
    """
    try:
        if str(path) == STANDARD_INPUT:
            data = sys.stdin.buffer.read(LARGEST_FILE + 1)
        else:
            with open(path, "rb") as file:
                data = file.read(LARGEST_FILE + 1)
        if len(data) > LARGEST_FILE:
            raise ValueError(f"it is larger than {LARGEST_FILE // 1000} kB")
        # A byte order mark is what some editors for Windows put in front.
        return data.decode("utf-8-sig").replace("\r\n", "\n")
    except FileNotFoundError as error:
        raise ConfigError(f"{path}: no such file; `flocsim init {path}` writes one") from error
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ConfigError(
            f"{path}: could not be read as a TOML config file in UTF-8: {reason}"
        ) from error


def parse(path: str | os.PathLike, text: str) -> dict:
    """Return the tables of a TOML text; ConfigError with file and line where it is none."""
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise ConfigError(f"{path}: not valid TOML: nested too deeply") from error
    except ValueError as error:
        line = re.search(r"at line (\d+)", str(error))
        where = f"{path}:{line[1]}" if line else f"{path}"
        raise ConfigError(f"{where}: not valid TOML: {error}") from error


def key_lines(text: str) -> dict[str, int]:
    """Return the line of every dotted key and table's header that stands in a TOML text once.

    The text is searched line by line: what a string or a list of many lines holds may look like a
    key, too.
    """
    lines: dict[str, int] = {}
    table = ""
    for number, line in enumerate(text.split("\n"), 1):
        header = HEADER.fullmatch(line)
        if found := header or KEY.match(line):
            name = ".".join(part.strip("\"'") for part in KEY_PART.findall(found[1]))
            table = name if header else table
            place = name if header or not table else f"{table}.{name}"
            lines[place] = -1 if place in lines else number
    return {place: number for place, number in lines.items() if number > 0}


def settings_of(table: Mapping[str, Any], around: str = "") -> Iterator[tuple[str, str]]:
    """Yield (dotted key, TOML text) of every value in nested dicts.

    ConfigError for what no config file can hold.
    """
    for key, value in table.items():
        name = f"{around}{key}"
        if isinstance(value, Mapping) and value:
            yield from settings_of(value, f"{name}.")
        elif value is not None:
            yield name, value_text(value, name)


def value_text(value: Any, name: str) -> str:
    """Return the value of a key as TOML writes it, floats exactly.

    JSON writes words, numbers and lists alike, and with other signs between also inline tables.
    """
    with contextlib.suppress(TypeError, ValueError):
        text = json.dumps(
            value,
            default=lambda each: each.tolist() if hasattr(each, "tolist") else os.fspath(each),
            ensure_ascii=False,
            allow_nan=False,
            separators=(", ", " = "),
        )
        return text.replace("\x7f", "\\u007f")
    raise ConfigError(
        f"{name}: a config holds finite numbers, words, true and false, lists and tables, found "
        f"{type(value).__name__}"
    )
