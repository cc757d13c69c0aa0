"""What the islands of a window have come to, and the contacts that they leave.

A window is tried again with other islands where bodies have strayed further than others counted on;
an island of the same bodies as before is not run again.
"""

from typing import TYPE_CHECKING

import numpy as np

from flocsim.swarms.arrays import EARLIER_BODY, LATER_BODY, LINK_COLUMNS, SLIP_COLUMNS

if TYPE_CHECKING:
    from flocsim.swarms.runner import Islands

NONE = -1
"""Label of a body whose island has not been run."""


class Finished:
    """The islands that have been run to the end of one window, of ``free`` (n,) bodies that move.

    ``labels`` (n,): which of them a free body is of; ``sizes`` (k,): bodies of each;
    ``links`` and ``slips``: the contacts that they leave, in any order.
    """

    def __init__(self, free: np.ndarray) -> None:
        self.free = free
        self.labels = np.full(len(free), NONE)
        self.sizes = np.zeros(0, dtype=np.int64)
        self.links = np.zeros((0, LINK_COLUMNS), dtype=np.int64)
        self.slips = np.zeros((0, SLIP_COLUMNS))

    def owners(self, links: np.ndarray) -> np.ndarray:
        """A free body of every contact."""
        later = links[:, LATER_BODY]
        return np.where(self.free[later], later, links[:, EARLIER_BODY])

    def missing(self, islands: "Islands") -> np.ndarray:
        """Which islands are not among them. One of the same free bodies, and as many fixed ones,
        has the same of these: it can reach no fewer than before."""
        if not len(self.sizes):
            return np.arange(len(islands.sizes))
        free, starts = self.free[islands.members], islands.starts[:-1]
        labels = self.labels[islands.members]
        last = np.maximum.reduceat(np.where(free, labels, NONE), starts)
        first = np.minimum.reduceat(np.where(free, labels, len(self.sizes)), starts)
        return np.flatnonzero((first != last) | (islands.sizes != self.sizes[last]))

    def add(self, islands: "Islands", links: np.ndarray, slips: np.ndarray) -> None:
        """Add islands, with the contacts that they leave; what was known of their bodies goes."""
        island = np.repeat(np.arange(len(islands.sizes)), islands.sizes)
        free = self.free[islands.members]
        bodies = islands.members[free]
        self.labels[bodies] = NONE
        kept = self.labels[self.owners(self.links)] != NONE
        self.labels[bodies] = len(self.sizes) + island[free]
        self.sizes = np.append(self.sizes, islands.sizes)
        self.links = np.concatenate([self.links[kept], links])
        self.slips = np.concatenate([self.slips[kept], slips])
