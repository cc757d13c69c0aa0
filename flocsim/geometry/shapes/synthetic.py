"""Synthetic flocs: clusters of primary particles with a given fractal dimension in the plane.

Particles of radius a attach one by one such that n = k_f (R_g/a)^D holds for every n (Filippov et
al. 2000, eq. 9, for the plane).
"""

import math
from collections.abc import Sequence

import numpy as np

from flocsim.errors import UsageError

PREFACTOR = 1.1
"""k_f in n = k_f (R_g/a)^D; about 1.1 for clusters in the plane."""

EQUIVALENT_PIXELS = 24.0
"""r_eq of a floc's picture [px]: fine enough for 64 vertices, coarse enough to fit fast."""

BOND_OVERLAP = 1.15
"""Drawn over placed radius of primary particles, so that bonds have a width."""

DIRECTIONS = 96
"""Directions around a particle tried as positions of the next one."""


def attachment_distance(count, dimension):
    """Return the distance of the next particle from the centroid of ``count`` others, in particle
    radii.

    The radius of gyration of the grown cluster then obeys n = k_f R_g^D (Filippov et al. 2000, eq.
    9, for the plane).
    """
    grown = count + 1

    def square_gyration(n):
        return (n / PREFACTOR) ** (2.0 / dimension)

    # The new particle changes R_g² by the parallel-axis theorem: R_g'² = n/n' R_g² + n/n'²
    # distance².
    square = square_gyration(grown) - count / grown * square_gyration(count)
    square *= grown**2 / count
    return math.sqrt(max(square, 4.0 / 3.0))


def touching_places(centre):
    """Return positions (DIRECTIONS, 2) that touch a particle of radius 1."""
    angles = np.linspace(0.0, 2.0 * np.pi, DIRECTIONS, endpoint=False)
    return centre + 2.0 * np.column_stack([np.cos(angles), np.sin(angles)])


def clear_of(places, centres):
    """Return those positions that overlap no particle."""
    distances = np.linalg.norm(places[:, None, :] - centres[None], axis=2)
    return places[distances.min(axis=1) > 2.0 - 1e-6]


def grow_cluster(rng, particles, dimension):
    """Return centres (n, 2) of touching particles of radius 1 with the wanted fractal dimension."""
    centres = np.array([[-1.0, 0.0], [1.0, 0.0]])
    places = clear_of(np.vstack([touching_places(centre) for centre in centres]), centres)
    while len(centres) < particles:
        wanted = attachment_distance(len(centres), dimension)
        miss = np.abs(np.linalg.norm(places - centres.mean(axis=0), axis=1) - wanted)
        # A random one of the positions nearly as good as the best.
        chosen = places[rng.choice(np.flatnonzero(miss <= miss.min() + 0.15))]
        centres = np.vstack([centres, chosen])
        around = clear_of(touching_places(chosen), centres)
        # Keep the free positions up to date instead of testing all of them again.
        places = np.vstack([clear_of(places, chosen[None]), around])
    return centres


def picture_of(centres):
    """Return the filled boolean mask (h, w) of a cluster with r_eq of about EQUIVALENT_PIXELS."""
    from scipy import ndimage

    # Overlapping discs cover less than their sum, and holes are filled: correct the scale
    # iteratively.
    pixels_per_radius = EQUIVALENT_PIXELS / math.sqrt(len(centres))
    for _ in range(3):
        mask = draw_discs(centres, pixels_per_radius)
        mask = ndimage.binary_fill_holes(mask)
        pixels_per_radius *= EQUIVALENT_PIXELS / math.sqrt(mask.sum() / math.pi)
    return ndimage.binary_fill_holes(draw_discs(centres, pixels_per_radius))


def draw_discs(centres, pixels_per_radius):
    """Return the mask of discs around the centres, with a margin; rows downwards, y upwards."""
    radius = BOND_OVERLAP * pixels_per_radius
    points = centres * pixels_per_radius
    low, high = points.min(axis=0) - radius - 2.0, points.max(axis=0) + radius + 2.0
    x = np.arange(math.floor(low[0]), math.ceil(high[0]))
    y = np.arange(math.ceil(high[1]), math.floor(low[1]), -1)
    mask = np.zeros((len(y), len(x)), dtype=bool)
    # Union of all discs.
    for centre in points:
        mask |= (x[None] - centre[0]) ** 2 + (y[:, None] - centre[1]) ** 2 < radius**2
    return mask


def synthetic_floc(
    seed: int | Sequence[int], particles: int = 60, dimension: float = 1.8
) -> np.ndarray:
    """Return the picture of one synthetic floc (boolean mask, rows downwards).

    Parameters
    ----------
    seed : int or sequence of int
        Determines the floc.
    particles : int
        Number of primary particles, at least 2.
    dimension : float
        Fractal dimension in the plane, between 1 and 2.

    Raises
    ------
    UsageError
        For values out of range.
    """
    if particles < 2 or not 1.0 < dimension < 2.0:
        raise UsageError(
            f"a synthetic floc needs at least 2 particles and a fractal dimension between 1 and 2, "
            f"found {particles} and {dimension}"
        )
    rng = np.random.Generator(np.random.Philox(np.random.SeedSequence(seed)))
    return picture_of(grow_cluster(rng, particles, dimension))
