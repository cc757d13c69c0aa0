"""How probabilities go with N and δ: Kendall's rank correlation."""

import itertools
import warnings

import numpy as np


def mean_of(values, axis):
    """The mean without NaN; NaN where there is nothing else."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # "mean of empty slice"
        return np.nanmean(values, axis=axis)


def kendall(values):
    """Kendall's τ of values with their order along axis 0: +1 rises, −1 falls throughout.

    Ties count as neither. The mean over all pairs, also of the other axes but the last (pairs with
    NaN left out): (…, samples) → (samples,).
    """
    pairs = itertools.combinations(range(len(values)), 2)
    signs = np.stack([np.sign(values[later] - values[former]) for former, later in pairs])
    return mean_of(signs.reshape(-1, signs.shape[-1]), axis=0)


def with_vertices(counts, values):
    """τ of values (vertices, delta, sample) with N, over N > 1, at each δ by itself."""
    return kendall(values[counts.polygons])


def with_delta(counts, values):
    """τ of values (vertices, delta, sample) with δ, at each N > 1 by itself."""
    order = np.argsort(counts.delta)
    return kendall(np.moveaxis(values[counts.polygons], 1, 0)[order])


def mean_polygons(counts, values):
    """Mean of values (vertices, delta, sample) over all conditions of N > 1."""
    chosen = values[counts.polygons]
    return mean_of(chosen.reshape(-1, chosen.shape[-1]), axis=0)
