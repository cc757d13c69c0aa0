"""Where the rows of finished replicates lie: in the journal, or in an older results file."""

import attrs
import numpy as np

from flocsim.ensembles.chunks import ROW, STARTS, merged

ENTRY = np.dtype([("first", "<i8"), ("stop", "<i8"), ("offset", "<i8")])
"""A run of rows: its replicates, and where its data begin in the journal; −1: in the old file."""


@attrs.define(eq=False)
class OldTable:
    """The table of replicates of a results file that is open: dataset by name."""

    datasets: object
    places: dict

    def read(self, condition, name, first, stop):
        """Part of a column."""
        return self.datasets[name][(*self.places[condition], slice(first, stop))]


@attrs.define(eq=False)
class RowStore:
    """Finds rows by condition and replicate. Few bytes per chunk, none per row."""

    journal: object
    conditions: tuple
    old: OldTable = None
    entries: list = attrs.field(init=False)
    counts: list = attrs.field(init=False)

    def __attrs_post_init__(self):
        self.entries = [np.empty(4, ENTRY) for _ in self.conditions]
        self.counts = [0] * len(self.conditions)

    def add(self, place, first, stop, offset):
        """Note where rows of the condition at a place of the list lie."""
        count = self.counts[place]
        if count == len(self.entries[place]):
            self.entries[place] = np.concatenate([self.entries[place]] * 2)
        self.entries[place][count] = (first, stop, offset)
        self.counts[place] = count + 1

    def known(self, place):
        """The entries of a condition, in order of the replicates."""
        found = self.entries[place][: self.counts[place]]
        return np.sort(found, order=("first", "stop"))

    def intervals(self, place):
        """What exists of a condition."""
        return merged([(int(e["first"]), int(e["stop"])) for e in self.known(place)])

    def read(self, place, name, first, stop, known=None):
        """The values of a column for replicates [first, stop), all of which exist."""
        values = np.empty(stop - first, ROW[name])
        known = self.known(place) if known is None else known
        longest = int(np.max(known["stop"] - known["first"], initial=0))
        near = slice(*np.searchsorted(known["first"], (first - longest, stop)))
        for start, end, offset in known[near].tolist():
            low, high = max(start, first), min(end, stop)
            if low < high:
                part = self.part(place, name, (start, end, offset), low, high)
                values[low - first : high - first] = part
        return values

    def part(self, place, name, entry, low, high):
        start, end, offset = entry
        if offset < 0:
            return self.old.read(self.conditions[place], name, low, high)
        size = ROW[name].itemsize
        offset += (end - start) * STARTS[name] + (low - start) * size
        return np.frombuffer(self.journal.read(offset, (high - low) * size), ROW[name])
