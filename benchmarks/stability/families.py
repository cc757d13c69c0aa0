"""The families of the stability table, and the case of every index."""

import attrs
import numpy as np

from benchmarks.stability.case import Draw
from benchmarks.stability.polygons import (
    full_scene,
    interlocked,
    large_polygon_impact,
    polygon_impact,
    resting_polygon,
    sliver_impact,
    spinning_impact,
    unloaded_rest,
)
from benchmarks.stability.settling_pair import approach, approach_at_surfaces
from benchmarks.stability.spheres import (
    deep_overlap,
    free_settling,
    free_spinning,
    long_settling,
    resting_sphere,
    sphere_impact,
)

SEED = 20260101
"""Decides all cases, with their index."""


@attrs.frozen
class Family:
    """``make`` draws a case; ``weight``, of every 100 cases so many; ``judge`` in words."""

    make: object
    weight: int
    judge: str


FAMILIES = {
    "free settling": Family(free_settling, 10, "closed form"),
    "long settling, to 1e7 s": Family(long_settling, 4, "closed form"),
    "free spinning": Family(free_spinning, 4, "closed form"),
    "sphere impact": Family(sphere_impact, 14, "closed form"),
    "deep overlap": Family(deep_overlap, 8, "closed form"),
    "resting sphere": Family(resting_sphere, 6, "closed form"),
    "DLVO approach": Family(approach, 8, "1-D, SciPy LSODA/DOP853"),
    "DLVO approach, surfaces": Family(approach_at_surfaces, 6, "1-D, SciPy LSODA/DOP853"),
    "polygon impact": Family(polygon_impact, 8, "plain model, DOP853"),
    "large polygon impact": Family(large_polygon_impact, 6, "DormandPrince54, tight"),
    "sliver impact": Family(sliver_impact, 4, "plain model, DOP853"),
    "spinning impact": Family(spinning_impact, 4, "plain model, DOP853"),
    "interlocked": Family(interlocked, 6, "DormandPrince54, tight"),
    "unloaded rest": Family(unloaded_rest, 4, "nothing moves"),
    "resting polygon": Family(resting_polygon, 4, "DormandPrince54, tight"),
    "full scene": Family(full_scene, 4, "invariants"),
}
"""{name: Family}; the weights add up to 100."""

TURN = [name for name, family in FAMILIES.items() for _ in range(family.weight)]


def family_of(index):
    """The family's name of a case: all families come round within any 100 indices."""
    # 37 is prime to 100: neighbours differ, so that any stretch of indices is a fair sample.
    return TURN[37 * index % len(TURN)]


def case_of(index):
    """(Case, {name: place of the drawn number in its range, 0…1}) of an index."""
    draw = Draw(np.random.default_rng([SEED, index]))
    case = FAMILIES[family_of(index)].make(draw)
    return case, draw.places
