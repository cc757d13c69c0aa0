"""The drag of clusters against boundary elements on drawn clusters.

Clusters are drawn by halves that meet on straight paths in random orientations. For boundary
elements each floc is a prism of its outline, 4/3 r_eq deep; numbers are mobilities of clusters over
the exact ones, less 1, in the mean of all directions and of the two main ones.

    python -m benchmarks.accuracy.cluster_drag [--draws 4]
"""

import math

import numpy as np

from benchmarks.reporting import Table, begin
from flocsim.geometry.shapes.outline import oriented
from flocsim.hydrodynamics.panels import panels_of
from flocsim.hydrodynamics.rigid_bodies import mobilities
from tests.helpers.prisms import loads_of

ALONE = 1.0 / (6.0 * math.pi)
COVERED = 60
"""Panels of half of a floc's surface, about."""


def turned(places, angle):
    """Places (n, 2) turned about the origin."""
    c, s = math.cos(angle), math.sin(angle)
    return places @ np.array([[c, s], [-s, c]])


def outline(rng):
    """A floc's outline, r_eq = 1, about its centroid."""
    turn = np.linspace(0.0, 2.0 * math.pi, 64, endpoint=False)
    modes = [(k, 0.35 * rng.normal() / k**1.2, rng.uniform(0.0, 7.0)) for k in range(2, 7)]
    radius = np.maximum(
        1.0 + sum(size * np.cos(k * turn + phase) for k, size, phase in modes), 0.35
    )
    ring = radius[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    from shapely import Polygon

    known = Polygon(ring)
    return (ring - np.array(known.centroid.coords[0])) / math.sqrt(known.area / math.pi)


def packed(rings, rng):
    """Flocs, as lists of outlines, of one cluster: halves that meet until they touch."""
    from shapely import Polygon, unary_union
    from shapely.affinity import translate

    if len(rings) == 1:
        return [turned(rings[0], rng.uniform(0.0, 2.0 * math.pi))]
    half = len(rings) // 2
    one, other = packed(rings[:half], rng), packed(rings[half:], rng)
    angle = rng.uniform(0.0, 2.0 * math.pi)
    middle = np.concatenate(other).mean(axis=0)
    other = [turned(ring - middle, angle) for ring in other]
    here, there = (unary_union([Polygon(ring) for ring in each]) for each in (one, other))
    reach = sum(np.hypot(*np.concatenate(each).T).max() for each in (one, other))
    while True:
        place, offset = 2.0 * reach, rng.uniform(-0.5, 0.5) * reach
        while place > -2.0 * reach:
            gap = here.distance(translate(there, place, offset))
            if gap < 1e-4:
                return one + [ring + [place, offset] for ring in other]
            place -= gap


def exact(rings, middle):
    """The mobility (2, 2) of a rigid cluster at its middle, by boundary elements of one size."""
    surfaces = []
    for ring in rings:
        perimeter = np.hypot(*(np.roll(ring, -1, 0) - ring).T).sum()
        size = math.sqrt((2.0 / 3.0 * perimeter + math.pi) / COVERED)
        surfaces.append(panels_of(oriented([ring - middle]), 4.0 / 3.0, size))
    return np.linalg.inv(loads_of(surfaces))[:2, :2] / ALONE


def by_sum(places, radii):
    """The same by flocsim's sum."""
    own = np.column_stack([ALONE / radii, 0.0 * radii, ALONE / radii])
    found = mobilities(np.zeros(len(radii), dtype=int), places, radii, own)
    xx, xy, yy = found[0] / ALONE
    return np.array([[xx, xy], [xy, yy]])


def main():
    """Print how wrong the sum is for drawn clusters."""
    arguments = begin(__doc__, draws=4)
    draws = 1 if arguments.quick else arguments.draws
    table = Table("Mobility of drawn clusters over that by boundary elements, less 1", (
        "flocs", "mean of directions", "slow direction", "fast direction", "largest",
    ))  # fmt: skip
    for count in (2, 3, 4) if arguments.quick else (2, 3, 4, 8, 16, 32):
        wrong = []
        for draw in range(draws if count < 32 else 2):
            rng = np.random.default_rng([count, draw])
            rings = packed([outline(rng) for _ in range(count)], rng)
            centres = np.array([ring.mean(axis=0) for ring in rings])
            alone = np.array(
                [
                    2.0 / np.trace(exact([ring], centre))
                    for ring, centre in zip(rings, centres, strict=True)
                ]
            )
            there, found = exact(rings, centres.mean(axis=0)), by_sum(centres, alone)
            main = np.linalg.eigvalsh(found) / np.linalg.eigvalsh(there) - 1.0
            wrong.append([np.trace(found) / np.trace(there) - 1.0, *main])
        wrong = np.array(wrong)
        both = zip(wrong.mean(axis=0), wrong.std(axis=0), strict=True)
        table.add(count, *(f"{mean:+.3f} ± {spread:.3f}" for mean, spread in both),
                  float(np.abs(wrong).max()))  # fmt: skip
    table.print()


if __name__ == "__main__":
    main()
