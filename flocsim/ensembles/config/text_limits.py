"""How long and how deeply nested a TOML text may be, said before it is parsed.

tomllib takes a time that grows with the square of a dotted key's parts (90 s for 600 kB of
"a.a.a…"), and of other things that no config has.
"""

import re
from collections.abc import Iterator

LARGEST_FILE = 100_000
LONGEST_LINE = 10_000
MOST_LINES = 5_000
MOST_PARTS = 6
DEEPEST = 6
LONGEST_KEY = 100
MOST_KEYS = 2_000

# Strings and comments first, so that what is in them is not taken for keys or brackets. A quote
# that has no end ends the search: tomllib gets no further either.
TOKEN = re.compile(
    r"""(?P<text>'{3}.*?'{3}|"{3}[^"\\]*(?:(?:\\.|"(?!""))[^"\\]*)*"{3}"""
    r"""|"(?!"")[^"\\\n]*(?:\\.[^"\\\n]*)*"|'(?!'')[^'\n]*')|(?P<open>["'])"""
    r"""|(?P<comment>\#[^\n]*)|(?P<mark>[][{}.=\n])""",
    re.DOTALL,
)


def text_problem(text: str) -> tuple[int, str] | None:
    """(line, what is wrong) of the first limit that a TOML text passes; None where it keeps all."""
    if len(text) > LARGEST_FILE:
        return 0, f"longer than {LARGEST_FILE} letters"
    lines = text.split("\n")
    if len(lines) > MOST_LINES:
        return MOST_LINES, f"more than {MOST_LINES} lines"
    for number, line in enumerate(lines, 1):
        if len(line) > LONGEST_LINE:
            return number, f"a line of more than {LONGEST_LINE} letters"
    return next(deep_places(text), None)


def deep_places(text: str) -> Iterator[tuple[int, str]]:
    """(line, what is wrong) of keys of too many parts, of nesting, and of too many keys."""
    line, depth, dots, keys = 1, 0, 0, 0
    for found in TOKEN.finditer(text):
        kind, token = found.lastgroup, found[0]
        if kind == "open":
            return
        if kind == "mark" and token == ".":
            dots += 1
        elif kind == "mark":
            dots = 0
            depth += (token in "[{") - (token in "]}")
            keys += token == "="
        if dots >= MOST_PARTS:
            yield line, f"a key of more than {MOST_PARTS} parts"
        if depth > DEEPEST:
            yield line, f"lists or tables nested more than {DEEPEST} deep"
        if keys > MOST_KEYS:
            yield line, f"more than {MOST_KEYS} keys"
        line += token.count("\n")


def key_problem(table: object) -> str:
    """What is wrong with the keys of a parsed text, in words; "" where nothing is."""
    row = [table]
    while row:
        inner: list = []
        for each in row:
            if isinstance(each, dict):
                long = next((key for key in each if len(key) > LONGEST_KEY), None)
                if long is not None:
                    return f"a key of more than {LONGEST_KEY} letters, {long[:20]!r}…"
                inner += each.values()
            elif isinstance(each, list):
                inner += each
        row = inner
    return ""
