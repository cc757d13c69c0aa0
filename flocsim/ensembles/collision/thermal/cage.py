"""Where kicks keep a pair that has not touched: between the barriers of a secondary minimum."""

import numpy as np

from flocsim.ensembles.collision.meetings import GAPS


def caged_between(
    speeds: np.ndarray, mobility: float, load: float, barrier: float
) -> tuple[float, float]:  # fmt: skip
    """Between which gaps [m] more than the energy ``barrier`` [J] lies on either side of a pair
    that has not touched, a ``load`` [N] helping it out, or in; (0, 0) for no such place.

    ``speeds`` as of `speeds_of`, which took this ``mobility``; of several such places the one of
    the highest barriers.
    """
    repulsion = speeds[1] / mobility
    rises = -0.5 * (repulsion[1:] + repulsion[:-1]) * np.diff(GAPS)
    potential = np.append(0.0, np.cumsum(rises))
    outwards, inwards = potential - load * GAPS, potential + load * GAPS
    above = np.maximum.accumulate(outwards[::-1])[::-1] - outwards
    below = np.maximum.accumulate(inwards) - inwards
    least = np.minimum(above, below)
    best = int(np.argmax(least))
    if not least[best] > barrier:
        return 0.0, 0.0
    outside = np.flatnonzero(~(least > barrier))
    first = int(outside[outside < best].max(initial=-1)) + 1
    last = int(outside[outside > best].min(initial=len(GAPS))) - 1
    return float(GAPS[first]), float(GAPS[last])
