"""The rows of finished replicates and the parts of unfinished ones, by condition and replicate.

They lie in the journal; this knows which replicates of each condition it has. Rows are read through
their checksums whenever they are needed.
"""

import json
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import attrs
import numpy as np

from flocsim.ensembles.kind import (
    LARGEST_REPLICATE,
    MOST_ROWS,
    ROW,
    Condition,
    Interval,
    merged,
    missing,
    total,
)
from flocsim.errors import FileError
from flocsim.io.journal import CHUNK, OLD, PART, Journal, JournalReader, Record
from flocsim.io.json_text import matches, read_json
from flocsim.io.results.run_group import NOTE

Check = Callable[[np.ndarray], object]
"""Raises ValueError for rows that no run can have given."""


def key_of(condition: Condition) -> str:
    """Return the name of a condition as the journal has it."""
    return json.dumps(condition)


def condition_of(key: str) -> Condition:
    """Return the condition with this name in a journal; ValueError where it is none."""
    found = read_json(key, [object])
    if len(found) != 3 or not all(map(matches, found, (str, int, float))):
        raise ValueError("its condition is unknown")
    return Condition(*found)


@attrs.frozen
class Parts:
    """What is saved of one replicate: ``ids`` {name: record in the journal}."""

    journal: JournalReader
    ids: dict[str, int] = attrs.Factory(dict)

    def __contains__(self, name: object) -> bool:
        return name in self.ids

    def read(self, name: str) -> tuple[dict[str, Any], bytes]:
        """Return (description, data) of a part; FileError where it is damaged by now."""
        if (record := self.journal.record(self.ids[name])) is None:
            raise FileError(f"{self.journal.path} is damaged: run it again with --resume")
        return record.about, record.data


@attrs.define(eq=False)
class RowStore:
    """The rows of a study's ``conditions`` in a journal, and its ``parts`` {(index of the
    condition, replicate): Parts}.

    ``runs``: of each condition the replicates that are there, and ``computed`` those that this
    journal's own runs computed, not read from an older file.
    """

    journal: JournalReader
    conditions: tuple[Condition, ...]
    row: np.dtype = ROW
    parts: dict[tuple[int, int], Parts] = attrs.field(init=False)
    indices: dict[str, int] = attrs.field(init=False)
    runs: list[list[Interval]] = attrs.field(init=False)
    computed: list[list[Interval]] = attrs.field(init=False)

    def __attrs_post_init__(self):
        self.parts = defaultdict(lambda: Parts(self.journal))
        self.indices = {key_of(condition): k for k, condition in enumerate(self.conditions)}
        self.runs = [[] for _ in self.conditions]
        self.computed = [[] for _ in self.conditions]

    @property
    def writer(self) -> Journal:
        """The journal of a study that runs."""
        assert isinstance(self.journal, Journal), "opened to be written"
        return self.journal

    def add(self, place: int, first: int, rows: np.ndarray, about: Mapping[str, Any]) -> None:
        """Write down the rows of replicates from the ``first`` on."""
        key = key_of(self.conditions[place])
        data = np.ascontiguousarray(rows, self.row).tobytes()
        self.writer.add(CHUNK, key, first, dict(about), data)
        self.note(place, first, first + len(rows))

    def copy(self, condition: Condition, first: int, rows: np.ndarray) -> None:
        """Write down rows of an older results file, which `take` notes later."""
        for start in range(0, len(rows), MOST_ROWS):
            data = np.ascontiguousarray(rows[start : start + MOST_ROWS], self.row).tobytes()
            self.writer.add(OLD, key_of(condition), first + start, {}, data)

    def add_part(
        self, place: int, replicate: int, name: str, about: Mapping[str, Any], data: bytes
    ) -> None:
        """Write down what is saved of a replicate, in the place of an earlier part of that name."""
        ids, key = self.parts[place, replicate].ids, key_of(self.conditions[place])
        ids[name] = self.writer.add(
            PART, key, replicate, {**about, "name": name}, data, ids.get(name)
        )

    def note(self, place: int, first: int, stop: int, kind: str = CHUNK) -> None:
        """Note that replicates of a condition are there."""
        for runs in (self.runs,) if kind == OLD else (self.runs, self.computed):
            runs[place] = merged([*runs[place], (first, stop)])

    def take(self, record: Record, check: Check) -> int | None:
        """Note the rows or the part of a record that was found; the index of its condition, None
        where it is of none of these. ValueError where it is nothing that a run can have left."""
        condition_of(record.condition)
        place = self.indices.get(record.condition)
        if record.kind == PART:
            name = record.about.get("name")
            if not isinstance(name, str) or not 0 <= record.first < LARGEST_REPLICATE:
                raise ValueError("what was saved of a replicate has an unknown form")
            if place is not None:
                self.parts[place, record.first].ids[name] = record.id
        else:
            rows = self.rows_of(record)
            if place is not None:
                check(rows)
                self.note(place, record.first, record.first + len(rows), record.kind)
        return place

    def rows_of(self, record: Record) -> np.ndarray:
        """Return the rows of a record; ValueError where it has none."""
        count, rest = divmod(len(record.data), self.row.itemsize)
        in_range = 0 <= record.first < record.first + count <= LARGEST_REPLICATE
        notes = matches(record.about.get("notes", []), [NOTE])
        if rest or count > MOST_ROWS or not in_range or not notes:
            raise ValueError("its form is unknown")
        return np.frombuffer(record.data, self.row)

    def intervals(self, place: int) -> list[Interval]:
        """Return the replicates of a condition that exist."""
        return self.runs[place]

    def there(self) -> int:
        """Return how many replicates exist."""
        return sum(map(total, self.runs))

    def rows(self, place: int, first: int, stop: int) -> np.ndarray:
        """Return the rows of replicates [first, stop), all of which exist.

        FileError where one is missing, or is not what was written.
        """
        found = np.zeros(stop - first, self.row)
        reached = []
        key = key_of(self.conditions[place])
        for record in self.journal.chunks(key, first - MOST_ROWS, stop):
            rows = np.frombuffer(record.data, self.row)
            low, high = max(record.first, first), min(record.first + len(rows), stop)
            if low < high:
                found[low - first : high - first] = rows[low - record.first : high - record.first]
                reached.append((low, high))
        if missing(merged(reached), first, stop):
            raise FileError(
                f"{self.journal.path} does not have all rows: run it again with --resume"
            )
        return found

    def all_rows(self, place: int) -> Iterable[np.ndarray]:
        """Yield the rows of all replicates of a condition that there are, some at a time."""
        for first, stop in self.runs[place]:
            for start in range(first, stop, MOST_ROWS):
                yield self.rows(place, start, min(start + MOST_ROWS, stop))
