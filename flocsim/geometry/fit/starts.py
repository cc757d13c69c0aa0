"""Choices of N points that a fit can start from, made from the outline of a mask.

Even spacing; a ring inside; the points that tell most of the outline.
"""

import numpy as np

from flocsim.geometry.fit.coverage import compiled
from flocsim.geometry.fit.simple import simple_inset

HEADINGS = ((0, 1), (1, 0), (0, -1), (-1, 0))
"""Walks along pixel edges as (rows, columns): right, down, left, up, each a right turn on."""


def trace_outline(mask: np.ndarray) -> np.ndarray:
    """The outer outline of a mask's first region, (M, 2) as x = column, y = row.

    The points are the middles of the pixel edges between the region and its outside, in order
    around the region, which is taken 8-connected.  Their polygon is simple.  `mask` has a margin
    of at least one empty pixel.
    """
    start = row, column = tuple(int(place[0]) for place in np.nonzero(mask))
    inside = mask.tolist()
    heading, middles = 0, []
    while True:
        down, right = HEADINGS[heading]
        middles.append((column - 0.5 + 0.5 * right, row - 0.5 + 0.5 * down))
        row, column = row + down, column + right
        # The pixels ahead of the upper left corner of this one, on the left and on the right.
        on_left, on_right = (
            inside[row + (down + hand * right - 1) // 2][column + (right - hand * down - 1) // 2]
            for hand in (-1, 1)
        )
        heading = (heading + (-1 if on_left else 0 if on_right else 1)) % 4
        if (row, column) == start and heading == 0:
            return np.array(middles)


def even_points(outline: np.ndarray, count: int) -> np.ndarray:
    """`count` points evenly spaced along the closed outline."""
    closed = np.vstack([outline, outline[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))])
    places = np.arange(count) / count * along[-1]
    return np.column_stack([np.interp(places, along, axis) for axis in closed.T])


def ring_inside(mask: np.ndarray, count: int) -> np.ndarray:
    """A regular polygon around the deepest pixel of the mask: a start that is always simple."""
    from scipy.ndimage import distance_transform_edt

    depth = distance_transform_edt(mask)
    row, column = np.unravel_index(np.argmax(depth), depth.shape)
    radius = max(0.5 * depth[row, column], 1.0, 0.01 * count)
    angles = 2.0 * np.pi * np.arange(count) / count
    return np.column_stack([column + radius * np.cos(angles), row + radius * np.sin(angles)])


def inset(points: np.ndarray, mask: np.ndarray, depth: float) -> np.ndarray:
    """A simple polygon through the points, drawn in by `depth` [px] or less where it must.

    Points whose polygon is not simple are reordered, or a ring inside the mask takes their place.
    """
    drawn = np.array(points)
    if compiled(simple_inset)(drawn, float(depth)):
        return drawn
    drawn = ring_inside(mask, len(points))
    compiled(simple_inset)(drawn, float(depth))
    return drawn


def even_start(mask: np.ndarray, count: int, radius: float) -> np.ndarray:
    return inset(even_points(trace_outline(mask), count), mask, radius)


def triangle(points, before, k, after):
    """Twice the area of the triangle of three of the points."""
    ux, uy = points[before, 0] - points[k, 0], points[before, 1] - points[k, 1]
    wx, wy = points[after, 0] - points[k, 0], points[after, 1] - points[k, 1]
    return abs(ux * wy - uy * wx)


def telling_points(outline: np.ndarray, count: int) -> np.ndarray:
    """The `count` points that tell most of a closed outline (Visvalingam and Whyatt 1993): of its
    own, or of twice as many even ones where it has fewer.

    The point that spans the smallest triangle with its neighbours is left out, again and again.
    """
    points = outline if len(outline) >= 2 * count else even_points(outline, 2 * count)
    areas = np.empty(len(points))
    compiled(leave_out)(points, count, areas)
    return points[np.isfinite(areas)]


def leave_out(points, count, areas):
    """Twice the areas of the triangles of all but `count` points, inf where one is left out."""
    size = len(points)
    before, after = np.arange(size) - 1, np.arange(size) + 1
    before[0], after[size - 1] = size - 1, 0
    for k in range(size):
        areas[k] = triangle(points, before[k], k, after[k])
    for _ in range(size - count):
        k = np.argmin(areas)
        areas[k] = np.inf
        left, right = before[k], after[k]
        after[left], before[right] = right, left
        areas[left] = triangle(points, before[left], left, right)
        areas[right] = triangle(points, left, right, after[right])
