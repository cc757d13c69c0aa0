"""How smooth the gap of two outlines may be, so that the surface forces stay what they are.

The smooth gap (integrators/rhs/surface_gap.py) lies below the least one by up to ℓ ln K with K
pairs of features, and a force that changes over a length D is off by ℓ ln K/D. D grows with the gap
for some forces (van der Waals: half the gap), and is the same everywhere for others (1/κ). ℓ may be

    ℓ(g) = LARGEST_BIAS/ln K · min(D_0 + D' g, D_1),

where that line stays below the D of every force. Scene.smoothing holds ℓ(0) [m], dℓ/dg, and the gap
from which on ℓ stays the same [m].
"""

import functools
import math
from collections.abc import Sequence

import numpy as np

from flocsim.body import Fluid
from flocsim.constants import LARGEST_BIAS
from flocsim.forces.base import PairForce
from flocsim.forces.check import kernel_arguments, reach_of, results, sample_pairs
from flocsim.geometry.shapes.shape import Shape

GAPS = np.geomspace(1e-11, 1e-3, 160)
"""Gaps [m] at which forces are looked at."""

LONGEST = 1e-6
"""[m] The length over which a force changes that is the same at every gap."""

WEAKEST = 1e-4
"""Share of a force's greatest strength below which its bias does not count: one that ends at some
gap changes by all that is left of it there."""

NEARLY = 0.9
"""Share of the longest D from which on it counts as that."""


def change_lengths(force: PairForce, fluid: Fluid) -> np.ndarray:
    """D behind every one of GAPS but the last: max |F(≥ g)|/|dF/dg|, over what length the force
    changes by as much as it still has to lose [m]; inf where it does not."""
    try:
        return lengths_known(force, fluid)
    except TypeError:  # a force that holds a list or the like
        return lengths_known.__wrapped__(force, fluid)


@functools.lru_cache(maxsize=64)
def lengths_known(force, fluid):
    arguments, gaps = kernel_arguments(force, fluid, force.kernel), GAPS
    shortest = np.full(len(gaps) - 1, math.inf)
    for rate in (-1e-4, 1e-4):
        pair = sample_pairs(math.inf)[0]._replace(gap_rate=rate)
        views = [pair._replace(gap=gap, centre_distance=gap + 3e-6) for gap in gaps.tolist()]
        values = [next(results(force, force.kernel, [each], arguments), 0.0) for each in views]
        found = np.nan_to_num(np.abs(values), posinf=0.0)
        left = np.maximum.accumulate(found[::-1])[::-1]
        strong = left[1:] > WEAKEST * left[0]
        falls = (left[1:] < left[:-1]) & strong
        # Of an exponential between two gaps, so that what is wide apart is not found too long.
        decay = np.diff(gaps)[falls] / np.log(left[:-1][falls] / left[1:][falls])
        shortest[falls] = np.minimum(shortest[falls], decay)
        rises = (found[1:] > found[:-1]) & strong
        slope = np.abs(np.diff(found)) / np.diff(gaps)
        shortest[rises] = np.minimum(shortest[rises], left[1:][rises] / slope[rises])
    return shortest


def smoothness(forces: Sequence[PairForce], fluid: Fluid) -> tuple[float, float, float]:
    """(D_0, D', D_1) of the line that stays below the D of all these forces [m, 1, m]."""
    gaps, lengths = GAPS, np.full(len(GAPS) - 1, LONGEST)
    for force in forces:
        within = gaps[:-1] < reach_of(force)
        lengths[within] = np.minimum(lengths[within], change_lengths(force, fluid)[within])
    lengths = np.minimum.accumulate(lengths[::-1])[::-1]
    rises = lengths < NEARLY * lengths[-1]
    if not rises.any():
        return lengths[0], 0.0, lengths[0]
    least = 0.5 * lengths[0]
    slope = float(np.min((lengths[rises] - least) / gaps[:-1][rises]))
    return float(least), slope, float(NEARLY * lengths[-1])


def smoothing_of(
    line: tuple[float, float, float], shapes: Sequence[Shape]
) -> tuple[float, float, float]:
    """Scene.smoothing of these shapes, of what `smoothness` gives."""
    least, slope, most = line
    largest = sorted(len(shape.vertices) for shape in shapes)[-2:]
    share = LARGEST_BIAS / math.log(max(2 * largest[0] * largest[-1], 2))
    end = (most - least) / slope if slope > 0.0 else 0.0
    return share * least, share * slope, end
