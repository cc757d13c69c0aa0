"""The shape library that ships with flocsim: synthetic flocs, to be used without growing any.

Named by ``[shapes] source = "library", file = "synthetic"``. It is made anew by
`python -m tests.helpers.shipped_library`: the first FLOCS clusters of
`flocsim.geometry.shapes.synthetic` with 60 primary particles and a fractal dimension of 1.8 in the
plane, the defaults of ``[shapes]``, fitted at VERTICES. Their pixel size, and so their measured
sizes, are nominal: equivalent radii from 5 to 25 µm, in equal steps of the logarithm.
"""

import sys
from pathlib import Path

import numpy as np

from flocsim.geometry.fit.fit import fit_mask
from flocsim.geometry.shapes.cores import Part
from flocsim.geometry.shapes.synthetic import EQUIVALENT_PIXELS, synthetic_floc
from flocsim.io.shape_library import NAME_OF_SHIPPED, SHIPPED, ShapeEntry, StoredFit, write_library

FLOCS, VERTICES = 24, (4, 8, 16, 32, 64, 128)
PARTICLES, DIMENSION, RATIO, SEED = 60, 1.8, 16.0, 1
SIZES = np.geomspace(5e-6, 25e-6, FLOCS)
"""Equivalent radii [m]."""


def entry(index: int) -> ShapeEntry:
    """One floc, fitted at all VERTICES."""
    mask = synthetic_floc((SEED, index), PARTICLES, DIMENSION)
    radius = EQUIVALENT_PIXELS / RATIO
    fits = {n: fit_mask(mask, vertices=n, radius=radius) for n in VERTICES}
    size = float(np.sqrt(mask.sum() / np.pi))
    pixel = float(SIZES[index]) / size
    stored = {
        n: StoredFit((Part((pixel * fit.shape.vertices,), pixel * fit.shape.radius),),
                     fit.relative_error)
        for n, fit in fits.items()
    }  # fmt: skip
    rows, columns = np.nonzero(mask)
    centre = (float(columns.mean()), float(rows.mean()))
    return ShapeEntry(
        f"{NAME_OF_SHIPPED}#{index}", f"{NAME_OF_SHIPPED}-{index}", pixel, centre, int(mask.sum()),
        size, radius, stored,
    )  # fmt: skip


def write(path: str | Path = SHIPPED) -> None:
    """Grow and fit the flocs and write the library; FileError where there is one already."""
    about = {"primary_particles": PARTICLES, "fractal_dimension": DIMENSION, "seed": SEED}
    write_library(path, [entry(index) for index in range(FLOCS)], about)


if __name__ == "__main__":
    write(*sys.argv[1:2])
