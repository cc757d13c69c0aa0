"""JSON that anyone may have written: parsed within limits, and compared with a pattern.

A pattern is a type (``str``, ``int``, ``float``, ``object`` for any value), ``[pattern]`` for a
list of such, or ``{key: pattern}`` for an object that has these keys and perhaps more.
"""

import json
import math
from typing import Any

LONGEST = 2**24
"""Letters of a text."""

DEEPEST = 8
"""Lists and objects within one another."""

LARGEST = 2**53
"""Whole numbers are below, so that every reader of JSON has them exactly."""


def read_json(text: str | bytes, pattern: Any = object) -> Any:
    """The value of a JSON text; ValueError, of one line, for what is none or fits no pattern.

    So for text beyond the limits above, and for numbers or letters that cannot be.
    """
    if not isinstance(text, str | bytes) or len(text) > LONGEST:
        raise ValueError(f"it is not a text of up to {LONGEST} letters")
    try:
        value = json.loads(text, parse_constant=no_number, parse_float=finite)
    except RecursionError:
        raise ValueError(f"it is nested more than {DEEPEST} deep") from None
    check_inside(value)
    if not matches(value, pattern):
        raise ValueError("its form is unknown")
    return value


def no_number(word):
    raise ValueError(f"{word} is not a number")


def finite(text):
    value = float(text)
    return value if math.isfinite(value) else no_number(text[:20])


def check_inside(value):
    """ValueError for what is nested too deeply, and for letters that no file can hold."""
    row = [value]
    for _ in range(DEEPEST + 1):
        inner = []
        for each in row:
            if isinstance(each, dict):
                inner += [*each, *each.values()]
            elif isinstance(each, list):
                inner += each
            elif isinstance(each, str):
                each.encode("utf-8")  # a lone half of a letter raises a ValueError
            elif isinstance(each, int) and abs(each) > LARGEST:
                raise ValueError("a number in it is too large")
        row = inner
    if row:
        raise ValueError(f"it is nested more than {DEEPEST} deep")


def matches(value: Any, pattern: Any) -> bool:
    """Whether a value that was read has the form of a pattern."""
    if isinstance(pattern, list):
        return isinstance(value, list) and all(matches(each, pattern[0]) for each in value)
    if isinstance(pattern, dict):
        return isinstance(value, dict) and all(
            key in value and matches(value[key], inner) for key, inner in pattern.items()
        )
    if pattern is object:
        return True
    if isinstance(value, bool):
        return False
    return isinstance(value, int | float) if pattern is float else isinstance(value, pattern)
