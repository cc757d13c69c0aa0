"""`--set key=value`: any entry of a config file from the command line."""

import tomllib

from flocsim.errors import ConfigError


def parsed(text):
    """(keys, value) of "scene.delta=[0.0, 0.5]"; a value that is no TOML is a string.

    So `--set forces.contact.k_n='10 N/m'` needs no quotes within quotes.
    """
    key, equals, value = text.partition("=")
    keys = [part.strip() for part in key.split(".")]
    if not equals or not all(keys):
        raise ConfigError(f"--set {text!r}: write KEY=VALUE, e.g. --set scene.delta='[0.0, 0.5]'")
    return keys, value_of(value.strip())


def value_of(text):
    """A value as TOML reads it, or the text itself."""
    try:
        table = tomllib.loads(f"value = {text}\n")
    except tomllib.TOMLDecodeError:
        return text
    return table["value"] if len(table) == 1 else text


def nested(settings):
    """{"scene": {"delta": …}} of (keys, value) pairs; ConfigError where two cannot both hold."""
    table = {}
    for keys, value in settings:
        inner = table
        for key in keys[:-1]:
            inner = inner.setdefault(key, {})
            if not isinstance(inner, dict):
                raise ConfigError(f"--set {'.'.join(keys)}: {key} has been set to a value already")
        inner[keys[-1]] = value
    return table
