"""What of a replicate goes into the journal: its bodies, its snapshots, its state now and then.

A record is a description and arrays, one after another, whose names, types and shapes the
description lists. The last state of a replicate is what it goes on from.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from flocsim.io.journal.records import SNAPSHOT, Record, encode
from flocsim.io.json_text import matches

BODIES, MOMENT, STATE, END = "bodies", "moment", "state", "end"
"""Kinds of a replicate's records."""

LISTED = {"replicate": int, "of": str, "arrays": [[object]]}
NUMBERS = ("time", "error")
"""Numbers that a MOMENT says, beside SUMMARY."""

SUMMARY = (
    "clusters", "largest", "mean_size", "gyration", "porosity", "fractal_dimension", "settling",
    "bonds_certificate", "bonds_hook", "bonds_rest", "bonds_touching", "removed",
    "reentered",
)  # fmt: skip
"""What is told of the clusters at a moment, as flocsim.io.results.swarm_file.COUNTS says."""

KINDS = {"f8": np.float64, "i8": np.int64, "i4": np.int32}


@attrs.frozen(eq=False)
class Part:
    """One record of a replicate: what it is ``of``, further ``facts``, and its ``arrays``."""

    replicate: int
    of: str
    arrays: dict[str, np.ndarray]
    facts: dict[str, Any] = attrs.Factory(dict)

    def described(self) -> tuple[dict[str, Any], bytes]:
        """(description, data) of the record."""
        listed = [
            [name, array.dtype.str[1:], list(array.shape)] for name, array in self.arrays.items()
        ]
        description = {"replicate": self.replicate, "of": self.of, "arrays": listed}
        data = b"".join(np.ascontiguousarray(each).tobytes() for each in self.arrays.values())
        return description | {"facts": told(self.facts)}, data

    def encoded(self) -> bytes:
        """The record as the journal has it."""
        return encode(SNAPSHOT, *self.described())


def told(facts: Mapping[str, Any]) -> dict[str, Any]:
    """Facts as JSON has them: what is no number is None."""
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in facts.items()
    }


def part_of(record: Record, data: bytes) -> Part:
    """The Part of a record of the journal; ValueError where it is none."""
    about = record.description
    if record.kind != SNAPSHOT or not matches(about, LISTED):
        raise ValueError("a record is of another form")
    arrays, place = {}, 0
    for listed in about["arrays"]:
        name, kind, shape = checked_listing(listed)
        count = math.prod(shape)
        size = count * np.dtype(KINDS[kind]).itemsize
        if place + size > len(data):
            raise ValueError(f"the array {name} of a record is cut short")
        values = np.frombuffer(data, KINDS[kind], count, place)
        arrays[name] = values.reshape(shape).copy()
        place += size
    if place != len(data):
        raise ValueError("a record has more than it lists")
    facts = about.get("facts", {})
    if not isinstance(facts, dict):
        raise ValueError("a record is of another form")
    return Part(about["replicate"], about["of"], arrays, facts)


def checked_listing(listed: Sequence[Any]) -> tuple[str, str, tuple[int, ...]]:
    """(name, kind, shape) of a listed array; ValueError where it lists none."""
    words = len(listed) == 3 and all(isinstance(each, str) for each in listed[:2])
    if words and listed[1] in KINDS:
        shape = listed[2]
        known = isinstance(shape, list) and len(shape) <= 3
        if known and all(type(each) is int and 0 <= each < 2**32 for each in shape):
            return listed[0], listed[1], tuple(shape)
    raise ValueError("a record lists no array")
