"""What the points of a kernel study are for: (θ_i, θ_j, flocs, offset), and what interval of
offsets they cover.

The offset comes first, as the first dimensions of Sobol's sequence are the most even ones.

A settling pair touches exactly where the shadows of the two outlines overlap, as nothing turns them
on the way: offsets are sampled evenly between, `settling_interval`. In a flow the bodies turn as
they come, and offsets are b = ± b_max √u: as often as the flow brings pairs there.
"""

from collections.abc import Sequence

import numpy as np

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
