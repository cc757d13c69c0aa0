"""The rows of finished replicates and the parts of unfinished ones, by condition and replicate.

They lie in the journal; this knows which replicates of each condition it has. Rows are read through
their checksums whenever they are needed.
"""

import json
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
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
from flocsim.io.journal import (
    DAMAGED,
    PART,
    ROWS,
    SESSION,
    JournalReader,
    as_text,
)
from flocsim.io.json_text import matches, read_json
from flocsim.io.results.run_group import NOTE, SESSION_FORM


def sessions_of(journal: JournalReader) -> dict[int, dict]:
    """Return {id: description} of the runs that wrote a journal; FileError for what is none."""
    try:
        found = {row["id"]: read_json(row["about"], {}) for row in journal.records(SESSION)}
    except ValueError as error:
        raise FileError(f"{journal.path} {DAMAGED} ({error})") from error
    if not all(matches(each, SESSION_FORM) for each in found.values()):
        raise FileError(f"{journal.path} {DAMAGED} (it was not begun by flocsim)")
    return found


def key_of(condition: Condition) -> str:
    """Return the name of a condition as the journal has it."""
    return json.dumps(condition)


MOST_NOTES = 1000
"""Notes on failed replicates that are kept."""


@attrs.frozen
class Parts:
    """What is saved of one replicate: ``ids`` {name: record in the journal}."""

    journal: JournalReader
    ids: dict[str, int] = attrs.Factory(dict)

    def __contains__(self, name: object) -> bool:
        return name in self.ids

    def read(self, name: str) -> tuple[dict[str, Any], bytes]:
        """Return (description, data) of a part; FileError where it is damaged by now."""
        for record in self.journal.records(PART, "id=?", self.ids[name]):
            return read_json(record["about"], {}), record["data"]
        raise FileError(f"{self.journal.path} is damaged: run it again with --resume")


@attrs.define(eq=False)
class RowStore:
    """The rows of a study's ``conditions`` in a ``journal`` (a Journal, or a JournalReader where
    nothing is added), and its ``parts`` {(index of the condition, replicate): Parts}.

    ``identity`` is a digest of what new rows follow from, and ``session`` the run that computes
    them; rows with an identity among ``known`` agree with it. ``runs``: of each condition the
    replicates that are there; ``computed``: how many this journal's own runs have computed, not
    copied from older results; ``notes``: on replicates that failed; ``refused``: (table, id) of
    records that are damaged, or that no run of this study can have written.
    """

    journal: Any
    conditions: tuple[Condition, ...]
    row: np.dtype = ROW
    identity: str = ""
    known: set[str] = attrs.Factory(set)
    session: int = 0
    computed: int = 0
    notes: list[dict] = attrs.Factory(list)
    refused: set[tuple[str, int]] = attrs.Factory(set)
    parts: dict[tuple[int, int], Parts] = attrs.field(init=False)
    indices: dict[str, int] = attrs.field(init=False)
    runs: list[list[Interval]] = attrs.field(init=False)

    def __attrs_post_init__(self):
        self.parts = defaultdict(lambda: Parts(self.journal))
        self.indices = {key_of(condition): k for k, condition in enumerate(self.conditions)}
        self.runs = [[] for _ in self.conditions]

    def add(self, place: int, first: int, rows: np.ndarray, notes: Sequence[dict] = ()) -> None:
        """Write down the rows of replicates from the ``first`` on, and notes on failed ones."""
        self.write(key_of(self.conditions[place]), first, rows, notes, self.session)
        self.note(place, first, len(rows), notes)
        self.computed += len(rows)

    def copy(self, condition: Condition, first: int, rows: np.ndarray) -> None:
        """Write down rows of an older results file, which `load` notes later."""
        for start in range(0, len(rows), MOST_ROWS):
            self.write(key_of(condition), first + start, rows[start : start + MOST_ROWS], (), None)

    def write(
        self, key: str, first: int, rows: np.ndarray, notes: Sequence[dict], session: int | None
    ) -> None:
        data = np.ascontiguousarray(rows, self.row).tobytes()
        self.journal.add(
            ROWS, self.identity, session, key, first, len(rows), as_text(list(notes)), data
        )

    def add_part(
        self, place: int, replicate: int, name: str, about: Mapping[str, Any], data: bytes
    ) -> None:
        """Write down what is saved of a replicate, in the place of an earlier part of that name."""
        key = key_of(self.conditions[place])
        self.parts[place, replicate].ids[name] = self.journal.add(
            PART, self.identity, self.session, key, replicate, name, as_text(dict(about)), data
        )

    def note(self, place: int, first: int, count: int, notes: Sequence[dict]) -> None:
        """Note that replicates of a condition are there, with notes on those that failed."""
        self.runs[place] = merged([*self.runs[place], (first, first + count)])
        self.notes += notes[: MOST_NOTES - len(self.notes)]

    def load(
        self,
        check_whole: Callable[[np.ndarray, Any], object] = lambda rows, parts: None,
        trusts_copies: bool = False,
    ) -> None:
        """Take the parts and rows that the journal has, and note those that are ``refused``.

        ``check_whole(rows, parts)`` raises ValueError where what is saved of a finished replicate
        is not all there. Copies of rows have no parts, but those in the older results that lie
        beside the journal (``trusts_copies``).
        """
        known = {self.identity, *self.known}
        records = ((table, each) for table in (PART, ROWS) for each in self.journal.records(table))
        for table, record in records:
            first, place = record["first"], self.indices.get(record["condition"])
            is_replicate = isinstance(first, int) and 0 <= first < LARGEST_REPLICATE
            try:
                if record["identity"] not in known or not is_replicate:
                    raise ValueError("a record is of no run of this study")
                if table == ROWS:
                    rows = np.frombuffer(record["data"], self.row)
                    is_copy = record["session"] is None
                    notes = read_json(record["notes"], [NOTE])
                    if len(rows) != record["count"] or len(rows) > MOST_ROWS:
                        raise ValueError("a record has other rows than it says")
                    if place is not None and not (is_copy and trusts_copies):
                        check_whole(rows, self.parts.get((place, first), ()))
                    self.computed += 0 if is_copy else len(rows)
            except (ValueError, TypeError):
                self.refused.add((table, record["id"]))
                continue
            if place is not None and table == PART:
                self.parts[place, first].ids[record["name"]] = record["id"]
            elif place is not None:
                self.note(place, first, len(rows), notes)
        self.refused |= self.journal.damaged

    def there(self) -> int:
        """Return how many replicates exist."""
        return sum(map(total, self.runs))

    def rows(self, place: int, first: int, stop: int) -> np.ndarray:
        """Return the rows of replicates [first, stop), all of which exist.

        FileError where one is missing, or is not what was written.
        """
        found, reached = np.zeros(stop - first, self.row), []
        for record in self.journal.records(
            ROWS, "condition=? AND first>? AND first<?",
            key_of(self.conditions[place]), first - MOST_ROWS, stop,
        ):  # fmt: skip
            if (ROWS, record["id"]) in self.refused:
                continue
            rows, at = np.frombuffer(record["data"], self.row), record["first"]
            low, high = max(at, first), min(at + len(rows), stop)
            if low < high:
                found[low - first : high - first] = rows[low - at : high - at]
                reached.append((low, high))
        if missing(merged(reached), first, stop):
            raise FileError(
                f"{self.journal.path} does not have all rows, or was damaged after they were "
                "written: run it again with --resume, which computes what is missing"
            )
        return found

    def all_rows(self, place: int) -> Iterable[np.ndarray]:
        """Yield the rows of all replicates of a condition that there are, some at a time."""
        for first, stop in self.runs[place]:
            for start in range(first, stop, MOST_ROWS):
                yield self.rows(place, start, min(start + MOST_ROWS, stop))
