"""What is wrong with a config file: worded, collected, and told at once, each with its line."""

import difflib
from collections.abc import Iterable, Mapping

import attrs

from flocsim.ensembles.config.toml_text import BARE_KEY, key_lines
from flocsim.errors import ConfigError, visible

LONGEST_SHOWN = 60
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


def suggestion(word: str, words: Iterable[str]) -> str:
    """ " (did you mean …?)", or "" where nothing is close."""
    if len(word) > LONGEST_SHOWN:
        return ""
    close = difflib.get_close_matches(word, words, n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""


def dotted(place: Iterable[str]) -> str:
    """The keys as TOML writes them, "forces.contact.k_n"."""
    return ".".join(key if BARE_KEY.fullmatch(key) else repr(key) for key in place)


@attrs.define
class Problems:
    """The findings so far. A place is a tuple of keys, e.g. ("forces", "contact", "k_n")."""

    file: str
    text: str
    overrides: Mapping
    found: list[tuple[tuple[str, ...], str]] = attrs.Factory(list)

    def misfit(self, place: tuple[str, ...], error: Misfit) -> None:
        for index, text in error.findings:
            self.found.append((place, f"{dotted(place)}{index} {text}"))

    def note(self, place: tuple[str, ...], text: str) -> None:
        """Note anything else that is wrong at ``place``, () being the whole file."""
        self.found.append((place, f"{dotted(place)}: {text}" if place else text))

    def unknown(self, place: tuple[str, ...], known: Iterable[str]) -> None:
        words = f"known: {', '.join(known)}" if known else "there are none here"
        self.note(place, f"unknown key{suggestion(place[-1], known)}; {words}")

    def at(self, *tables: str) -> bool:
        """Whether anything within one of the top-level tables was found wrong."""
        return any(place[:1] == (table,) for place, _ in self.found for table in tables)

    def raise_if_any(self) -> None:
        """ConfigError with one line per problem, in the order of the file."""
        if self.found:
            lines = key_lines(self.text)
            located = [(self.line_of(place, lines), text) for place, text in self.found]
            located.sort(key=lambda item: item[0])
            places = {-1: f"override of {self.file}", 0: self.file}
            shown = [
                visible(f"{places.get(line, f'{self.file}:{line}')}: {text}", keep="")
                for line, text in located[:MOST_SHOWN]
            ]
            if len(located) > MOST_SHOWN:
                rest = len(located) - MOST_SHOWN
                shown.append(visible(f"{self.file}: {rest} more unknown or wrong keys", keep=""))
            raise ConfigError("\n".join(shown))

    def line_of(self, place, lines):
        """The line of the key or of the nearest table around it; else 0, and −1 if overridden."""
        table = self.overrides
        for key in place:
            table = table.get(key) if isinstance(table, dict) else None
        if place and table is not None:
            return -1
        around = (lines[place[:n]] for n in range(len(place), 0, -1) if place[:n] in lines)
        return next(around, 0)
