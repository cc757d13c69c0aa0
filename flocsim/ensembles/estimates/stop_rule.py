"""The rule that ends a study early, where the config asks for one."""

import math

import attrs
import numpy as np

from flocsim.ensembles.estimates.statistics import count, probabilities
from flocsim.ensembles.storage.row_store import RowStore

GROWTH = 1.25
"""Each look is at so many times the replicates of the one before."""


def borders(stop, replicates):
    """The numbers of replicates at which the rule looks; the last is ``replicates``."""
    looks = []
    look = stop.least
    while stop.half_width is not None and look < replicates:
        looks.append(look)
        look = math.ceil(GROWTH * look)
    return [*looks, replicates]


@attrs.define
class StopRule:
    """Whether the first so many replicates of every condition are enough. Counts as it goes."""

    stop: object
    store: RowStore
    seen: int = 0
    counts: list = None

    def __call__(self, replicates):
        """Whether the study may end with this many, all of which exist."""
        for place in range(len(self.store.conditions)):
            codes = (
                self.store.read(place, name, self.seen, replicates)
                for name in ("outcome", "inside")
            )
            self.add(place, count(*codes))
        self.seen = replicates
        if self.stop.half_width is None:
            return False
        return all(self.is_narrow(counts) for counts in self.counts)

    def add(self, place, more):
        if self.counts is None:
            self.counts = [None] * len(self.store.conditions)
        before = self.counts[place]
        self.counts[place] = {n: more[n] + (before[n] if before else 0) for n in more}

    def is_narrow(self, counts):
        table = probabilities(counts)
        widths = [table[f"{name}_high"] - table[f"{name}_low"] for name in self.stop.of]
        return not np.any(0.5 * np.array(widths) > self.stop.half_width)
