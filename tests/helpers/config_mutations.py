"""Config files that something was done to: texts from the valid one, drawn by hypothesis."""

import datetime
import math
import tomllib

from hypothesis import strategies as st

from flocsim.ensembles.config.schema import FORCES, TABLES
from tests.helpers.small_study import VALID

JUNK = st.recursive(
    st.one_of(
        st.booleans(),
        st.integers(-(10**40), 10**40),
        st.floats(),
        st.text(max_size=12),
        st.sampled_from(["1 um", "3 kg", "1 J", "auto", "sphere", "own:X", "si", "0 s", "1e999 m"]),
        st.dates(),
        st.datetimes(),
        st.times(),
    ),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=6), inner, max_size=3)
    ),
    max_leaves=6,
)
KEYS = [*TABLES, *FORCES, "seed", "preset", "class", "k_n", "density", "pairs", "a b", "", "\n"]
MUTATION = st.tuples(st.integers(0, 10**6), st.sampled_from("vkdn"), JUNK, st.sampled_from(KEYS))


def letter_in_toml(letter):
    """A letter of a quoted string, escaped where it has to be."""
    plain = letter.isprintable() and letter not in '"\\'
    return letter if plain else f"\\U{ord(letter):08x}"


def toml(value):
    """A value as TOML, tables inline."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if isinstance(value, str):
        return '"' + "".join(map(letter_in_toml, value)) + '"'
    if isinstance(value, dict):
        return "{" + ", ".join(f"{toml(key)} = {toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    if isinstance(value, datetime.date | datetime.time):
        return value.isoformat()
    return repr(value)


def tables_of(table):
    """The table and all tables in it."""
    nested = [inner for value in table.values() if isinstance(value, dict) for inner in [value]]
    return [table, *(found for inner in nested for found in tables_of(inner))]


def mutate(table, number, kind, junk, new_key):
    """Replace a value, rename or drop a key, or wrap a value in a table, somewhere in the file."""
    tables = [found for found in tables_of(table) if found]
    if not tables:
        return
    chosen = tables[number % len(tables)]
    key = list(chosen)[number // len(tables) % len(chosen)]
    value = chosen.pop(key)
    if kind == "v":
        chosen[key] = junk
    elif kind == "k":
        chosen[new_key] = value
    elif kind == "n":
        chosen[key] = {new_key: value}


def mutated(mutations):
    """The valid file with some mutations, as text."""
    table = tomllib.loads(VALID)
    for mutation in mutations:
        mutate(table, *mutation)
    return "\n".join(f"{toml(key)} = {toml(value)}" for key, value in table.items())


MUTATED = st.lists(MUTATION, min_size=1, max_size=4).map(mutated)
"""Entries are replaced, renamed, dropped or nested."""

GARBLED = st.tuples(st.integers(0, len(VALID)), st.integers(0, 30), st.text(max_size=5)).map(
    lambda drawn: VALID[: drawn[0]] + drawn[2] + VALID[drawn[0] + drawn[1] :]
)
"""A piece is cut out and letters are put in."""
