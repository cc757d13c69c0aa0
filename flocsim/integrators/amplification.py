"""Error amplification of a motion, measured by a companion run with a slightly different start."""

import math
from collections.abc import Callable, Sequence

import attrs
import numpy as np

from flocsim.body import Body

NUDGE = 1e-4
"""Displacement of the companion's bodies, over the smallest bounding radius of a moving body: large
against the errors of steps, small enough for a linear response."""

SEED = 13
"""Seed of the directions of displacement: the same for every run."""

MOST_AMPLIFIED = 10.0
"""Amplification above which no sum of step errors can bound the error of the motion."""


def end_distance(bodies: Sequence[Body], position: np.ndarray, exact: np.ndarray) -> float:
    """Return the largest distance [m] of any point of an outline from its exact position.

    ``position`` and ``exact`` (n, 3): x, y [m] and angle [rad] of the bodies at the end of two
    runs. It is the largest |Δx| + R |Δθ| of a body, R its largest centroid-to-outline distance.
    """
    sizes = np.array([body.shape.bounding_radius for body in bodies])
    shift = np.hypot(*(position[:, :2] - exact[:, :2]).T)
    return float(np.max(shift + sizes * np.abs(position[:, 2] - exact[:, 2])))


def nudge_of(bodies: Sequence[Body]) -> float:
    """Return the displacement [m] of a companion's bodies; 0 where no body can move."""
    return NUDGE * min((b.shape.bounding_radius for b in bodies if not b.fixed), default=0.0)


def nudged(bodies: Sequence[Body], nudge: float) -> list[Body]:
    """Return the bodies, each free one displaced by ``nudge`` [m] in a random direction."""
    directions = np.random.default_rng(SEED).uniform(0.0, 2.0 * math.pi, len(bodies))
    moved = []
    # Fixed bodies stay: they are part of the scene.
    for body, direction in zip(bodies, directions.tolist(), strict=True):
        size = 0.0 if body.fixed else nudge
        x, y = body.position
        moved_to = (x + size * math.cos(direction), y + size * math.sin(direction))
        moved.append(attrs.evolve(body, position=moved_to))
    return moved


def amplification_of(
    bodies: Sequence[Body],
    end: np.ndarray,
    companion: Callable[[list[Body]], np.ndarray | None],
    nudge: float | None = None,
) -> float:
    """Return the distance between a motion and its companion at the end, over the initial
    displacement.

    ``end`` (n, 3) holds the bodies' final positions. ``companion(bodies)`` runs displaced bodies
    for the same time and returns theirs, or None if they do not get that far, which counts as inf.
    ``nudge`` is the displacement [m].
    """
    nudge = nudge_of(bodies) if nudge is None else nudge
    if nudge == 0.0:
        return 0.0
    other = companion(nudged(bodies, nudge))
    return math.inf if other is None else end_distance(bodies, other, end) / nudge
