"""How far two bodies that come together feel each other, and whether a barrier holds them apart.

Sampled from the kernels of the pair forces, a user's own among them, for spheres of the bodies'
equivalent radii; overdamped, so that a force moves the two with its product with their mobility.
"""

import math
from collections.abc import Sequence

import numpy as np

from flocsim.body import Fluid
from flocsim.forces.base import Force, PairForce
from flocsim.forces.check import kernel_arguments, reach_of, sample_pairs

# From molecular distances, where van der Waals attraction is cut off, to far beyond any force.
GAPS = np.geomspace(1e-10, 1e-2, 240)
"""Gaps [m] at which forces are sampled."""

LEAST_START = 0.01
"""Start gap over r_i + r_j where hardly anything acts."""


def speeds_of(
    forces: Sequence[Force], fluid: Fluid, radii: Sequence[float], mobility: float
) -> np.ndarray:
    """Return speeds [m/s] of two bodies against each other by their pair forces at GAPS: (all
    together, each taken for repulsive; the sum) (2, gaps).

    ``radii``: r_eq [m] of both; ``mobility``: the sum of theirs [s/kg].
    """
    r_i, r_j = radii
    size, found = r_i + r_j, np.zeros((2, len(GAPS)))
    # Spheres of the bodies' equivalent radii, at rest; Derjaguin's radius r_i r_j/(r_i + r_j).
    pair = sample_pairs(math.inf)[0]._replace(
        gap_rate=0.0, radius_i=r_i, radius_j=r_j, reduced_radius=r_i * r_j / size
    )
    for force in forces:
        if not isinstance(force, PairForce) or force.absent:
            continue
        kernel, end = force.kernel_in(fluid), reach_of(force)
        arguments = kernel_arguments(force, fluid, kernel)
        views = (pair._replace(gap=gap, centre_distance=size + gap) for gap in GAPS.tolist())
        values = np.array(
            [float(kernel(view, *arguments)) if view.gap < end else 0.0 for view in views]
        )
        found[0] += np.abs(values)
        found[1] += values
    return found * mobility


def far_gap(speeds: np.ndarray, speed: float, share: float, size: float) -> float:
    """Return the gap [m] beyond which forces move the bodies at less than a ``share`` of their
    ``speed`` against each other; ``speeds`` as of `speeds_of`, ``size`` = r_i + r_j."""
    strong = np.flatnonzero(speeds[0] > share * speed)
    gap = GAPS[min(strong[-1] + 1, len(GAPS) - 1)] if len(strong) else 0.0
    return max(float(gap), LEAST_START * size)


def attraction_width(speeds: np.ndarray, speed: float, way: float) -> float:
    """Return how far beyond where outlines meet anyway attraction can make them meet [m].

    A pair that passes with a least distance e is drawn sideways by at most v(g), the speed of
    attraction at a gap g ≥ what is left of e, for as long as it passes: at half its ``speed``, over
    a ``way`` [m], and at first at least. Where v is above half the speed, it is held for ever. So
    it does not come to touch where ∫ dg/v from there to e takes longer than passing.
    ``speeds`` as of `speeds_of`.
    """
    drawn = np.maximum(-speeds[1], 0.0)
    if not drawn.max() > 0.0:
        return 0.0
    # Nearer than this attraction outruns the passing, and the pair meets in any case.
    held = np.flatnonzero(drawn >= 0.5 * speed)
    first = held[-1] if len(held) else 0
    passing = way / (0.5 * speed)
    with np.errstate(divide="ignore"):
        slowness = 1.0 / drawn
    # Trapezoidal rule for ∫ dg/v from there outwards; beyond reach v = 0, and it takes for ever.
    steps = 0.5 * (slowness[1:] + slowness[:-1]) * np.diff(GAPS)
    taken = np.cumsum(steps[first:]) + (0.0 if len(held) else slowness[0] * GAPS[0])
    beyond = np.flatnonzero(taken > passing + 4.0 * GAPS[first + 1 :] / speed)
    place = first + 1 + beyond[0] if len(beyond) else len(GAPS) - 1
    return float(GAPS[place])


def caged_between(
    speeds: np.ndarray, mobility: float, load: float, barrier: float
) -> tuple[float, float]:  # fmt: skip
    """Return the gaps [m] between which more than the energy ``barrier`` [J] lies on either side of
    a pair that has not touched, a ``load`` [N] helping it out, or in; (0, 0) for no such place.

    ``speeds`` as of `speeds_of`, which took this ``mobility``; of several such places the one of
    the highest barriers.
    """
    # The potential U(g) = −∫ F dg, up to a constant, and with the load's work on either side.
    repulsion = speeds[1] / mobility
    rises = -0.5 * (repulsion[1:] + repulsion[:-1]) * np.diff(GAPS)
    potential = np.append(0.0, np.cumsum(rises))
    outwards, inwards = potential - load * GAPS, potential + load * GAPS
    # Barriers: the highest place further out, and further in, over that of here.
    above = np.maximum.accumulate(outwards[::-1])[::-1] - outwards
    below = np.maximum.accumulate(inwards) - inwards
    least = np.minimum(above, below)
    best = int(np.argmax(least))
    if not least[best] > barrier:
        return 0.0, 0.0
    # The run of gaps about the best one where both barriers are high enough.
    outside = np.flatnonzero(~(least > barrier))
    first = int(outside[outside < best].max(initial=-1)) + 1
    last = int(outside[outside > best].min(initial=len(GAPS))) - 1
    return float(GAPS[first]), float(GAPS[last])
