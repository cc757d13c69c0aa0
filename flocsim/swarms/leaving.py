"""What becomes of bodies that leave a box through a side at which it does not repeat itself.

Looked at between two windows: a cluster leaves, as a whole, when the circles around all its bodies
are outside. It is removed, or moved back in over the opposite side (the top, where it left through
a wall at the side), as it is and with all its contacts, at a random place across which keeps clear
of others.
"""

from collections.abc import Sequence

import attrs
import numpy as np

import flocsim.arrays as at
from flocsim.swarms.arrays import EARLIER_BODY, LATER_BODY, Swarm, with_links
from flocsim.swarms.together.clusters import placed_together
from flocsim.swarms.together.contacts import Gauge

KEEP, REMOVE, REENTER = "keep", "remove", "reenter"

MOST_TRIALS = 200
"""Places tried for what comes back, before it is put further out."""

CLEAR = 0.05
"""What comes back keeps clear of others by this share of its own size."""

PARKED = 10.0
"""Bodies that are gone lie outside, so many times the largest apart."""


@attrs.frozen(eq=False)
class Leaving:
    """A rule for a swarm in the area (0, 0) to ``area`` [m], which repeats itself along the axes
    flagged in ``repeats``; nothing leaves through a ``floor``.

    ``key``: whole numbers that say, with the body and how often it has come back, where it comes
    back. ``gauge`` tells which bodies touch.
    """

    rule: str
    area: tuple[float, float]
    repeats: tuple[bool, bool]
    floor: bool
    key: Sequence[int]
    gauge: Gauge

    def outside(self, swarm: Swarm, present: np.ndarray) -> np.ndarray:
        """Which bodies are outside, with all of their circles, and will not come back themselves:
        through the top only what rises."""
        x, y = swarm.motion[:, at.X], swarm.motion[:, at.Y]
        reach = swarm.bodies[:, at.BOUNDING_RADIUS]
        found = np.zeros(len(x), bool)
        if not self.repeats[0]:
            found |= (x < -reach) | (x > self.area[0] + reach)
        if not self.repeats[1]:
            found |= (y > self.area[1] + reach) & (swarm.motion[:, at.VY] > 0.0)
            if not self.floor:
                found |= y < -reach
        return found & present

    def leaving(self, swarm: Swarm, present: np.ndarray) -> list[np.ndarray]:
        """The clusters that leave, each as its bodies, in the order of their first ones."""
        out = self.outside(swarm, present)
        if not out.any():
            return []
        near = self.gauge.neighbours(swarm.motion[:, : at.ANGLE + 1])
        both = present[near.pairs].all(axis=1)
        near = attrs.evolve(
            near, pairs=near.pairs[both], gap=near.gap[both], vector=near.vector[both]
        )
        labels, _ = placed_together(len(out), near)
        clusters = [np.flatnonzero(labels == label) for label in np.unique(labels[out])]
        whole = [members for members in clusters if out[members].all()]
        return sorted(whole, key=lambda members: int(members[0]))

    def removed(self, swarm: Swarm, gone: np.ndarray) -> Swarm:
        """The swarm without some bodies (n,) bool, which lie outside from now on."""
        swarm.motion[gone] = 0.0
        apart = PARKED * max(float(swarm.bodies[:, at.BOUNDING_RADIUS].max()), *self.area)
        axis = at.X if not self.repeats[0] else at.Y
        swarm.motion[gone, axis] = -apart * (2.0 + np.arange(len(gone)))[gone]
        for array in (swarm.stated, swarm.strayed, swarm.carried, swarm.errors):
            array[gone] = 0.0
        pairs = swarm.links[:, [LATER_BODY, EARLIER_BODY]]
        kept = ~gone[pairs].any(axis=1)
        return with_links(swarm, [(swarm.links[kept], swarm.slips[kept])])

    def returned(self, swarm: Swarm, members: np.ndarray, present: np.ndarray, count: int) -> None:
        """Move a cluster back in, for the ``count``-th time."""
        rng = np.random.Generator(np.random.Philox(np.random.SeedSequence(
            tuple(self.key), spawn_key=(int(members[0]), count)
        )))  # fmt: skip
        place, reach = swarm.motion[members, :2], swarm.bodies[members, at.BOUNDING_RADIUS]
        low = (place - reach[:, None]).min(axis=0)
        high = (place + reach[:, None]).max(axis=0)
        wide, tall = high - low
        rises = not self.repeats[1] and low[1] > self.area[1]
        others = present.copy()
        others[members] = False
        out, clear = 0.0, CLEAR * max(wide, tall)
        while True:
            for _ in range(MOST_TRIALS):
                across = rng.random() * (self.area[0] if self.repeats[0] else
                                         max(self.area[0] - wide, 0.0))  # fmt: skip
                up = -tall - out if rises else self.area[1] + out
                if self.repeats[1]:
                    # Left through a side of a box that repeats itself upwards.
                    up = rng.random() * self.area[1]
                shift = np.array([across, up]) - low
                if self.is_clear(swarm, place + shift, reach + clear, others):
                    swarm.motion[members, :2] = place + shift
                    return
            out += tall

    def is_clear(
        self, swarm: Swarm, places: np.ndarray, reach: np.ndarray, others: np.ndarray
    ) -> bool:
        """Whether circles keep clear of those around other bodies."""
        there, radii = swarm.motion[others, :2], swarm.bodies[others, at.BOUNDING_RADIUS]
        for place, radius in zip(places, reach, strict=True):
            way = there - place
            for axis in range(2):
                if self.repeats[axis]:
                    side = self.area[axis]
                    way[:, axis] -= side * np.floor(way[:, axis] / side + 0.5)
            if np.any(np.hypot(*way.T) < radii + radius):
                return False
        return True
