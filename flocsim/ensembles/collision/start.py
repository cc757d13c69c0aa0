"""How a replicate starts: its random numbers, and j above i, displaced sideways, a gap apart.

With Sobol's sequences replicate k is point k // S of scramble k mod S, S scrambles being dealt in
turn: all of them grow evenly with the number of replicates, and no number of ranks changes a point.
"""

import math
from collections.abc import Sequence
from functools import cache, lru_cache

import numpy as np

from flocsim.compiler.composer import compose
from flocsim.geometry.contact import compounds
from flocsim.geometry.contact.compounds import outlines_of
from flocsim.geometry.contact.near_pairs import core_distance
from flocsim.geometry.shapes.shape import Shape

MOST_ADVANCES = 1000
"""Moves towards the wanted gap; each is as long as the distance still allows."""


def draws(seed: int, replicate: int) -> np.ndarray:
    """Five uniform numbers in [0, 1) of one replicate: two orientations, two choices of floc, and
    the direction of j in a brownian meeting.

    They depend on the seed and the replicate's index alone, so that no number of ranks changes
    them, and one replicate has the same orientations and the same flocs at every displacement,
    number of vertices and type.
    """
    stream = np.random.SeedSequence(seed, spawn_key=(replicate,))
    return np.random.Generator(np.random.Philox(stream)).random(5)


def orientations(numbers: Sequence[float] | np.ndarray) -> tuple[float, float]:
    """Angles θ = 2πn [rad] of bodies i and j."""
    return 2.0 * np.pi * numbers[0], 2.0 * np.pi * numbers[1]


def half_extents(shape: Shape, angle: float) -> tuple[float, float]:
    """(towards −x, towards +x) extents of a turned outline about its centroid [m]."""
    parts = shape.placed_parts(angle=angle)
    return (
        max(part.radius - part.points[:, 0].min() for part in parts),
        max(part.radius + part.points[:, 0].max() for part in parts),
    )


def largest_displacement(
    rule: str, shape_i: Shape, angle_i: float, shape_j: Shape, angle_j: float
) -> float:
    """δ_max [m]: facing half-extents ("projected", 1 just grazes), or R_i + R_j ("radius")."""
    if rule == "radius":
        return shape_i.bounding_radius + shape_j.bounding_radius
    return half_extents(shape_i, angle_i)[1] + half_extents(shape_j, angle_j)[0]


def start_height(outlines, angle_i, angle_j, contact, reach, displacement, gap):
    """Height of j's centroid over i's [m] at which the outlines are ``gap`` apart.

    ``outlines``: those of i and j; ``contact`` = r_i + r_j of the spheroradii; ``reach`` =
    R_i + R_j. From far above, j comes down by the distance that is left (it cannot overshoot);
    where it passes without coming so near, it starts clear above.
    """
    clear = reach + gap
    height = math.sqrt(max(clear * clear - displacement * displacement, 0.0))
    turn_c, turn_s = math.cos(angle_j - angle_i), math.sin(angle_j - angle_i)
    c, s = math.cos(angle_i), math.sin(angle_i)
    for _ in range(MOST_ADVANCES):
        x, y = c * displacement + s * height, c * height - s * displacement
        left = core_distance(outlines, 1, 0, (turn_c, turn_s, x, y)) - contact - gap
        if left <= 1e-6 * gap:
            return height
        height -= left
        if height < -clear:
            break
    return clear


@cache
def compiled_height(compound):
    return compose(start_height, compounds.FILLINGS if compound else {})


def place_pair(
    shapes: Sequence[Shape], angles: Sequence[float], displacement: float, gap: float
) -> np.ndarray:
    """Places (2, 3) [m, m, rad] of i at the origin and j above it."""
    contact = shapes[0].radius + shapes[1].radius
    reach = shapes[0].bounding_radius + shapes[1].bounding_radius
    height = compiled_height(any(shape.is_compound for shape in shapes))(
        outlines_of(shapes), float(angles[0]), float(angles[1]),
        contact, reach, float(displacement), gap,
    )  # fmt: skip
    return np.array([[0.0, 0.0, angles[0]], [displacement, height, angles[1]]])


DIMENSIONS = 5
STREAM = (0, 0, 2)
"""Spawn key, with the scramble's number behind it, of the numbers that scramble the sequence."""

FIRST_POINTS = 256
SAMPLE = 16
"""Points of each scramble that stand for the sequence."""


@lru_cache(maxsize=128)
def points(seed: int, scramble: int, size: int) -> np.ndarray:
    """The first ``size`` points (size, 5) of a scramble, in [0, 1); ``size`` a power of 2."""
    from scipy.stats import qmc

    stream = np.random.SeedSequence(seed, spawn_key=(*STREAM, scramble))
    generator = np.random.Generator(np.random.Philox(stream))
    sequence = qmc.Sobol(DIMENSIONS, scramble=True, seed=generator)
    found = np.asarray(sequence.random_base2(size.bit_length() - 1))
    found.flags.writeable = False
    return found


def point(seed: int, scrambles: int, replicate: int) -> np.ndarray:
    """The point (5,) of a replicate."""
    place, scramble = divmod(replicate, scrambles)
    size = max(FIRST_POINTS, 1 << place.bit_length())
    return points(seed, scramble, size)[place]


def points_of(seed: int, scrambles: int, first: int, stop: int) -> np.ndarray:
    """The points (stop − first, 5) of replicates."""
    return np.array([point(seed, scrambles, replicate) for replicate in range(first, stop)])


def point_facts(seed: int, scrambles: int) -> dict[str, list[float]]:
    """What rows follow from besides the config: the points themselves."""
    first = points_of(seed, scrambles, 0, SAMPLE * scrambles)
    return {"scene.points": [float(each) for each in first.sum(axis=0)]}
