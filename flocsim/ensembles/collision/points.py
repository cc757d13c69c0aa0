"""The points of scrambled Sobol sequences that replicates are.

Replicate k is point k // S of scramble k mod S, S scrambles being dealt in turn: all of them grow
evenly with the number of replicates, and no number of ranks changes a point.
"""

from functools import lru_cache

import numpy as np

DIMENSIONS = 5
STREAM = (0, 0, 2)
"""Spawn key, with the scramble's number behind it, of the numbers that scramble the sequence."""

FIRST_POINTS = 256
SAMPLE = 16
"""Points of each scramble that stand for the sequence."""


@lru_cache(maxsize=128)
def points(seed: int, scramble: int, size: int) -> np.ndarray:
    """The first ``size`` points (size, 5) of a scramble, in [0, 1); ``size`` a power of 2."""
    from scipy.stats import qmc

    stream = np.random.SeedSequence(seed, spawn_key=(*STREAM, scramble))
    generator = np.random.Generator(np.random.Philox(stream))
    sequence = qmc.Sobol(DIMENSIONS, scramble=True, seed=generator)
    found = np.asarray(sequence.random_base2(size.bit_length() - 1))
    found.flags.writeable = False
    return found


def point(seed: int, scrambles: int, replicate: int) -> np.ndarray:
    """The point (5,) of a replicate."""
    place, scramble = divmod(replicate, scrambles)
    size = max(FIRST_POINTS, 1 << place.bit_length())
    return points(seed, scramble, size)[place]


def points_of(seed: int, scrambles: int, first: int, stop: int) -> np.ndarray:
    """The points (stop − first, 5) of replicates."""
    return np.array([point(seed, scrambles, replicate) for replicate in range(first, stop)])


def point_facts(seed: int, scrambles: int) -> dict[str, list[float]]:
    """What rows follow from besides the config: the points themselves."""
    first = points_of(seed, scrambles, 0, SAMPLE * scrambles)
    return {"scene.points": [float(each) for each in first.sum(axis=0)]}
