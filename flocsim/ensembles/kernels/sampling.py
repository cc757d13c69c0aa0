"""The points of a kernel study: a scrambled Sobol sequence in (θ_i, θ_j, flocs, offset), and what
interval of offsets it covers.

Replicate k is point k // S of scramble k mod S, S scrambles being dealt in turn: all of them grow
evenly with the number of replicates, and no number of ranks changes a point. The offset comes
first, as the first dimensions of Sobol's sequence are the most even ones.

A settling pair touches exactly where the shadows of the two outlines overlap, as nothing turns them
on the way: offsets are sampled evenly between, `settling_interval`. In a flow the bodies turn as
they come, and offsets are b = ± b_max √u: as often as the flow brings pairs there.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from flocsim.geometry.shapes.shape import Shape

DIMENSIONS = 5
OFFSET, ANGLE_I, ANGLE_J, FLOC_I, FLOC_J = range(DIMENSIONS)
"""What the dimensions of the sequence are for."""

STREAM = (0, 0, 2)
"""Spawn key, with the scramble's number behind it, of the numbers that scramble the sequence."""

FIRST_POINTS = 256


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


def as_draws(numbers: np.ndarray) -> np.ndarray:
    """A point in the order of collision.start.draws, the offset behind."""
    return numbers[[ANGLE_I, ANGLE_J, FLOC_I, FLOC_J, OFFSET]]


def half_widths(shape: Shape, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(towards −x, towards +x) extents [m] of an outline about its centroid, at many angles."""
    c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
    # Each part by its own spheroradius: the widest part need not be the one that reaches farthest.
    ends = [(c * p.points[:, 0] - s * p.points[:, 1], p.radius) for p in shape.parts]
    return (
        np.max([radius - x.min(axis=1) for x, radius in ends], axis=0),
        np.max([radius + x.max(axis=1) for x, radius in ends], axis=0),
    )


def settling_interval(
    shapes: Sequence[Shape], angles_i: np.ndarray, angles_j: np.ndarray, reach: float, least: float
) -> tuple[np.ndarray, np.ndarray]:
    """Offsets [m] of j from i between which settling may bring them together, at many angles.

    Where the shadows of the outlines overlap, ``reach`` further on either side, and at least up to
    ``least`` and the reach: as far as the equivalent spheres between whose centres forces act.
    """
    left_i, right_i = half_widths(shapes[0], angles_i)
    left_j, right_j = half_widths(shapes[1], angles_j)
    low = np.maximum(left_i + right_j, least) + reach
    high = np.maximum(right_i + left_j, least) + reach
    return -low, high


def flow_offset(number: np.ndarray, largest: float) -> np.ndarray:
    """b = ± b_max √u [m] of uniform numbers: u = |2 n − 1|, below n = ½ on the negative side."""
    centred = 2.0 * number - 1.0
    return np.copysign(largest * np.sqrt(np.abs(centred)), centred)
