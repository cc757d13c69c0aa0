"""Made-up results and fits in which every claim of the paper holds, for tests that break them."""

import attrs
import numpy as np
from scipy.special import ndtri

from flocsim.geometry.shapes.shape import Sphere
from flocsim.io.results.schema import Results
from flocsim.io.shape_library import ShapeEntry, StoredFit
from tests.helpers.synthetic_results import bonds_of
from tests.helpers.tabulate import tabulate

TYPES, VERTICES, DELTA = ("I", "II", "III"), (1, 4, 16, 64), (0.0, 0.25, 0.5, 0.75, 1.0)
COUNT = 600


def fall(first, with_vertices, with_delta):
    """A probability on (vertices > 1, delta) that falls with both."""
    v, d = np.indices((len(VERTICES) - 1, len(DELTA)))
    return np.clip(first - with_vertices * v - with_delta * d, 0.0, 1.0)


def paper_outcomes():
    """Outcomes and sides on (type, vertices, delta, replicate), from the same random numbers."""
    inside = [fall(0.55, 0.08, 0.06), fall(0.95, 0.06, 0.04), fall(1.0, 0.0, 0.0)]
    bound_inside = [fall(0.80, 0.08, 0.06), fall(0.98, 0.06, 0.05), fall(0.85, 0.08, 0.06)]
    bound_outside = [fall(0.45, 0.08, 0.10), fall(0.45, 0.08, 0.10), fall(0.0, 0.0, 0.0)]
    bound_outside[0][:, -1] = 0.0
    first, second = np.random.default_rng(3).random((2, COUNT))
    shape = (len(TYPES), len(VERTICES), len(DELTA), COUNT)
    side, bound = np.ones(shape, dtype=bool), np.ones(shape, dtype=bool)
    for t in range(len(TYPES)):
        side[t, 1:] = first < inside[t][..., None]
        chance = np.where(side[t, 1:], bound_inside[t][..., None], bound_outside[t][..., None])
        bound[t, 1:] = second < chance
    return np.where(side, 0, 2) + np.where(bound, 0, 1), side.astype(int)


def paper_results(change=None):
    """The Results; ``change(outcome, inside)`` may edit both before they are counted."""
    outcome, inside = paper_outcomes()
    if change:
        change(outcome, inside)
    replicates = blank_replicates(outcome.shape) | {"outcome": outcome, "inside": inside}
    replicates["bond"] = bonds_of(outcome)
    table = tabulate(outcome, inside, replicates["bond"])
    return Results(TYPES, VERTICES, DELTA, replicates, table)


def blank_replicates(shape):
    """The table of replicates without what happened."""
    from flocsim.io.results.schema import FURTHER_RUNS, REPLICATES

    blank = {name: np.zeros(shape, dtype=kind) for name, (kind, _, _) in REPLICATES.items()}
    further = tuple(f"{run}_" for run in FURTHER_RUNS)
    again = [name for name in REPLICATES if name.startswith(further)]
    return blank | {name: np.full(shape, 255, "u1") for name in again}


DISC = Sphere(1e-6)
FIT_VERTICES = (4, 16, 28, 64)
SMALL_ERRORS = {4: 14.0, 16: 5.0, 28: 2.0, 64: 2.6}
"""RE of small flocs at r = 1, least at N = 28; at larger r it hardly hangs on N."""


def paper_fits(radii=(1.0, 2.0, 4.0), scale=1.0, sphere=38.0):
    """Entries of sixty flocs of many sizes; RE of large ones falls with N, all rise with r."""
    entries = []
    places = (np.arange(60) + 0.5) / 60.0
    sizes = 5.0 * np.exp(0.8 * ndtri(places))
    for radius in radii:
        for floc, size in enumerate(sizes):
            few = floc % 6
            if size > 5.0:
                errors = {n: radius * (20.0 + few) / n / 2.0 for n in FIT_VERTICES}
            elif radius > min(radii):
                errors = {n: 10.0 * radius + few + 0.1 * k for k, n in enumerate(FIT_VERTICES)}
            else:
                errors = {n: SMALL_ERRORS[n] + 0.1 * few for n in FIT_VERTICES}
            errors = {n: scale * re for n, re in errors.items()} | {1: sphere + floc % 3}
            fits = {n: StoredFit(DISC.parts, re) for n, re in errors.items()}
            entries.append(ShapeEntry(f"f#{floc} r={radius}", "f.png", 1e-6, (0.0, 0.0), 100, size,
                                      radius, fits))  # fmt: skip
    return entries


def relabelled(results, **names):
    """The Results with other coordinates: what was at one place is said to be at another."""
    return attrs.evolve(results, **names)
