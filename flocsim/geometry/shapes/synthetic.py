"""Synthetic flocs: clusters of primary particles with a given fractal dimension in the plane."""

import math
from collections.abc import Sequence

import numpy as np

from flocsim.errors import UsageError

PREFACTOR = 1.1
"""k_f in n = k_f (R_g/a)^D; about 1.1 for clusters in the plane."""

EQUIVALENT_PIXELS = 24.0
"""r_eq of the picture of a floc [px]: fine enough for 64 vertices, coarse enough to fit fast."""

BOND_OVERLAP = 1.15
"""Primary particles are drawn this much larger than they are placed, so that bonds have a width."""

DIRECTIONS = 96
"""Directions tried around a particle for a place to attach the next."""


def attachment_distance(count, dimension):
    """Distance of the next particle from the centroid of ``count`` others, in particle radii.

    Chosen so that the radius of gyration of the grown cluster obeys n = k_f R_g^D (Filippov et
    al. 2000, eq. 9, for the plane).
    """
    grown = count + 1

    def square_gyration(n):
        return (n / PREFACTOR) ** (2.0 / dimension)

    square = square_gyration(grown) - count / grown * square_gyration(count)
    square *= grown**2 / count
    return math.sqrt(max(square, 4.0 / 3.0))


def touching_places(centre):
    """Places (DIRECTIONS, 2) that touch a particle of radius 1."""
    angles = np.linspace(0.0, 2.0 * np.pi, DIRECTIONS, endpoint=False)
    return centre + 2.0 * np.column_stack([np.cos(angles), np.sin(angles)])


def clear_of(places, centres):
    """Those of the places that overlap no particle."""
    distances = np.linalg.norm(places[:, None, :] - centres[None], axis=2)
    return places[distances.min(axis=1) > 2.0 - 1e-6]


def grow_cluster(rng, particles, dimension):
    """Centres (n, 2) of touching particles of radius 1 with the wanted fractal dimension."""
    centres = np.array([[-1.0, 0.0], [1.0, 0.0]])
    places = clear_of(np.vstack([touching_places(centre) for centre in centres]), centres)
    while len(centres) < particles:
        wanted = attachment_distance(len(centres), dimension)
        miss = np.abs(np.linalg.norm(places - centres.mean(axis=0), axis=1) - wanted)
        chosen = places[rng.choice(np.flatnonzero(miss <= miss.min() + 0.15))]
        centres = np.vstack([centres, chosen])
        around = clear_of(touching_places(chosen), centres)
        places = np.vstack([clear_of(places, chosen[None]), around])
    return centres


def picture_of(centres):
    """Filled boolean mask (h, w) of a cluster, its equivalent radius about EQUIVALENT_PIXELS."""
    from scipy import ndimage

    # Overlapping discs cover less than their sum; holes get filled: one correction settles it.
    pixels_per_radius = EQUIVALENT_PIXELS / math.sqrt(len(centres))
    for _ in range(3):
        mask = draw_discs(centres, pixels_per_radius)
        mask = ndimage.binary_fill_holes(mask)
        pixels_per_radius *= EQUIVALENT_PIXELS / math.sqrt(mask.sum() / math.pi)
    return ndimage.binary_fill_holes(draw_discs(centres, pixels_per_radius))


def draw_discs(centres, pixels_per_radius):
    """Mask of discs around the centres, with a margin; rows go down, y goes up."""
    radius = BOND_OVERLAP * pixels_per_radius
    points = centres * pixels_per_radius
    low, high = points.min(axis=0) - radius - 2.0, points.max(axis=0) + radius + 2.0
    x = np.arange(math.floor(low[0]), math.ceil(high[0]))
    y = np.arange(math.ceil(high[1]), math.floor(low[1]), -1)
    mask = np.zeros((len(y), len(x)), dtype=bool)
    for centre in points:
        mask |= (x[None] - centre[0]) ** 2 + (y[:, None] - centre[1]) ** 2 < radius**2
    return mask


def synthetic_floc(
    seed: int | Sequence[int], particles: int = 60, dimension: float = 1.8
) -> np.ndarray:
    """Picture (boolean mask, rows down) of one synthetic floc; the seed decides all.

    Parameters: ``seed``, an integer or a tuple of integers; ``particles`` n ≥ 2;
    ``dimension`` 1 < D < 2, the fractal dimension in the plane.
    """
    if particles < 2 or not 1.0 < dimension < 2.0:
        raise UsageError(
            f"a synthetic floc needs at least 2 particles and a fractal dimension between 1 and 2, "
            f"found {particles} and {dimension}"
        )
    rng = np.random.Generator(np.random.Philox(np.random.SeedSequence(seed)))
    return picture_of(grow_cluster(rng, particles, dimension))
