"""Values of a config file, read strictly: nothing is rounded, truncated or taken for another type.

A reader takes a value as TOML or Python gives it and returns the value that flocsim computes with,
or raises Misfit. Which reader a field has follows from its metadata (flocsim.fields); ``read_by``
makes a field that has a reader of its own.

What is wrong with a file is worded here as well, and collected, so that all of it is told at once,
each with its line.
"""

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from types import SimpleNamespace
from typing import Any

import attrs

from flocsim.ensembles.config.toml_text import BARE_KEY, line_of_key
from flocsim.errors import LONGEST_SHOWN, ConfigError, closest, suggestion, visible
from flocsim.fields import (
    is_number,
    is_whole,
    kind_of,
    list_words,
    may_be_none,
    number_range,
    read_quantity,
)

MOST_SHOWN = 50


class Misfit(ValueError):
    """A value that does not fit; ``findings`` are pairs (place such as "[2]", what is wrong)."""

    def __init__(self, *findings: tuple[str, str]) -> None:
        self.findings = findings
        super().__init__("; ".join(f"{place} {text}".strip() for place, text in findings))


def misfit(allowed: str, value: object, hint: str = "") -> Misfit:
    """The Misfit "must be ALLOWED, found VALUE"."""
    return Misfit(("", f"must be {allowed}, found {show(value)}{hint}"))


def show(value: object) -> str:
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


def dotted(place: Iterable[str]) -> str:
    """The keys as TOML writes them, "forces.contact.k_n"."""
    words = (key if BARE_KEY.fullmatch(key) else repr(key) for key in place)
    return ".".join(
        f"{word[:LONGEST_SHOWN]}…" if len(word) > LONGEST_SHOWN else word for word in words
    )


Reader = Callable[[Any], Any]


def reader_of(attribute: attrs.Attribute) -> Reader:
    metadata = attribute.metadata
    if "read" in metadata:
        return metadata["read"]
    if metadata.get("flag"):
        return read_flag
    if "vector" in metadata:
        return vector(metadata["vector"], metadata.get("unit", ""))
    if metadata.get("of_each"):
        one = number(metadata["unit"], *number_range())
        return either(list | tuple, vector(2, metadata["unit"]), one)
    if "unit" in metadata:
        allowed = metadata.get("allowed", "a finite number")
        return number(metadata["unit"], passes(attribute), allowed, metadata.get("choices", ()))
    if "choices" in metadata:
        return one_of(metadata["choices"])
    return lambda value: read_plain(value, attribute.type in (float, "float"))


def passes(attribute):
    """Whether a value passes the validator of an attrs field, as a function."""

    def check(value):
        try:
            if attribute.validator is not None:
                attribute.validator(None, SimpleNamespace(name=attribute.name), value)
        except (TypeError, ValueError):
            return False
        return True

    return check


def read_by(read: Reader, allowed: str, *, default: Any = attrs.NOTHING, **metadata: Any) -> Any:
    """A field with a reader of its own, which holds in Python too."""

    def check(instance, attribute, value):
        try:
            if not (value is None and may_be_none(default)):
                read(value)
        except Misfit as error:
            place, text = error.findings[0]
            raise ConfigError(f"{attribute.name}{place} {text}") from None

    metadata = {"read": read, "allowed": allowed, **metadata}
    return attrs.field(default=default, validator=check, metadata=metadata)


def number_or_table(unit: str, kind: type, allowed: str) -> Reader:
    """A reader of a number above 0 in a unit, or of a table of all the fields of an attrs class."""
    fields = attrs.fields_dict(kind)
    of_number = number(unit, *number_range(above=0.0))

    def read(value):
        if isinstance(value, kind):
            return value
        if not isinstance(value, dict):
            return of_number(value)
        findings, values = [], {}
        for key, each in value.items():
            if key not in fields:
                text = f"is not a key{suggestion(key, fields)}; known: {list_words(fields)}"
                findings.append(("." + dotted([key]), text))
                continue
            try:
                values[key] = reader_of(fields[key])(each)
            except Misfit as error:
                findings += [("." + key + place, text) for place, text in error.findings]
        if findings:
            raise Misfit(*findings)
        if lacking := [key for key in fields if key not in values]:
            raise misfit(allowed, value, f" without {list_words(lacking)}")
        return kind(**values)

    return read


def whole_field(at_least: int, at_most: int, **more: Any) -> Any:
    allowed = f"an integer from {at_least} to {at_most}"
    return read_by(whole(at_least, at_most), allowed, **more)


def read_flag(value: object) -> bool:
    if not isinstance(value, bool):
        raise misfit("true or false", value)
    return value


def read_text(value: object) -> str:
    """A string of printable characters that is not blank."""
    if not isinstance(value, str) or not value.strip() or not value.isprintable():
        raise misfit("a string that is not blank", value)
    return value


def one_of(choices: Collection[str]) -> Reader:
    def read(value):
        if not isinstance(value, str) or value not in choices:
            hint = suggestion(value, choices) if isinstance(value, str) else ""
            raise misfit(list_words(choices), value, hint)
        return value

    return read


def whole(at_least: int, at_most: int) -> Reader:
    """A reader of integers within the limits; 3.0 is none."""

    def read(value):
        if not is_whole(value) or not at_least <= value <= at_most:
            raise misfit(f"an integer from {at_least} to {at_most}", value)
        return value

    return read


def number(
    unit: str, check: Callable[[float], bool], allowed: str, choices: Collection[str] = ()
) -> Reader:
    """A reader of a number in a unit, as such or as a string such as "16.41 um", or of a choice.

    ``check`` and ``allowed`` say what numbers are right, as flocsim.fields.number_range does.
    """
    kind = kind_of(unit) if unit else allowed
    needed = f"{list_words(choices)} or {kind}" if choices and unit else kind

    def read(value):
        found, hint = math.nan, ""
        if isinstance(value, str) and value in choices:
            return value
        if isinstance(value, str) and unit:
            try:
                found = read_quantity(value, unit)
            except ValueError as reason:
                hint = suggestion(value, choices) or (f" ({reason})" if str(reason) else "")
        elif is_number(value):
            found = float(value)
        if not math.isfinite(found):
            raise misfit(needed, value, hint)
        if not check(found):
            raise misfit(f"{allowed} [{unit}]" if unit else allowed, value)
        return found

    return read


def list_of(
    read_item: Reader, allowed: str, length: int | None = None, distinct: bool = True
) -> Reader:
    """A reader of lists with at least one item, or of a ``length``; returns a tuple.

    Its Misfit tells the findings of all items. ``distinct`` items are no two the same.
    """

    def read(value):
        fits = isinstance(value, list | tuple) and len(value) > 0
        if not fits or length not in (None, len(value)):
            raise misfit(allowed, value)
        items, findings = {}, []
        for place, item in enumerate(value):
            try:
                items[place] = read_item(item)
            except Misfit as error:
                findings += [(f"[{place}]{inner}", text) for inner, text in error.findings]
        first = {}
        for place, item in items.items() if distinct else ():
            if first.setdefault(item, place) != place:
                text = f"must differ from the others, found the same value as in [{first[item]}]"
                findings.append((f"[{place}]", text))
        if findings:
            raise Misfit(*findings)
        return tuple(items.values())

    return read


def either(kind: Any, read_kind: Reader, read_other: Reader) -> Reader:
    """A reader of values of a type, and of all others."""
    return lambda value: (read_kind if isinstance(value, kind) else read_other)(value)


def vector(length: int, unit: str = "", **limits: float) -> Reader:
    """A reader of exactly ``length`` numbers; returns a tuple of floats."""
    allowed = f"a list of {length} numbers" + (f" [{unit}]" if unit else "")
    return list_of(number(unit, *number_range(**limits)), allowed, length, distinct=False)


read_numbers = list_of(number("", *number_range()), "a list of numbers", distinct=False)


def read_plain(value, is_float):
    """A value of a field that says nothing about itself: a number, a string, a flag, numbers."""
    if isinstance(value, list | tuple):
        return read_numbers(value)
    if isinstance(value, str | bool) and not is_float:
        return value
    if not is_number(value):
        undeclared = " (the field declares no unit: see flocsim.fields.quantity)"
        hint = undeclared if isinstance(value, str) else ""
        raise misfit("a finite number in SI units" if is_float else "a plain value", value, hint)
    return float(value) if is_float else value


@attrs.define
class Problems:
    """The findings so far. A place is a tuple of keys, e.g. ("forces", "contact", "k_n").

    ``meant``: what misspelt keys and tables at the top seem to be; there something is wrong, too.
    """

    file: str
    text: str
    overrides: Mapping
    found: list[tuple[tuple[str, ...], str]] = attrs.Factory(list)
    meant: set[str] = attrs.Factory(set)

    def misfit(self, place: tuple[str, ...], error: Misfit) -> None:
        for index, text in error.findings:
            self.found.append((place, f"{dotted(place)}{index} {text}"))

    def note(self, place: tuple[str, ...], text: str) -> None:
        """Note anything else that is wrong at ``place``, () being the whole file."""
        self.found.append((place, f"{dotted(place)}: {text}" if place else text))

    def unknown(self, place: tuple[str, ...], known: Iterable[str]) -> None:
        words = f"known: {', '.join(known)}" if known else "there are none here"
        if len(place) == 1:
            self.meant.add(closest(place[0], known))
        self.note(place, f"unknown key{suggestion(place[-1], known)}; {words}")

    def at(self, *tables: str) -> bool:
        """Whether anything within one of the top-level tables was found wrong."""
        return not {*tables}.isdisjoint({place[0] for place, _ in self.found if place} | self.meant)

    def raise_if_any(self) -> None:
        """ConfigError with one line per problem, in the order of the file."""
        if self.found:
            located = [(self.line_of(place), text) for place, text in self.found[:MOST_SHOWN]]
            located.sort(key=lambda item: item[0])
            places = {-1: f"override of {self.file}", 0: self.file}
            shown = [
                visible(f"{places.get(line, f'{self.file}:{line}')}: {text}", keep="")
                for line, text in located
            ]
            if rest := len(self.found) - len(located):
                shown.append(visible(f"{self.file}: {rest} more unknown or wrong keys", keep=""))
            raise ConfigError("\n".join(shown))

    def line_of(self, place):
        """The line of the key or of the nearest table around it; else 0, and −1 if overridden."""
        table = self.overrides
        for key in place:
            table = table.get(key) if isinstance(table, dict) else None
        if place and table is not None:
            return -1
        around = (line_of_key(self.text, place[:n]) for n in range(len(place), 0, -1))
        return next(filter(None, around), 0)
