"""A shape of a wanted size with a wanted spheroradius."""

from collections.abc import Callable, Sequence

import numpy as np

from flocsim.errors import ShapeError
from flocsim.geometry.shapes.moments import swept_moments, union_moments
from flocsim.geometry.shapes.parts import Part, scaled_parts
from flocsim.geometry.shapes.shape import Shape
from flocsim.geometry.shapes.spheropolygon import SpheroPolygon, shape_of_parts

ACCURACY = 1e-10
"""Relative accuracy of the area before the last, uniform correction."""


def area_of_scaled(vertices: np.ndarray, factor: float, radius: float) -> float:
    return swept_moments(vertices * factor, radius)[0]


def core_factor(vertices: np.ndarray, radius: float, area: float) -> float:
    """The factor by which the core must be scaled for the swept outline to have an area."""
    return factor_for(
        lambda factor: area_of_scaled(vertices, factor, radius), np.pi * radius**2, area
    )


def parts_factor(parts: Sequence[Part], area: float) -> float:
    """The same of several rings, whose radii stay what they are."""
    return factor_for(
        lambda factor: union_moments(scaled_parts(parts, factor, 1.0))[0],
        np.pi * max(part.radius for part in parts) ** 2, area,
    )  # fmt: skip


def factor_for(area_at: Callable[[float], float], disc: float, area: float) -> float:
    """The factor at which ``area_at`` is an area; ``disc``: what is left of it at 0.

    While the outline keeps its form, the area is disc + b·factor + c·factor²: each trial fits b
    and c to the two latest areas, which settles it in three or four.
    """
    guess = np.sqrt(area / area_at(1.0))
    trials = [(f, area_at(f)) for f in (1e-3 * guess, guess)]
    for _ in range(60):
        (f, at_f), (g, at_g) = trials[-2:]
        if abs(at_g - area) <= ACCURACY * area:
            return g
        (b, c) = np.linalg.solve([[f, f * f], [g, g * g]], [at_f - disc, at_g - disc])
        root = b * b + 4.0 * c * (area - disc)
        step = 2.0 * (area - disc) / (b + np.sqrt(root)) if root > 0.0 else 0.0
        # Far from the model's reach the area still goes roughly with the square.
        trial = step if 0.2 * g < step < 5.0 * g else g * np.sqrt(area / at_g)
        trials.append((trial, area_at(trial)))
    return trials[-1][0]


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
