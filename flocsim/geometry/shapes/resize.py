"""A shape of a wanted size with a wanted spheroradius."""

import numpy as np

from flocsim.errors import ShapeError
from flocsim.geometry.shapes.moments import swept_moments
from flocsim.geometry.shapes.shape import Shape
from flocsim.geometry.shapes.spheropolygon import SpheroPolygon

ACCURACY = 1e-10
"""Relative accuracy of the area before the last, uniform correction."""


def area_of_scaled(vertices: np.ndarray, factor: float, radius: float) -> float:
    return swept_moments(vertices * factor, radius)[0]


def core_factor(vertices: np.ndarray, radius: float, area: float) -> float:
    """The factor by which the core must be scaled for the swept outline to have an area.

    While the outline keeps its form, the area is π r² + b·factor + c·factor²: each trial fits b
    and c to the two latest areas, which settles it in three or four.
    """
    disc = np.pi * radius**2
    guess = np.sqrt(area / area_of_scaled(vertices, 1.0, radius))
    trials = [(f, area_of_scaled(vertices, f, radius)) for f in (1e-3 * guess, guess)]
    for _ in range(60):
        (f, at_f), (g, at_g) = trials[-2:]
        if abs(at_g - area) <= ACCURACY * area:
            return g
        (b, c) = np.linalg.solve([[f, f * f], [g, g * g]], [at_f - disc, at_g - disc])
        root = b * b + 4.0 * c * (area - disc)
        step = 2.0 * (area - disc) / (b + np.sqrt(root)) if root > 0.0 else 0.0
        # Far from the model's reach the area still goes roughly with the square.
        trial = step if 0.2 * g < step < 5.0 * g else g * np.sqrt(area / at_g)
        trials.append((trial, area_of_scaled(vertices, trial, radius)))
    return trials[-1][0]


def resized(shape: Shape, equivalent_radius: float, radius: float) -> Shape:
    """The SpheroPolygon's core scaled so that, swept by ``radius`` [m], r_eq is exact [m].

    Raises ShapeError where the disk alone is already as large as the wanted body.
    """
    if radius >= equivalent_radius:
        raise ShapeError(
            f"a spheroradius of {radius:g} m leaves no room for a core in a body of "
            f"r_eq = {equivalent_radius:g} m: choose a smaller spheroradius"
        )
    # Solved in units of the wanted body, far from underflow.
    extent = shape.equivalent_radius
    vertices = shape.vertices / extent
    relative = radius / equivalent_radius
    factor = core_factor(vertices, relative, np.pi) * equivalent_radius
    sized = SpheroPolygon(vertices * factor, radius)
    return sized.scaled(equivalent_radius / sized.equivalent_radius)
