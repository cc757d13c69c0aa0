"""Offsets at which the pairs of a study of rates approach each other, from uniform numbers.

Points of such a study are for (θ_i, θ_j, flocs, offset). The offset comes first, as the first
dimensions of Sobol's sequence are the most even ones.

A settling pair touches exactly where the shadows of the two outlines overlap, as nothing turns them
on the way: offsets are sampled evenly between, `settling_interval`. In a flow the bodies turn as
they come, and offsets are b = ± b_max √u: as often as the flow brings pairs there.
"""

from collections.abc import Sequence

import numpy as np

from flocsim.ensembles.collision.encounter import Encounter
from flocsim.ensembles.config.pair_scene import SETTLING
from flocsim.geometry.shapes.shape import Shape

OFFSET, ANGLE_I, ANGLE_J, FLOC_I, FLOC_J = range(5)
"""What the dimensions of the sequence are for."""


def as_draws(numbers: np.ndarray) -> np.ndarray:
    """A point in the order of collision.start.draws, the offset behind."""
    return numbers[[ANGLE_I, ANGLE_J, FLOC_I, FLOC_J, OFFSET]]


def half_widths(shape: Shape, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(towards −x, towards +x) extents [m] of an outline about its centroid, at many angles."""
    c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
    # Each part by its own spheroradius: the widest part need not be the one that reaches farthest.
    ends = [(c * p.points[:, 0] - s * p.points[:, 1], p.radius) for p in shape.parts]
    return (
        np.max([radius - x.min(axis=1) for x, radius in ends], axis=0),
        np.max([radius + x.max(axis=1) for x, radius in ends], axis=0),
    )


def settling_interval(
    shapes: Sequence[Shape], angles_i: np.ndarray, angles_j: np.ndarray, reach: float, least: float
) -> tuple[np.ndarray, np.ndarray]:
    """Offsets [m] of j from i between which settling may bring them together, at many angles.

    Where the shadows of the outlines overlap, ``reach`` further on either side, and at least up to
    ``least`` and the reach: as far as the equivalent spheres between whose centres forces act.
    """
    left_i, right_i = half_widths(shapes[0], angles_i)
    left_j, right_j = half_widths(shapes[1], angles_j)
    low = np.maximum(left_i + right_j, least) + reach
    high = np.maximum(right_i + left_j, least) + reach
    return -low, high


def flow_offset(number: np.ndarray, largest: float) -> np.ndarray:
    """b = ± b_max √u [m] of uniform numbers: u = |2 n − 1|, below n = ½ on the negative side."""
    centred = 2.0 * number - 1.0
    return np.copysign(largest * np.sqrt(np.abs(centred)), centred)


LEAST_OFFSET = 1e-4
"""In a flow, over the largest: what is nearer takes as long as this to come along, and the share of
pairs that is, its square, is none."""


def bounds_of(
    encounter: Encounter, angles_i: np.ndarray, angles_j: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The least and the largest offset [m] that is sampled, at many angles."""
    shapes = encounter.shapes
    if encounter.meeting == SETTLING:
        least = 0.0
        if "centre_force" in encounter.system.pieces.laws:
            least = sum(shape.equivalent_radius for shape in shapes)
        return settling_interval(shapes, angles_i, angles_j, encounter.reach, least)
    largest = np.full(len(angles_i), encounter.outer + encounter.reach)
    return -largest, largest


def offsets_of(
    encounter: Encounter, angles_i: np.ndarray, angles_j: np.ndarray, numbers: np.ndarray
) -> np.ndarray:
    """Offsets [m] at many angles and uniform numbers."""
    low, high = bounds_of(encounter, angles_i, angles_j)
    if encounter.meeting == SETTLING:
        return low + numbers * (high - low)
    offsets = flow_offset(numbers, float(high[0]))
    least = LEAST_OFFSET * float(high[0])
    return np.where(np.abs(offsets) < least, np.copysign(least, offsets), offsets)
