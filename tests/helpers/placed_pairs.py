"""Where two shapes start as one settles on the other: flocsim.ensembles.collision.start."""

import numpy as np

from flocsim.compiler.composer import compiled
from flocsim.ensembles.collision.start import Start, grazing_offset, place_of
from flocsim.geometry.contact.core_points import outlines_of


def grazing(shapes, angles):
    """The displacement [m] at which they just graze."""
    radii = [float(shape.radius) for shape in shapes]
    return compiled(grazing_offset)(outlines_of(shapes), *map(float, angles), *radii)


def place_pair(shapes, angles, displacement, gap):
    """Places (2, 3) of i at the origin and j above it, displaced [m], a gap [m] apart."""
    largest = displacement or 1.0  # 0 stands for that at which they graze
    start = Start.one(
        angle_i=angles[0], angle_j=angles[1], radius_i=shapes[0].radius, radius_j=shapes[1].radius,
        reach=sum(shape.bounding_radius for shape in shapes),
        share=displacement / largest, largest=largest, gap=gap,
    )  # fmt: skip
    x, y = compiled(place_of)(outlines_of(shapes), start)
    return np.array([[0.0, 0.0, angles[0]], [x, y, angles[1]]])
