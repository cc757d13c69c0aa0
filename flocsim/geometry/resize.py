"""A shape of a wanted size with a wanted spheroradius."""

import numpy as np

from flocsim.errors import ShapeError
from flocsim.geometry.spheropolygon import SpheroPolygon
from flocsim.geometry.sweep import swept_moments

ACCURACY = 1e-10
"""Relative accuracy of the area before the last, uniform correction."""


def area_of_scaled(vertices, factor, radius):
    """Area [m²] of the core scaled by ``factor``, swept by ``radius``."""
    return swept_moments(vertices * factor, radius)[0]


def core_factor(vertices, radius, area):
    """The factor by which the core must be scaled for the swept outline to have an area."""
    disc = np.pi * radius**2
    low, high = 0.0, np.sqrt(area / area_of_scaled(vertices, 1.0, radius))
    while area_of_scaled(vertices, high, radius) < area:
        high *= 2.0
    at_low, at_high = disc - area, area_of_scaled(vertices, high, radius) - area
    side = 0
    for _ in range(100):
        trial = (low * at_high - high * at_low) / (at_high - at_low)
        miss = area_of_scaled(vertices, trial, radius) - area
        if abs(miss) <= ACCURACY * area:
            break
        if miss < 0.0:
            low, at_low = trial, miss
            at_high *= 0.5 if side == -1 else 1.0
            side = -1
        else:
            high, at_high = trial, miss
            at_low *= 0.5 if side == 1 else 1.0
            side = 1
    return trial


def resized(shape, equivalent_radius, radius):
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
