"""Which bodies of a swarm are near each other at an instant, and how near."""

from collections.abc import Callable

import attrs
import numpy as np

import flocsim.arrays as at
from flocsim.arrays import Scene, with_room, work_of
from flocsim.compiler.composer import compose
from flocsim.geometry.contact.body_pairs import list_near
from flocsim.geometry.contact.near_pairs import gap_between
from flocsim.geometry.contact.separation import separation


def measure_gaps(scene, work, within):
    """List the pairs whose bounding circles are nearer than that, their gaps as budgets [m]; False
    without room."""
    if not list_near(scene, work, within):
        return False
    for pair in range(work.tally[at.PAIRS]):
        a, b = work.pairs[pair, at.LATER], work.pairs[pair, at.EARLIER]
        work.budget[pair] = gap_between(scene, work, a, b)
    return True


def vectors_between(scene, work, vectors):
    """From the earlier to the later body of every listed pair, by the nearest image [m]."""
    for pair in range(work.tally[at.PAIRS]):
        x, y = separation(
            scene, work, at.NOW, work.pairs[pair, at.LATER], work.pairs[pair, at.EARLIER]
        )
        vectors[pair, 0], vectors[pair, 1] = x, y


@attrs.frozen(eq=False)
class Neighbours:
    """Pairs of bodies, not both fixed, that are near each other: ``pairs`` (m, 2), the later one
    first; ``gap`` (m,) [m] between their outlines, below 0 where they overlap; ``vector`` (m, 2)
    [m] from the centroid of the earlier one to that of the later one's nearest image."""

    pairs: np.ndarray
    gap: np.ndarray
    vector: np.ndarray


class Gauge:
    """Measures the gaps of a scene's bodies, wherever they are."""

    def __init__(self, scene: Scene, fillings: dict[Callable, Callable]) -> None:
        self.scene = scene
        geometry = {
            hook: function for hook, function in fillings.items()
            if hook in (gap_between, separation)
        }  # fmt: skip
        self.gaps, self.vectors = (
            compose(measure_gaps, geometry),
            compose(vectors_between, geometry),
        )
        n = len(scene.bodies)
        self.work = work_of(scene, np.zeros((n, 3)), np.zeros((n, 3)), 1, blocks=0, all_pairs=False)

    def neighbours(self, position: np.ndarray, within: float = 0.0) -> Neighbours:
        """The pairs nearer than a gap [m] where the bodies are at ``position`` (n, 3)."""
        self.work.motion[at.NOW, :, :3] = position
        while not self.gaps(self.scene, self.work, within):
            self.work = with_room(self.work)
        count = int(self.work.tally[at.PAIRS])
        vectors = np.zeros((count, 2))
        self.vectors(self.scene, self.work, vectors)
        gaps = self.work.budget[:count]
        near = gaps < within if within > 0.0 else gaps <= 0.0
        return Neighbours(
            self.work.pairs[:count, :2][near].copy(), gaps[near].copy(),
            vectors[near],
        )  # fmt: skip
