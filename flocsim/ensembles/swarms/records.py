"""What of a replicate goes into the journal: its bodies, its snapshots, its state now and then.

A record is a description and arrays, one after another, whose names, types and shapes the
description lists. The last state of a replicate is what it goes on from.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from flocsim.io.json_text import matches
from flocsim.io.records import Record

BODIES, MOMENT, STATE = "bodies", "moment", "state"
"""What a replicate's records are of."""

LISTED = {"of": str, "arrays": [[object]]}
KINDS = {"f8": np.float64, "i8": np.int64, "i4": np.int32}


@attrs.frozen(eq=False)
class Part:
    """One record of a replicate: what it is ``of``, further ``facts``, and its ``arrays``."""

    of: str
    arrays: dict[str, np.ndarray]
    facts: dict[str, Any] = attrs.Factory(dict)

    def described(self) -> tuple[dict[str, Any], bytes]:
        """(description, data) of the record."""
        listed = [
            [name, array.dtype.str[1:], list(array.shape)] for name, array in self.arrays.items()
        ]
        data = b"".join(np.ascontiguousarray(each).tobytes() for each in self.arrays.values())
        return {"of": self.of, "arrays": listed, "facts": told(self.facts)}, data


Read = Callable[[int, int], bytes]
"""Bytes of the journal: (offset, length)."""


@attrs.frozen(eq=False)
class Left:
    """Where a replicate was left: how many snapshots it has, and the state of its Progress."""

    moments: int
    state: dict[str, np.ndarray]


@attrs.define(eq=False)
class Found:
    """What a journal has of a replicate: records of its bodies, of its snapshots by place, and of
    its last state."""

    bodies: Record | None = None
    moments: dict[int, Record] = attrs.Factory(dict)
    state: Record | None = None

    @classmethod
    def of(cls, records: Iterable[Record]) -> "Found":
        """What these records are, which were checked."""
        found = cls()
        for record in records:
            about = record.description
            if about["of"] == MOMENT:
                found.moments[about["facts"]["place"]] = record
            else:
                setattr(found, about["of"], record)
        return found

    def left(self, read: Read) -> Left | None:
        """Where it goes on; None where it begins anew."""
        if self.state is None or self.bodies is None:
            return None
        state = part_in(self.state, read)
        count = state.facts["moments"]
        return Left(count, state.arrays) if self.has(count) else None

    def has(self, moments: int) -> bool:
        """Whether its bodies and first snapshots are there."""
        return self.bodies is not None and all(place in self.moments for place in range(moments))


def part_in(record: Record | None, read: Read) -> Part:
    """The Part of a record that is there."""
    assert record is not None, "a replicate that was read must have its bodies"
    return part_of(record.description, read(record.offset, record.length))


def told(facts: Mapping[str, Any]) -> dict[str, Any]:
    """Facts as JSON has them: what is not a number is None."""
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in facts.items()
    }


def part_of(about: dict[str, Any], data: bytes) -> Part:
    """The Part of a record of the journal, by its description; ValueError where it is none."""
    if not matches(about, LISTED):
        raise ValueError("a record has an unknown form")
    arrays, place = {}, 0
    for listed in about["arrays"]:
        name, kind, shape = checked_listing(listed)
        count = math.prod(shape)
        size = count * np.dtype(KINDS[kind]).itemsize
        if place + size > len(data):
            raise ValueError(f"the array {name} of a record is truncated")
        values = np.frombuffer(data, KINDS[kind], count, place)
        arrays[name] = values.reshape(shape).copy()
        place += size
    if place != len(data):
        raise ValueError("a record has more arrays than it lists")
    facts = about.get("facts", {})
    if not isinstance(facts, dict):
        raise ValueError("a record has an unknown form")
    return Part(about["of"], arrays, facts)


def checked_listing(listed: Sequence[Any]) -> tuple[str, str, tuple[int, ...]]:
    """(name, kind, shape) of a listed array; ValueError where it lists none."""
    words = len(listed) == 3 and all(isinstance(each, str) for each in listed[:2])
    if words and listed[1] in KINDS:
        shape = listed[2]
        known = isinstance(shape, list) and len(shape) <= 3
        if known and all(type(each) is int and 0 <= each < 2**32 for each in shape):
            return listed[0], listed[1], tuple(shape)
    raise ValueError("a record lists no arrays")
