"""Where two shapes start as one settles on the other: flocsim.ensembles.collision.start."""

import numpy as np

from flocsim.compiler.composer import compiled
from flocsim.ensembles.collision.start import grazing_offset, place_above
from flocsim.geometry.contact.core_points import outlines_of


def grazing(shapes, angles):
    """The displacement [m] at which they just graze."""
    radii = [float(shape.radius) for shape in shapes]
    return compiled(grazing_offset)(outlines_of(shapes), *map(float, angles), *radii)


def place_pair(shapes, angles, displacement, gap):
    """Places (2, 3) of i at the origin and j above it, displaced [m], a gap [m] apart."""
    radii = [float(shape.radius) for shape in shapes]
    reach = sum(float(shape.bounding_radius) for shape in shapes)
    x, y = compiled(place_above)(
        outlines_of(shapes), *map(float, angles), *radii, reach, 1.0, float(displacement), gap, 0.0
    )
    return np.array([[0.0, 0.0, angles[0]], [x, y, angles[1]]])
