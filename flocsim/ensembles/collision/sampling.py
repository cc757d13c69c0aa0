"""Random numbers keyed by identity, so that no rank count can change them."""

import numpy as np


def draws(seed, replicate):
    """Four uniform numbers in [0, 1) of one replicate: two orientations, two choices of floc.

    They depend on the seed and the replicate's index alone, so that one replicate has the same
    orientations and the same flocs at every displacement, number of vertices and type.
    """
    stream = np.random.SeedSequence(seed, spawn_key=(replicate,))
    return np.random.Generator(np.random.Philox(stream)).random(4)


def orientations(numbers):
    """Angles θ = 2πn [rad] of bodies i and j."""
    return 2.0 * np.pi * numbers[0], 2.0 * np.pi * numbers[1]
