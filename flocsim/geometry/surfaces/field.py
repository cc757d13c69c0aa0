"""The potential that the charges of an outline make around it, in tables.

Nodes lie on a grid, STEP of a charge's unit apart, in square tiles wherever a charge of another
body may be; at each stand the potential and its derivatives, exactly, between which Hermite's
bicubic polynomials go. A potential of charges at touch is within 1e-4 of the sum over them, its
slope within 1e-3, and the force that follows is the slope of the potential in the tables.
"""

from collections.abc import Sequence
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np

import flocsim.arrays as at
from flocsim.compiler.composer import compose
from flocsim.geometry.shapes.shape import Shape
from flocsim.geometry.surfaces.bessel import bessel_pair
from flocsim.geometry.surfaces.charges import (
    check_length,
    points_of,
    rows_of_shape,
    too_long,
    unit_of,
)
from flocsim.geometry.surfaces.pieces import pieces_of_shape

STEP = 0.3

FADED = 12.0
"""Debye lengths beyond which charges are not seen: e^−12 of the force at touch, 6e-6."""

INSIDE = 1.0
"""Units behind an outline up to which there are nodes."""

LEAST = 1e-4
"""(κρ)² below which a charge is not taken for nearer."""

MOST_NODES = 2_000_000
"""Of a body, 64 MB."""


class Field(NamedTuple):
    """The grid, tiles and nodes of a body, or of some; a Scene has the same fields."""

    grids: np.ndarray
    tiles: np.ndarray
    field: np.ndarray


def list_groups(charges, x, y, reach, near):
    """List the rows of charges that may be within a reach [m] of a point; how many they are."""
    count = 0
    for row in range(charges.shape[0]):
        dx, dy = x - charges[row, at.GROUP_X], y - charges[row, at.GROUP_Y]
        most = reach + charges[row, at.GROUP_EXTENT]
        if dx * dx + dy * dy < most * most:
            near[count] = row
            count += 1
    return count


def at_node(charges, near, count, kappa, x, y):
    """(φ, and its derivatives by x, by y [1/m], by both [1/m²]) of the charges listed, at a point;
    what is FADED is left out."""
    value, by_x, by_y, by_both = 0.0, 0.0, 0.0, 0.0
    for k in range(count):
        row = near[k]
        for each in range(int(charges[row, at.GROUP_COUNT])):
            place = at.FIRST_CHARGE + 3 * each
            dx, dy = x - charges[row, place], y - charges[row, place + 1]
            squared = kappa * kappa * (dx * dx + dy * dy)
            if squared > (FADED + 1.0) * (FADED + 1.0):
                continue
            squared = max(squared, LEAST)
            zero, first = bessel_pair(squared)
            size = charges[row, place + 2]
            slope = -size * kappa * kappa * first
            value += size * zero
            by_x += slope * dx
            by_y += slope * dy
            by_both += size * kappa**4 * dx * dy * (zero + 2.0 * first) / squared
    return value, by_x, by_y, by_both


def fill(charges, kappa, step, corners, near, field):
    """Write the nodes of tiles with these lower left corners (m, 2); ``near`` is scratch."""
    side, half = at.TILE + 1, 0.5 * at.TILE * step
    for tile in range(corners.shape[0]):
        x, y = corners[tile, 0] + half, corners[tile, 1] + half
        reach = (FADED + 1.0) / kappa + 1.5 * half
        count = list_groups(charges, x, y, reach, near)
        for node in range(side * side):
            x = corners[tile, 0] + step * (node % side)
            y = corners[tile, 1] + step * (node // side)
            value, by_x, by_y, by_both = at_node(charges, near, count, kappa, x, y)
            row = tile * side * side + node
            field[row, at.POTENTIAL] = value
            field[row, at.BY_X] = step * by_x
            field[row, at.BY_Y] = step * by_y
            field[row, at.BY_XY] = step * step * by_both


@cache
def compiled_fill():
    return compose(fill, {})


def tiles_around(shape, kappa, step):
    """(lower left corner, (across, up), whether a tile has nodes (across · up,)) around a shape."""
    from scipy.spatial import cKDTree

    points, places = points_of(pieces_of_shape(shape), kappa)
    width, reach = at.TILE * step, FADED / kappa
    low, high = points.min(axis=0) - reach, points.max(axis=0) + reach
    counts = np.ceil((high - low) / width).astype(int)
    x, y = (low[k] + width * (np.arange(counts[k]) + 0.5) for k in range(2))
    middles = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    most, inside = reach + 0.75 * width, INSIDE * unit_of(shape, kappa) + 0.75 * width
    away, nearest = cKDTree(points).query(middles, distance_upper_bound=most)
    used = np.isfinite(away)
    nearest = nearest[used]
    outward = points[nearest] - places[nearest]
    behind = np.sum((middles[used] - points[nearest]) * outward, axis=1) < 0.0
    used[used] = ~behind | (away[used] < inside)
    return low, counts, used


@lru_cache(maxsize=32)
def field_of_shape(shape: Shape, kappa: float) -> Field:
    """The Field of a shape around its centroid, at κ [1/m].

    ShapeError for an outline that takes too many charges, or nodes around it.
    """
    check_length(shape, kappa)
    step, side = STEP * unit_of(shape, kappa), at.TILE + 1
    low, counts, used = tiles_around(shape, kappa, step)
    nodes = int(used.sum()) * side * side
    if nodes > MOST_NODES:
        raise too_long(shape, kappa, f"{nodes:.3g} nodes of its field, of {MOST_NODES}")
    tiles = np.where(used, (np.cumsum(used) - 1) * side * side, -1)
    places = np.flatnonzero(used)
    corners = low + at.TILE * step * np.column_stack([places % counts[0], places // counts[0]])
    field = np.empty((nodes, at.FIELD_COLUMNS))
    charges = rows_of_shape(shape, kappa)
    near = np.zeros(len(charges), np.int64)
    compiled_fill()(charges, kappa, step, corners, near, field)
    return Field(np.array([[*low, step, *counts, 0.0, 1.0 / step]]), tiles, field)


def field_of_bodies(shapes: Sequence[Shape], kappa: float) -> Field:
    """The Field of bodies of these shapes at κ [1/m], of all in whose field others are gone along:
    the larger one of two; 0: of so many bodies with none."""
    bounds = [shape.bounding_radius for shape in shapes]
    # The earlier one of two that are as large: outline_sum.between_outlines.
    asked = {bounds.index(max(bounds))} if len(shapes) == 2 else set(range(len(shapes)))
    none = Field(
        np.zeros((1, at.GRID_COLUMNS)), np.zeros(0, np.int64), np.zeros((0, at.FIELD_COLUMNS))
    )
    found = [
        field_of_shape(shape, kappa) if kappa > 0.0 and body in asked else none
        for body, shape in enumerate(shapes)
    ]
    grids = np.concatenate([each.grids for each in found])
    known = [each for each in found if len(each.field)]
    if len(known) == 1:  # tables are large, and not copied where they need not be
        return Field(grids, known[0].tiles, known[0].field)
    grids[:, at.GRID_TILE] = np.cumsum([0, *[len(each.tiles) for each in found[:-1]]])
    before = np.cumsum([0, *[len(each.field) for each in found[:-1]]])
    tiles = [np.where(each.tiles < 0, -1, each.tiles + first)
             for each, first in zip(found, before, strict=True)]  # fmt: skip
    return Field(grids, np.concatenate(tiles), np.concatenate([each.field for each in found]))
