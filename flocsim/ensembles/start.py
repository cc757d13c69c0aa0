"""Where a binary collision starts: j above i, displaced sideways, outlines a gap apart."""

import math
from functools import cache

import numpy as np

from flocsim.composer import compose
from flocsim.geometry.kernels import edge_count, segment_distance2

MOST_ADVANCES = 1000
"""Moves towards the wanted gap; each is as long as the distance still allows."""


def half_extents(shape, angle):
    """(towards −x, towards +x) extents of a turned outline about its centroid [m]."""
    x = shape.placed_vertices(angle=angle)[:, 0]
    return shape.radius - x.min(), shape.radius + x.max()


def largest_displacement(rule, shape_i, angle_i, shape_j, angle_j):
    """δ_max [m]: facing half-extents ("projected", 1 just grazes), or R_i + R_j ("radius")."""
    if rule == "radius":
        return shape_i.bounding_radius + shape_j.bounding_radius
    return half_extents(shape_i, angle_i)[1] + half_extents(shape_j, angle_j)[0]


def least_distance2(points, core, shift_x, shift_y):
    """Smallest squared distance from shifted points to the edges of a core."""
    least = math.inf
    count = core.shape[0]
    for point in range(points.shape[0]):
        px, py = points[point, 0] + shift_x, points[point, 1] + shift_y
        for edge in range(max(edge_count(count), 1)):
            end = (edge + 1) % count
            distance2 = segment_distance2(
                px, py, core[edge, 0], core[edge, 1], core[end, 0], core[end, 1]
            )
            least = min(least, distance2)
    return least


def start_height(core_i, core_j, contact, reach, displacement, gap):
    """Height of j's centroid over i's [m] at which the outlines are ``gap`` apart.

    ``core_i``, ``core_j`` (N, 2) are turned and centred; ``contact`` = r_i + r_j of the
    spheroradii; ``reach`` = R_i + R_j. From far above, j comes down by the distance that is left
    (it cannot overshoot); where it passes without coming so near, it starts clear above.
    """
    clear = reach + gap
    height = math.sqrt(max(clear * clear - displacement * displacement, 0.0))
    for _ in range(MOST_ADVANCES):
        one = least_distance2(core_j, core_i, displacement, height)
        other = least_distance2(core_i, core_j, -displacement, -height)
        left = math.sqrt(min(one, other)) - contact - gap
        if left <= 1e-6 * gap:
            return height
        height -= left
        if height < -clear:
            break
    return clear


@cache
def compiled_height():
    """`start_height` as machine code."""
    return compose(start_height, {})


def place_pair(shapes, angles, displacement, gap):
    """Places (2, 3) [m, m, rad] of i at the origin and j above it."""
    cores = [
        np.ascontiguousarray(shape.placed_vertices(angle=angle))
        for shape, angle in zip(shapes, angles, strict=True)
    ]
    contact = shapes[0].radius + shapes[1].radius
    reach = shapes[0].bounding_radius + shapes[1].bounding_radius
    height = compiled_height()(*cores, contact, reach, float(displacement), gap)
    return np.array([[0.0, 0.0, angles[0]], [displacement, height, angles[1]]])
