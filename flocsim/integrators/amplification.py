"""By how much a motion amplifies a small difference of its start, by one nudged companion."""

import math
from collections.abc import Callable, Sequence

import attrs
import numpy as np

from flocsim.body import Body

NUDGE = 1e-4
"""How far the companion's bodies are moved, in the bounding radius of the smallest body that moves:
far enough to be told from what the steps' errors do, and near enough to be small."""

SEED = 13
"""Keys the directions in which they are moved: the same for every run."""

MOST_AMPLIFIED = 10.0
"""A motion that amplifies a nudge by more is one of whose error no sum of parts can speak."""


def end_distance(bodies: Sequence[Body], position: np.ndarray, exact: np.ndarray) -> float:
    """The furthest [m] that any point of an outline is from where it ought to be.

    ``position`` and ``exact`` (n, 3): x, y [m] and angle [rad] of the bodies at the end of two
    runs. Largest |Δx| + R |Δθ| of a body, R its largest centroid-to-outline distance.
    """
    sizes = np.array([body.shape.bounding_radius for body in bodies])
    shift = np.hypot(*(position[:, :2] - exact[:, :2]).T)
    return float(np.max(shift + sizes * np.abs(position[:, 2] - exact[:, 2])))


def nudge_of(bodies: Sequence[Body]) -> float:
    """How far to move bodies [m]: NUDGE of the smallest one that moves; 0 where none does."""
    return NUDGE * min((b.shape.bounding_radius for b in bodies if not b.fixed), default=0.0)


def nudged(bodies: Sequence[Body], nudge: float) -> list[Body]:
    """The bodies, each that moves displaced by ``nudge`` [m] in a direction of its own."""
    ways = np.random.default_rng(SEED).uniform(0.0, 2.0 * math.pi, len(bodies))
    moved = []
    for body, way in zip(bodies, ways.tolist(), strict=True):
        size = 0.0 if body.fixed else nudge
        x, y = body.position
        place = (x + size * math.cos(way), y + size * math.sin(way))
        moved.append(attrs.evolve(body, position=place))
    return moved


def amplification_of(
    bodies: Sequence[Body],
    end: np.ndarray,
    companion: Callable[[list[Body]], np.ndarray | None],
    nudge: float | None = None,
) -> float:
    """The distance at the end between a motion and its nudged companion, over the nudge.

    ``end`` (n, 3): where the bodies have come to; ``companion(bodies)``: where others come to in
    the same time, None where they do not get that far, which counts as inf; ``nudge`` [m].
    """
    nudge = nudge_of(bodies) if nudge is None else nudge
    if nudge == 0.0:
        return 0.0
    other = companion(nudged(bodies, nudge))
    return math.inf if other is None else end_distance(bodies, other, end) / nudge
