"""Values of a config file, read strictly: nothing is rounded, truncated or taken for another type.

A reader takes a value as TOML or Python gives it and returns the value that flocsim computes with,
or raises Misfit. Which reader a field has follows from its metadata (flocsim.fields).
"""

import difflib
import math
from numbers import Real
from types import SimpleNamespace

from flocsim.ensembles.config.quantities import kind_of, read_quantity
from flocsim.fields import describe_range, range_validator

LONGEST_SHOWN = 60


class Misfit(ValueError):
    """A value that does not fit; ``findings`` are pairs (place such as "[2]", what is wrong)."""

    def __init__(self, *findings):
        self.findings = findings
        super().__init__("; ".join(f"{place} {text}".strip() for place, text in findings))


def misfit(allowed, value, hint=""):
    """The Misfit "must be ALLOWED, found VALUE"."""
    return Misfit(("", f"must be {allowed}, found {show(value)}{hint}"))


def show(value):
    """A value as a config file writes it, on one short line."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list | tuple):
        return f"a list of {len(value)}" if value else "an empty list"
    if isinstance(value, int) and abs(value) >= 10**30:
        return "a number of more than 30 digits"
    text = repr(value) if isinstance(value, str | int | float) else str(value)
    return text if len(text) <= LONGEST_SHOWN else text[:LONGEST_SHOWN] + "…"


def suggestion(word, words):
    """ " (did you mean …?)", or "" where nothing is close."""
    close = difflib.get_close_matches(word, words, n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""


def is_finite(value):
    """A number, not true or false, that a float can hold."""
    try:
        return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:
        return False


def reader_of(attribute):
    """The reader of an attrs field."""
    metadata = attribute.metadata
    if "read" in metadata:
        return metadata["read"]
    if metadata.get("flag"):
        return read_flag
    if "vector" in metadata:
        return vector_reader(metadata["vector"], metadata.get("unit", ""))
    if "unit" in metadata:
        return lambda value: read_within(value, metadata, attribute.validator)
    if "choices" in metadata:
        return lambda value: read_choice(value, metadata["choices"])
    return lambda value: read_plain(value, attribute.type in (float, "float"))


def read_flag(value):
    """True or False."""
    if not isinstance(value, bool):
        raise misfit("true or false", value)
    return value


def read_choice(value, choices):
    """One of the words."""
    if not isinstance(value, str) or value not in choices:
        hint = suggestion(value, choices) if isinstance(value, str) else ""
        raise misfit(list_words(choices), value, hint)
    return value


def list_words(words):
    """'a', 'b' or 'c'."""
    *most, last = [repr(word) for word in words]
    return f"{', '.join(most)} or {last}" if most else last


def read_within(value, metadata, check):
    """A word, or a number with a unit that the attrs validator ``check`` lets pass."""
    words = metadata.get("choices", ())
    if isinstance(value, str) and value in words:
        return value
    unit = metadata["unit"]
    number = read_number(value, unit, words, metadata["allowed"])
    try:
        if check is not None:
            check(None, SimpleNamespace(name=""), number)
    except ValueError:
        allowed = f"{metadata['allowed']} [{unit}]" if unit else metadata["allowed"]
        raise misfit(allowed, value) from None
    return number


def read_number(value, unit, words=(), allowed="a finite number"):
    """A finite float, of a number or of a string with a unit."""
    hint = ""
    if isinstance(value, str) and unit:
        try:
            value_in_unit = read_quantity(value, unit)
            if math.isfinite(value_in_unit):
                return value_in_unit
        except ValueError as reason:
            hint = suggestion(value, words) or (f" ({reason})" if str(reason) else "")
    elif is_finite(value):
        return float(value)
    needed = kind_of(unit) if unit else allowed
    raise misfit(f"{list_words(words)} or {needed}" if words and unit else needed, value, hint)


def number_reader(unit, **limits):
    """A reader of numbers with a unit, within the limits of flocsim.fields.range_validator."""
    metadata = {"unit": unit, "allowed": describe_range(**limits)}
    return lambda value: read_within(value, metadata, range_validator(**limits))


def read_each(value, read_item, allowed):
    """Every item of a list through ``read_item``; one Misfit with the findings of all."""
    if not isinstance(value, list | tuple) or not value:
        raise misfit(allowed, value)
    items, findings = [], []
    for place, item in enumerate(value):
        try:
            items.append(read_item(item))
        except Misfit as error:
            findings += [(f"[{place}]{inner}", text) for inner, text in error.findings]
    if findings:
        raise Misfit(*findings)
    return tuple(items)


def vector_reader(length, unit, **limits):
    """A reader of exactly ``length`` numbers; returns a tuple of floats."""
    allowed = f"a list of {length} numbers" + (f" [{unit}]" if unit else "")

    def read(value):
        if not isinstance(value, list | tuple) or len(value) != length:
            raise misfit(allowed, value)
        return read_each(value, number_reader(unit, **limits), allowed)

    return read


def read_plain(value, is_float):
    """A value of a field that says nothing about itself: a number, a string, a flag, numbers."""
    if isinstance(value, list | tuple):
        return read_each(value, number_reader(""), "a list of numbers")
    if isinstance(value, str | bool) and not is_float:
        return value
    if not is_finite(value):
        undeclared = " (the field declares no unit: see flocsim.fields.quantity)"
        hint = undeclared if isinstance(value, str) else ""
        raise misfit("a finite number in SI units" if is_float else "a plain value", value, hint)
    return float(value) if is_float else value
