"""The collision efficiency: the probability of aggregation of an approach, summed over its offset.

With P(δ), the share of decided approaches (misses among them) that end aggregated, δ the sideways
offset of the approach over δ_max, and P linear between the simulated offsets:

- in the plane       E = ∫₀¹ P dδ, of all approaches within the width 2 δ_max;
- axially symmetric  E = ∫₀¹ P 2δ dδ, of all approaches within the area π δ_max².

Where P is 1 up to an offset y_c and 0 beyond, the latter is (y_c/δ_max)², the collision efficiency
of two settling bodies (Pruppacher and Klett 1997, Microphysics of Clouds and Precipitation, ch.
14.4; Han and Lawler 1991, J. Hydraul. Eng. 117, 1269); P makes it the mean over orientations.
"""

from collections.abc import Mapping

import numpy as np

from flocsim.io.confidence import proportion


def aggregated(table: Mapping[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(P, low, high) of every condition (type, vertices, delta): 95 % bounds.

    Undecided and failed approaches may have come to anything.
    """
    classes, unknown = table["n_class"], table["n_undecided"] + table["n_failed"]
    return proportion(
        classes[..., 0] + classes[..., 2], table["n_total"] - unknown, unknown=unknown
    )


def weights(delta: np.ndarray, axial: bool) -> np.ndarray | None:
    """What each P counts for in the integral; None unless the offsets reach from 0 to 1."""
    order = np.argsort(delta)
    places = np.asarray(delta, dtype=float)[order]
    if len(places) < 2 or places[0] != 0.0 or places[-1] != 1.0:
        return None
    found = np.zeros(len(places))
    a, b = places[:-1], places[1:]
    found[:-1] += (b - a) * ((2.0 * a + b) / 3.0 if axial else 0.5)
    found[1:] += (b - a) * ((a + 2.0 * b) / 3.0 if axial else 0.5)
    return found[np.argsort(order)]


def efficiency(
    table: Mapping[str, np.ndarray], delta: np.ndarray, axial: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """(E, low, high) (type, vertices); None unless the offsets reach from 0 to 1.

    The bounds are the same sums of the 95 % bounds at each offset: as wide as they come where
    all offsets err together, since they have the flocs and orientations in common.
    """
    share = weights(delta, axial)
    if share is None:
        return None
    value, low, high = (np.asarray(each) @ share for each in aggregated(table))
    return value, low, high
