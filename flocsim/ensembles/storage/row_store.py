"""Where the rows of finished replicates lie: in the journal, or in an older results file."""

from collections.abc import Mapping
from typing import Any

import attrs
import numpy as np

from flocsim.ensembles.chunks import ROW, STARTS, Condition, Interval, merged
from flocsim.io.journal.journal import Journal, MemoryJournal

ENTRY = np.dtype([("first", "<i8"), ("stop", "<i8"), ("offset", "<i8")])
"""A run of rows: its replicates, and where its data begin in the journal; −1: in the old file."""


@attrs.define(eq=False)
class OldTable:
    """The table of replicates of a results file that is open: dataset by name.

    ``places``: Condition → its place in the arrays.
    """

    datasets: Mapping[str, Any]
    places: Mapping[Condition, tuple[int, int, int]]

    def read(self, condition: Condition, name: str, first: int, stop: int) -> np.ndarray:
        return self.datasets[name][(*self.places[condition], slice(first, stop))]


@attrs.define(eq=False)
class RowStore:
    """Finds rows by condition and replicate. Few bytes per chunk, none per row."""

    journal: Journal | MemoryJournal
    conditions: tuple[Condition, ...]
    old: OldTable | None = None
    entries: list[np.ndarray] = attrs.field(init=False)
    counts: list[int] = attrs.field(init=False)

    def __attrs_post_init__(self):
        self.entries = [np.empty(4, ENTRY) for _ in self.conditions]
        self.counts = [0] * len(self.conditions)

    def add(self, place: int, first: int, stop: int, offset: int) -> None:
        """Note where rows of the condition at a place of the list lie."""
        count = self.counts[place]
        if count == len(self.entries[place]):
            self.entries[place] = np.concatenate([self.entries[place]] * 2)
        self.entries[place][count] = (first, stop, offset)
        self.counts[place] = count + 1

    def known(self, place: int) -> np.ndarray:
        """The entries of a condition, in order of the replicates."""
        found = self.entries[place][: self.counts[place]]
        return np.sort(found, order=("first", "stop"))

    def intervals(self, place: int) -> list[Interval]:
        """The replicates of a condition that exist."""
        return merged([(int(e["first"]), int(e["stop"])) for e in self.known(place)])

    def read(
        self, place: int, name: str, first: int, stop: int, known: np.ndarray | None = None
    ) -> np.ndarray:
        """The values of a column for replicates [first, stop), all of which exist."""
        values = np.empty(stop - first, ROW[name])
        known = self.known(place) if known is None else known
        longest = int(np.max(known["stop"] - known["first"], initial=0))
        near = slice(*np.searchsorted(known["first"], (first - longest, stop)))
        for start, end, offset in known[near].tolist():
            low, high = max(start, first), min(end, stop)
            if low < high:
                if offset < 0:
                    assert self.old is not None, "rows of an older file, which is open"
                    part = self.old.read(self.conditions[place], name, low, high)
                else:
                    size = ROW[name].itemsize
                    offset += (end - start) * STARTS[name] + (low - start) * size
                    data = self.journal.read(offset, (high - low) * size)
                    part = np.frombuffer(data, ROW[name])
                values[low - first : high - first] = part
        return values
