"""JSON that anyone may have written: parsed, and compared with a pattern.

A pattern is a type (``str``, ``int``, ``float``, ``object`` for any value), ``[pattern]`` for a
list of such, or ``{key: pattern}`` for an object that has these keys and perhaps more.
"""

import json
from typing import Any


def read_json(text: str | bytes, pattern: Any = object) -> Any:
    """Return the value of a JSON text; ValueError, of one line, for what is none or fits no
    pattern."""
    try:
        value = json.loads(text)
    except (RecursionError, TypeError) as error:
        raise ValueError(f"it is no JSON text: {error}") from None
    if not matches(value, pattern):
        raise ValueError("its form is unknown")
    return value


def matches(value: Any, pattern: Any) -> bool:
    """Return True if a value that was read has the form of a pattern."""
    if isinstance(pattern, list):
        return isinstance(value, list) and all(matches(each, pattern[0]) for each in value)
    if isinstance(pattern, dict):
        return isinstance(value, dict) and all(
            key in value and matches(value[key], inner) for key, inner in pattern.items()
        )
    if isinstance(value, bool):
        return pattern is object
    return isinstance(value, int | float) if pattern is float else isinstance(value, pattern)
