"""The rule that ends a study early, where the config asks for one."""

import math

import attrs
import numpy as np

from flocsim.ensembles.config.schema import StopConfig
from flocsim.ensembles.estimates.statistics import CODES, count, probabilities
from flocsim.ensembles.storage.row_store import RowStore

GROWTH = 1.25
"""Each look is at so many times the replicates of the one before."""


def borders(stop: StopConfig, replicates: int) -> list[int]:
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

    stop: StopConfig
    store: RowStore
    seen: int = 0
    counts: list[dict[str, np.ndarray]] = attrs.Factory(list)

    def __call__(self, replicates: int) -> bool:
        """Whether the study may end with this many, all of which exist."""
        for place in range(len(self.store.conditions)):
            codes = (self.store.read(place, name, self.seen, replicates) for name in CODES)
            more = count(*codes)
            if place == len(self.counts):
                self.counts.append(more)
            else:
                before = self.counts[place]
                self.counts[place] = {name: more[name] + before[name] for name in more}
        self.seen = replicates
        if self.stop.half_width is None:
            return False
        return all(self.is_narrow(counts) for counts in self.counts)

    def is_narrow(self, counts):
        table = probabilities(counts)
        widths = [table[f"{name}_high"] - table[f"{name}_low"] for name in self.stop.of]
        return not np.any(0.5 * np.array(widths) > self.stop.half_width)
