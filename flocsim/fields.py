"""Makers of attrs fields that carry their unit and their permitted range.

The range is checked when an object is made, in Python as from a config file; the unit lets the
config loader read "16.41 um" and refuse "3 kg". Metadata keys: ``unit``, ``help``, ``choices``.
"""

import math
from numbers import Integral, Real

import attrs

from flocsim.errors import RangeError


def is_number(value):
    """A finite real number; True and False are not numbers."""
    if not isinstance(value, Real) or isinstance(value, bool):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def is_whole(value):
    """An integer; True and False are none."""
    return isinstance(value, Integral) and not isinstance(value, bool)


def describe_range(above=None, at_least=None, at_most=None):
    """The permitted range in words, for messages and for the schema page."""
    limits = [("above", above), ("at least", at_least), ("at most", at_most)]
    words = " and ".join(f"{word} {limit:g}" for word, limit in limits if limit is not None)
    return f"a finite number {words}".strip()


def range_validator(above=None, at_least=None, at_most=None):
    """An attrs validator: a finite number within the limits."""

    def check(instance, attribute, value):
        within = (
            is_number(value)
            and (above is None or value > above)
            and (at_least is None or value >= at_least)
            and (at_most is None or value <= at_most)
        )
        if not within:
            allowed = describe_range(above, at_least, at_most)
            raise RangeError(f"{attribute.name} must be {allowed}, found {value!r}")

    return check


def quantity(unit, *, above=None, at_least=None, at_most=None, default=attrs.NOTHING, help=""):
    """A field with a unit ("" for a pure number), e.g. ``quantity("J", at_least=0.0)``."""
    allowed = describe_range(above, at_least, at_most)
    return attrs.field(
        default=default,
        validator=range_validator(above, at_least, at_most),
        metadata={"unit": unit, "help": help, "allowed": allowed},
    )


def choice(*options, default=attrs.NOTHING, help=""):
    """A field that takes one of the given words."""

    def check(instance, attribute, value):
        if value not in options:
            allowed = " or ".join(repr(option) for option in options)
            raise RangeError(f"{attribute.name} must be {allowed}, found {value!r}")

    return attrs.field(
        default=default, validator=check, metadata={"choices": options, "help": help}
    )


def word_or_quantity(word, unit, *, above=None, at_least=None, default=attrs.NOTHING, help=""):
    """A field that takes one special word or a quantity, e.g. ``"critical"`` or a number."""
    number = range_validator(above=above, at_least=at_least)

    def check(instance, attribute, value):
        if value == word:
            return
        if isinstance(value, str):
            allowed = describe_range(above=above, at_least=at_least)
            raise RangeError(f"{attribute.name} must be {word!r} or {allowed}, found {value!r}")
        number(instance, attribute, value)

    allowed = f"{word!r} or {describe_range(above=above, at_least=at_least)}"
    return attrs.field(
        default=default,
        validator=check,
        metadata={"unit": unit, "choices": (word,), "help": help, "allowed": allowed},
    )


def flag(*, default=attrs.NOTHING, help=""):
    """A field that takes true or false."""

    def check(instance, attribute, value):
        if not isinstance(value, bool):
            raise RangeError(f"{attribute.name} must be true or false, found {value!r}")

    return attrs.field(default=default, validator=check, metadata={"help": help, "flag": True})
