"""Nested dicts as TOML: a study from Python is a config file like any other."""

import json
import os
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from flocsim.ensembles.config.problems import BARE_KEY
from flocsim.errors import ConfigError


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
