"""A shape of a wanted size with a wanted spheroradius."""

from collections.abc import Sequence

import numpy as np

from flocsim.errors import ShapeError
from flocsim.geometry.shapes.moments import area_and_growth
from flocsim.geometry.shapes.parts import Part, scaled_parts
from flocsim.geometry.shapes.shape import Shape
from flocsim.geometry.shapes.spheropolygon import SpheroPolygon, shape_of_parts

SETTLED = 1e-4
"""Relative error of the area from which one more step of the model below leaves less than 1e-9."""


def core_factor(vertices: np.ndarray, radius: float, area: float) -> float:
    """The factor by which the core must be scaled for the swept outline to have an area."""
    return parts_factor([Part((vertices,), radius)], area)


def parts_factor(parts: Sequence[Part], area: float) -> float:
    """The same of several rings, of one radius, which stays what it is.

    While the outline keeps its form, the area is disc + b·factor + c·factor², of which each trial
    gives b and c: scaled as a whole, radius and all, the area goes with the square, and with the
    radius alone it grows by the length of the outline.
    """
    [radius] = {part.radius for part in parts}
    room = area - np.pi * radius**2

    factor = 1.0
    for _ in range(60):
        found, growth = area_and_growth(scaled_parts(parts, factor, 1.0))
        slope = (2.0 * found - radius * growth) / factor
        above = found - area + room
        c = (slope * factor - above) / factor**2
        b = slope - 2.0 * c * factor
        root = b * b + 4.0 * c * room
        step = 2.0 * room / (b + np.sqrt(root)) if root > 0.0 else 0.0
        # Far from the model's reach the area still goes roughly with the square.
        factor = step if 0.2 * factor < step < 5.0 * factor else factor * np.sqrt(area / found)
        if abs(found - area) <= SETTLED * area:
            break
    return factor


def resized(shape: Shape, equivalent_radius: float, radius: float) -> Shape:
    """The shape's core scaled so that, swept by ``radius`` [m], r_eq is exact [m]; a
    Composite, whose parts would come apart, is scaled as a whole, its radii with it.

    Raises ShapeError where the disk alone is already as large as the wanted body.
    """
    if len(shape.parts) > 1:
        return shape.scaled(equivalent_radius / shape.equivalent_radius)
    if radius >= equivalent_radius:
        raise ShapeError(
            f"a spheroradius of {radius:g} m leaves no room for a core in a body of "
            f"r_eq = {equivalent_radius:g} m: choose a smaller spheroradius"
        )
    # Solved in units of the wanted body, far from underflow.
    extent = shape.equivalent_radius
    vertices = shape.vertices / extent
    relative = radius / equivalent_radius
    if shape.is_compound:
        parts = scaled_parts(shape.parts, 1.0 / extent, relative / shape.radius)
        factor = parts_factor(parts, np.pi) * equivalent_radius
        sized = shape_of_parts(scaled_parts(parts, factor, equivalent_radius))
    else:
        factor = core_factor(vertices, relative, np.pi) * equivalent_radius
        sized = SpheroPolygon(vertices * factor, radius)
    return sized.scaled(equivalent_radius / sized.equivalent_radius)
