"""Rough polygons, and crowds of them that settle in water: scenes of the benchmarks of swarms."""

import math

import numpy as np

from flocsim import Body, Fluid, SpheroPolygon
from flocsim.swarms.placement import place_at_random

WATER = Fluid(buoyancy=True)
DENSITY = 2650.0
"""Of the solid [kg/m³]."""

SPHERORADIUS = 0.08
"""Of a polygon, over its radius."""


def rough_polygon(count, radius, rng, rough=0.4):
    """A star-shaped polygon of so many vertices, their distances from the centre within a share
    ``rough`` of the radius [m]."""
    angles = 2.0 * np.pi * np.arange(count) / count
    reach = radius * (1.0 + rough * rng.uniform(-1.0, 1.0, count))
    points = np.column_stack([reach * np.cos(angles), reach * np.sin(angles)])
    return SpheroPolygon(points, radius=SPHERORADIUS * radius)


def crowd(number, seed, fraction=0.3, radius=6e-6, spread=0.25, vertices=10):
    """(bodies, side [m]) of so many polygons at rest at random places of a square box that repeats
    itself, an area fraction of it; sizes spread log-normally about a radius [m]."""
    rng = np.random.default_rng(seed)
    radii = radius * np.exp(spread * rng.normal(size=number))
    shapes = [rough_polygon(vertices, each, rng) for each in radii]
    side = math.sqrt(sum(shape.area for shape in shapes) / fraction)
    places = place_at_random(shapes, (side, side), rng)
    bodies = [
        Body(shape, (x, y), angle=angle, density=DENSITY)
        for shape, (x, y, angle) in zip(shapes, places.tolist(), strict=True)
    ]
    return bodies, side
