"""From the rows of all replicates to tables and columns, a block of replicates at a time."""

from collections.abc import Iterable, Iterator

import attrs
import numpy as np

from flocsim.ensembles.estimates.paired import joint_counts, paired_differences
from flocsim.ensembles.estimates.statistics import (
    checked_codes,
    count,
    pooled_probabilities,
    pooled_sums,
    probabilities,
)
from flocsim.ensembles.storage.row_store import RowStore

BLOCK = 16_384
"""Replicates of each condition that are looked at together."""


@attrs.define
class Reader:
    """All rows of a finished study, in the order of the results file.

    ``shape``: how many types, vertices, delta, replicates.
    """

    store: RowStore
    shape: tuple[int, ...]
    known: list[np.ndarray] = attrs.field(init=False)

    def __attrs_post_init__(self):
        self.known = [self.store.known(place) for place in range(len(self.store.conditions))]

    def blocks(self) -> Iterator[tuple[int, int]]:
        count = self.shape[-1]
        for first in range(0, count, BLOCK):
            yield first, min(first + BLOCK, count)

    def part(self, name, place, first, stop):
        return self.store.read(place, name, first, stop, self.known[place])

    def block(self, name: str, first: int, stop: int) -> np.ndarray:
        """Some values of all conditions (type, vertices, delta, replicate)."""
        parts = [self.part(name, place, first, stop) for place in range(len(self.known))]
        return np.stack(parts).reshape(*self.shape[:3], stop - first)

    def column(self, name: str) -> Iterator[bytes]:
        """A column as the results file holds it, as bytes."""
        for place in range(len(self.known)):
            for first, stop in self.blocks():
                yield self.part(name, place, first, stop).tobytes()

    def arrays(self, columns: Iterable[str]) -> dict[str, np.ndarray]:
        """{name: array (type, vertices, delta, replicate)}, in memory."""
        return {name: self.block(name, 0, self.shape[-1]) for name in columns}


def summarize(reader: Reader) -> tuple[dict, dict, dict]:
    """(probabilities, pooled, differences) of a study: whole numbers added up, then divided."""
    sums: dict[str, np.ndarray] | None = None
    for first, stop in reader.blocks():
        outcome, inside = (reader.block(name, first, stop) for name in ("outcome", "inside"))
        checked_codes(outcome, inside)
        found = {
            **count(outcome, inside),
            **pooled_sums(outcome, inside),
            "joint": joint_counts(outcome, inside),
        }
        sums = found if sums is None else {name: sums[name] + found[name] for name in sums}
    assert sums is not None, "a study has one replicate at least"
    counts = {name: values for name, values in sums.items() if name.startswith("n_")}
    pooled = {name: values for name, values in sums.items() if name.startswith("pr_")}
    return (
        counts | probabilities(counts),
        pooled_probabilities(pooled),
        paired_differences(sums["joint"]),
    )
