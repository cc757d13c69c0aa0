"""What is wrong with a config file: collected, then told at once, each with its line."""

import re

import attrs

from flocsim.ensembles.config.toml_text import key_lines
from flocsim.errors import ConfigError

BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


@attrs.define
class Problems:
    """The findings so far. A place is a tuple of keys, e.g. ("forces", "contact", "k_n")."""

    file: str
    text: str
    overrides: dict
    found: list = attrs.Factory(list)

    def misfit(self, place, error):
        """Note the findings of a Misfit of the value at ``place``."""
        for index, text in error.findings:
            self.found.append((place, f"{dotted(place)}{index} {text}"))

    def note(self, place, text):
        """Note anything else that is wrong at ``place``, () being the whole file."""
        self.found.append((place, f"{dotted(place)}: {text}" if place else text))

    def at(self, *tables):
        """Whether anything within one of the top-level tables was found wrong."""
        return any(place[:1] == (table,) for place, _ in self.found for table in tables)

    def raise_if_any(self):
        """ConfigError with one line per problem, in the order of the file."""
        if self.found:
            lines = key_lines(self.text)
            located = [(self.line_of(place, lines), text) for place, text in self.found]
            located.sort(key=lambda item: item[0])
            raise ConfigError("\n".join(f"{self.label(line)}: {text}" for line, text in located))

    def line_of(self, place, lines):
        """The line of the key or of the nearest table around it; 0 where there is none."""
        if is_in(place, self.overrides):
            return -1
        around = (lines[place[:n]] for n in range(len(place), 0, -1) if place[:n] in lines)
        return next(around, 0)

    def label(self, line):
        """Where a problem is, for the front of its line."""
        if line < 0:
            return f"given over {self.file}"
        return f"{self.file}:{line}" if line else self.file


def dotted(place):
    """The keys as TOML writes them, "forces.contact.k_n"."""
    return ".".join(key if BARE_KEY.fullmatch(key) else repr(key) for key in place)


def is_in(place, table):
    """Whether the nested table has a value at the place."""
    for key in place:
        if not isinstance(table, dict) or table.get(key) is None:
            return False
        table = table[key]
    return bool(place)
