"""Where the bodies of a case start: at a gap, or interlocked."""

import attrs
import numpy as np
import shapely

TRIES = 400
"""Poses tried before two shapes are said not to interlock."""


def core_of(shape, place, unit):
    """The core at a place (x, y, θ) as a shapely geometry, lengths in ``unit`` [m]."""
    points = shape.placed_vertices(*place) / unit
    kinds = {1: shapely.Point, 2: shapely.LineString}
    return kinds.get(len(points), shapely.Polygon)(points[0] if len(points) == 1 else points)


def outline_gap(one, at_one, other, at_other):
    """Distance of the outlines [m]; −r_i − r_j where the cores meet."""
    unit = min(one.equivalent_radius, other.equivalent_radius)
    cores = core_of(one, at_one, unit), core_of(other, at_other, unit)
    return shapely.distance(*cores) * unit - one.radius - other.radius


def place_at_gap(one, at_one, other, angle, direction, gap):
    """The place (x, y, θ) of the other body, moved in towards the first until the gap is left."""
    reach = one.bounding_radius + other.bounding_radius + max(gap, 0.0)
    way = np.array([np.cos(direction), np.sin(direction)])
    distance = 1.0001 * reach
    for _ in range(300):
        place = (*(np.asarray(at_one[:2]) + distance * way), angle)
        excess = outline_gap(one, at_one, other, place) - gap
        if excess < 1e-15 * reach:
            break
        distance -= excess
    return place


def interlocked_place(draw, one, other):
    """Where the hulls of two shapes overlap but their outlines hardly do; None if not found."""
    unit = min(one.equivalent_radius, other.equivalent_radius)
    hull = core_of(one, (0.0, 0.0, 0.0), unit).convex_hull
    limit = -0.1 * (one.radius + other.radius)
    best, nearest = None, np.inf
    for _ in range(TRIES):
        spread = draw.rng.uniform(-1.0, 1.0, 2) * (one.bounding_radius + other.bounding_radius)
        place = (*(0.6 * spread), draw.angle())
        gap = outline_gap(one, (0.0, 0.0, 0.0), other, place)
        if gap < limit or gap >= nearest:
            continue
        if hull.intersects(core_of(other, place, unit).convex_hull):
            best, nearest = place, gap
    return best


def placed(body, place, velocity=(0.0, 0.0), spin=0.0):
    """A copy of the body at a place (x, y, θ) in motion."""
    return attrs.evolve(
        body, position=tuple(place[:2]), angle=place[2], velocity=tuple(velocity), spin=spin
    )
