"""Shapes of the stability table, round ones and such that trouble contact codes; their places."""

import attrs
import numpy as np
import shapely

from flocsim import Sphere, SpheroPolygon
from flocsim.errors import ShapeError


def polar(lengths, angles):
    """Points (N, 2) at the given distances and angles."""
    return (lengths * np.array([np.cos(angles), np.sin(angles)])).T


def sized(core, radius, share):
    """A body of equivalent radius ``radius`` [m] with this core and a spheroradius of a share of
    that radius; None where the core is no simple polygon."""
    try:
        raw = SpheroPolygon(core, share)
    except ShapeError:
        return None
    # One correction is near enough: radii are drawn, not prescribed.
    return raw.scaled(radius / raw.equivalent_radius)


def made(draw, make, radius, share=None):
    """A shape of a maker's random core; its sphero-share is drawn unless given."""
    while True:
        width = share or 10.0 ** draw.uniform(-1.7, -0.5)
        shape = sized(make(draw), radius, width)
        if shape is not None:
            return shape


def convex(count):
    """Makers of convex cores: points of an ellipse in random places."""

    def core(draw):
        angles = np.sort(draw.rng.uniform(0.0, 2.0 * np.pi, count))
        return polar(1.0, angles) * [1.0, draw.uniform(0.3, 1.0)]

    return core


def star(count, least=0.3):
    """Makers of star-shaped cores with rays of very unequal length: deep concavities."""

    def core(draw):
        angles = (np.arange(count) + draw.rng.uniform(-0.3, 0.3, count)) * 2.0 * np.pi / count
        return polar(draw.rng.uniform(least, 1.0, count), angles)

    return core


def wavy(count):
    """Makers of smooth outlines of many vertices."""

    def core(draw):
        angles = np.arange(count) * 2.0 * np.pi / count
        waves = sum(
            draw.uniform(-0.15, 0.15) * np.cos(k * angles + draw.angle()) for k in (2, 3, 5)
        )
        return polar(1.0 + waves, angles)

    return core


def sliver(draw):
    """A triangle or quadrangle a hundred to ten thousand times as long as wide."""
    width = 10.0 ** draw.uniform(-4.0, -2.0)
    if draw.rng.random() < 0.5:
        return np.array([[-1.0, 0.0], [1.0, 0.0], [draw.uniform(-0.9, 0.9), width]])
    return np.array([[-1.0, 0.0], [1.0, 0.0], [0.9, width], [-0.8, width]])


def segment(draw):
    """A core of two points."""
    return np.array([[-1.0, 0.0], [1.0, 0.0]])


def hook(draw):
    """A C whose mouth is open enough for another's arm."""
    angles = np.linspace(0.0, draw.uniform(1.1, 1.5) * np.pi, 9)
    return np.concatenate([polar(1.0, angles), polar(0.7, angles)[::-1]])


def random_shape(draw, count, radius):
    """A convex, star-shaped or wavy polygon of so many vertices; a sphere for one vertex."""
    if count == 1:
        return Sphere(radius)
    if count > 32:
        return made(draw, wavy(count), radius)
    return made(draw, draw.pick(convex, star)(count), radius)


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
