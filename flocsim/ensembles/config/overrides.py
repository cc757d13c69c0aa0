"""Tables laid over one another: preset, config file, `--set key=value` of the command line."""

import tomllib
from collections.abc import Iterable, Mapping
from typing import Any

from flocsim.ensembles.config.schema import excluded_by, without_following
from flocsim.ensembles.config.toml_text import DEEPEST_TABLE, MOST_PARTS, text_problem
from flocsim.errors import ConfigError


def lay_over(below: Mapping, above: Mapping, path: tuple[str, ...] = ()) -> dict[str, Any]:
    """``below`` with everything that ``above`` gives put over it; tables are merged.

    A key replaces those below that it excludes (`schema.excluded_by`), or that follow from it
    (`schema.without_following`). A value None in ``above``
    counts as not given. A table over ``false`` starts afresh.
    """
    given = {key: value for key, value in above.items() if value is not None}
    gone = excluded_by(".".join(path), given.keys())
    merged = {key: value for key, value in below.items() if key not in gone}
    merged = merged if path else without_following(merged, given)
    for key, value in given.items():
        if isinstance(value, dict) and len(path) < DEEPEST_TABLE:
            under = merged.get(key)
            value = lay_over(under if isinstance(under, dict) else {}, value, (*path, key))
        merged[key] = value
    return merged


def parse_setting(text: str) -> tuple[list[str], Any]:
    """(keys, value) of "scene.delta=[0.0, 0.5]"; a value that is no TOML is a string.

    So `--set forces.contact.k_n='10 N/m'` needs no quotes within quotes.
    """
    key, equals, value = text.partition("=")
    keys = [part.strip() for part in key.split(".")]
    if not equals or not all(keys):
        raise ConfigError(f"--set {text!r}: write KEY=VALUE, e.g. --set scene.delta='[0.0, 0.5]'")
    value = value.strip()
    beyond = text_problem(value)
    if beyond is not None or len(keys) > MOST_PARTS:
        what = beyond[1] if beyond else f"a key of more than {MOST_PARTS} parts"
        raise ConfigError(f"--set {text[:40]!r}…: {what}: no config needs that")
    try:
        table = tomllib.loads(f"value = {value}\n")
    except ValueError:
        return keys, value
    return keys, table["value"] if len(table) == 1 else value


def nested(settings: Iterable[tuple[list[str], Any]]) -> dict[str, Any]:
    """{"scene": {"delta": …}} of (keys, value) pairs; ConfigError where two cannot both hold."""
    table: dict[str, Any] = {}
    for keys, value in settings:
        inner = table
        for key in keys[:-1]:
            inner = inner.setdefault(key, {})
            if not isinstance(inner, dict):
                raise ConfigError(f"--set {'.'.join(keys)}: {key} has been set to a value already")
        inner[keys[-1]] = value
    return table
