"""Makers of attrs fields that carry their unit and their permitted range.

The range is checked when an object is made, in Python as from a config file; the unit lets both
read "16.41 um" and refuse "3 kg" (quantities.py). Metadata keys: ``allowed`` (what the field takes,
in words), ``unit``, ``choices``, ``flag``, ``help``.
"""

import math
from collections.abc import Callable, Iterable
from numbers import Integral, Real
from typing import Any

import attrs

from flocsim.errors import RangeError
from flocsim.fields.quantities import kind_of, read_quantity


def is_number(value: Any) -> bool:
    """A finite real number that a float can hold; True and False are not numbers."""
    if not isinstance(value, Real) or isinstance(value, bool):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def is_whole(value: Any) -> bool:
    """An integer; True and False are none."""
    return isinstance(value, Integral) and not isinstance(value, bool)


def list_words(words: Iterable[str]) -> str:
    """'a', 'b' or 'c'."""
    *most, last = [repr(word) for word in words]
    return f"{', '.join(most)} or {last}" if most else last


def number_range(
    above: float | None = None, at_least: float | None = None, at_most: float | None = None
) -> tuple[Callable[[Any], bool], str]:
    """(check, words): whether a value is a finite number within the limits, and those in words."""

    def check(value: Any) -> bool:
        return (
            is_number(value)
            and (above is None or value > above)
            and (at_least is None or value >= at_least)
            and (at_most is None or value <= at_most)
        )

    limits = [("above", above), ("at least", at_least), ("at most", at_most)]
    words = " and ".join(f"{word} {limit:g}" for word, limit in limits if limit is not None)
    return check, f"a finite number {words}".strip()


def may_be_none(default: Any) -> bool:
    """Whether a field with this default may hold None: it is the default, or may come of it."""
    return default is None or isinstance(default, attrs.Factory)  # type: ignore[arg-type]


def in_unit(value: Any, unit: str, name: str) -> Any:
    """A text such as "16.41 um" as a number of the unit; all else as it is.

    RangeError, with the ``name`` of what it is for, for a text that is no such quantity.
    """
    if not isinstance(value, str):
        return value
    try:
        return read_quantity(value, unit)
    except ValueError as reason:
        hint = f" ({reason})" if str(reason) else ""
        raise RangeError(f"{name} must be {kind_of(unit)}, found {value!r}{hint}") from None


def checked_field(
    check: Callable[[Any], bool], allowed: str, default: Any, *, kw_only: bool = False,
    **metadata: Any,
) -> Any:  # fmt: skip
    """A field whose values pass ``check``; RangeError says what is ``allowed`` of all others.

    With a ``unit`` in its metadata it takes texts such as "16.41 um".
    """
    unit, words = metadata.get("unit"), metadata.get("choices", ())

    def read(value: Any) -> Any:
        try:
            return in_unit(value, unit, "") if unit and value not in words else value
        except RangeError:
            return value  # validate, which knows the name, says what is wrong

    def validate(instance: object, attribute: attrs.Attribute, value: Any) -> None:
        if not (check(value) or (value is None and may_be_none(default))):
            if unit and not words:
                in_unit(value, unit, attribute.name)
            raise RangeError(f"{attribute.name} must be {allowed}, found {value!r}")

    metadata = {"allowed": allowed, **metadata}
    return attrs.field(
        default=default,
        converter=read if unit else None,
        validator=validate,
        metadata=metadata,
        kw_only=kw_only,
    )


def quantity(
    unit: str,
    *,
    above: float | None = None,
    at_least: float | None = None,
    at_most: float | None = None,
    default: Any = attrs.NOTHING,
    help: str = "",
    word: str | None = None,
    **metadata: Any,
) -> Any:
    """A field with a unit ("" for a pure number), e.g. ``quantity("J", at_least=0.0)``.

    It takes numbers in that unit, and texts with any of the same dimension: 5e-21 or "5 zJ"; and
    one special ``word``, where there is one.
    """
    check, allowed = number_range(above, at_least, at_most)
    more = {"unit": unit, "help": help, **metadata}
    if word is None:
        return checked_field(check, allowed, default, **more)
    return checked_field(
        lambda value: check(value) or (isinstance(value, str) and value == word),
        f"{word!r} or {allowed}",
        default,
        choices=(word,),
        **more,
    )


def quantity_of_each(unit: str, *, default: Any = attrs.NOTHING, help: str = "") -> Any:
    """A field that takes a quantity of both bodies of a pair, or a list of one for each."""

    def listed(value: Any) -> bool:
        return isinstance(value, list | tuple)

    def read(value: Any) -> Any:
        try:
            if not listed(value):
                return in_unit(value, unit, "")
            return tuple(in_unit(each, unit, "") for each in value)
        except RangeError:
            return value

    def validate(instance: object, attribute: attrs.Attribute, value: Any) -> None:
        each = value if listed(value) else (value,)
        for one in each:
            in_unit(one, unit, attribute.name)
        if len(each) not in ((2,) if listed(value) else (1,)) or not all(map(is_number, each)):
            raise RangeError(f"{attribute.name} must be {allowed}, found {value!r}")

    allowed = "a finite number, or a list of two"
    metadata = {"allowed": allowed, "unit": unit, "of_each": True, "help": help}
    return attrs.field(default=default, converter=read, validator=validate, metadata=metadata)


def choice(*options: str, default: Any = attrs.NOTHING, help: str = "", **metadata: Any) -> Any:
    """A field that takes one of the given words."""
    metadata = {"choices": options, "help": help, **metadata}
    return checked_field(lambda value: value in options, list_words(options), default, **metadata)


def word_or_quantity(word: str, unit: str, **more: Any) -> Any:
    """A field that takes one special word, e.g. ``"critical"``, or a quantity: else as that."""
    return quantity(unit, word=word, **more)


def flag(*, default: Any = attrs.NOTHING, help: str = "") -> Any:
    """A field that takes true or false."""
    return checked_field(
        lambda value: isinstance(value, bool), "true or false", default, flag=True, help=help
    )
